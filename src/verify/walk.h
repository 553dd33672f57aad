// One triangle: its micro-triangles are walked along the curve, and whole branches are settled where bounds allow.
#pragma once

#include "verify/verify.h"

namespace vellum::verify
{

// The corners of the four parts of a (sub-)triangle in the order of the curve, as the specification draws it; on a
// lattice of twice as many steps.
std::array<MicroCorners, 4> childrenOnCurve(const MicroCorners &corners);

// What a micromap says of one triangle.
struct Claims {
    const std::uint8_t *data; // packed states; none where there is a special index
    State special;
    std::uint32_t level;
    Format format;
};

// Adds up what is found; lists findings, too, as long as `list` has room for their kind.
class TriangleWalk
{
public:
    // No more than `work` is done, as of Options. `list` may be null.
    TriangleWalk(const Texels &texels, const TriangleCorners &triangle, const Claims &claims, const Options &options,
                 std::uint64_t work, std::vector<Finding> *list);
    Counts operator()();
    // What it took, and what it takes at least.
    [[nodiscard]] std::uint64_t worked() const;
    [[nodiscard]] static std::uint64_t leastWork(const Claims &claims);

private:
    struct Branch {
        MicroCorners corners; // on the lattice of its level
        std::uint32_t level;
        std::uint32_t first; // micro-triangle
    };

    void walk(const Branch &branch);
    void settled(const Branch &branch, State truth);
    void judge(const Branch &leaf);
    void judgeClaim(const Branch &leaf, State state);
    void judgeUnknown(const Branch &leaf, State state);
    void judgeTwoState(const Branch &leaf, State state);
    void judgeUnmeasurable();
    [[nodiscard]] State stateOf(std::uint32_t micro) const;
    [[nodiscard]] bool allAre(const Branch &branch, State state) const;
    void report(Kind kind, std::uint32_t micro, State state, const Witness &witness);
    void count(State state, std::uint64_t number = 1);
    [[nodiscard]] bool approximate() const;

    const Texels &m_texels;
    Claims m_claims;
    const Options &m_options;
    std::vector<Finding> *m_list;
    Region m_region; // with tolerances
    Region m_bare;   // without
    std::uint64_t m_work;
    Counts m_counts;
};

} // namespace vellum::verify
