// SPDX-License-Identifier: Apache-2.0
// One triangle: its micro-triangles are walked along the curve, and whole branches are settled where bounds allow.
#pragma once

#include "verify/verify.h"

namespace vellum::verify
{

// The corners of the four parts of a (sub-)triangle in the order of the curve, as the specification draws it; on a
// lattice of twice as many steps.
std::array<MicroCorners, 4> childrenOnCurve(const MicroCorners &corners);

// The claims of a micromap about one triangle.
struct Claims {
    const uint8_t *data; // packed states; null for a special index
    State special;
    uint32_t level;
    Format format; // of a special index, what it stands for
};

// Counts findings, and lists them until `list` has Options::maxFindings of a kind.
class TriangleWalk
{
public:
    // Does at most `work`, as in Options. `list` may be null.
    TriangleWalk(const Texels &texels, const TriangleCorners &triangle, const Claims &claims, const Options &options,
                 uint64_t work, std::vector<Finding> *list);
    Counts operator()();
    // The work that was done, and the least that it takes.
    [[nodiscard]] uint64_t worked() const;
    [[nodiscard]] static uint64_t leastWork(const Claims &claims);

private:
    struct Branch {
        MicroCorners corners; // on the lattice of its level
        uint32_t level;
        uint32_t first; // micro-triangle
    };

    void walk(const Branch &branch);
    void settled(const Branch &branch, State truth);
    void decide(const Branch &leaf);
    void decideClaim(const Branch &leaf, State state);
    void decideUnknown(const Branch &leaf, State state);
    void decideTwoState(const Branch &leaf, State state);
    void decideUnmeasurable();
    [[nodiscard]] State stateOf(uint32_t micro) const;
    [[nodiscard]] bool allAre(const Branch &branch, State state) const;
    void report(Kind kind, uint32_t micro, State state, const Witness &witness);
    void count(State state, uint64_t number = 1);
    [[nodiscard]] bool approximate() const;
    [[nodiscard]] bool mayBeUnknown() const;

    const Texels &texels_;
    Claims claims_;
    bool mayBeSkipped_; // as a whole, because of the alphas of its vertices
    const Options &options_;
    std::vector<Finding> *list_;
    Region region_; // with tolerances
    Region bare_;   // without
    uint64_t work_;
    Counts counts_;
};

} // namespace vellum::verify
