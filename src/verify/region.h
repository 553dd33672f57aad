// SPDX-License-Identifier: Apache-2.0
// Determines the outcomes of the alpha test over a micro-triangle, by division: bounds of all texels that a box around
// it reads decide most, a part that they leave open is divided in four, and the smallest parts are examined cell by
// cell. Nothing is decided by rounding: what double precision hides is decided in fractions, or stays open.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "verify/polygon.h"
#include "verify/texels.h"

namespace vellum::verify
{

// The limits of how a GPU may differ from the mathematics; as in docs/baking.md.
struct Tolerances {
    double value = 2.0 / 255.0;              // of the filtered value
    double subtexel = 1.0 / 16.0;            // of the sample's place, in texels
    double barycentric = 1e-5;               // of the hit's place, in barycentrics
    double interpolation = 16.0 / (1 << 24); // of a texture coordinate, relative to the triangle's largest
};

// The values that are opaque, and those that are transparent. Values between are neither: only unknown is true of them.
struct AlphaRule {
    double transparentBelow = 0.5;
    double opaqueFrom = 0.5;
};

enum class Answer : uint8_t { No, Yes, Open };

// True if there is a place whose value is below the upper threshold ("not opaque"), and one whose value is not below
// the lower one ("not transparent"). Without tolerances they are those of the rule.
struct Verdict {
    Answer notOpaque = Answer::No;
    Answer notTransparent = Answer::No;
    Witness belowOpaque; // where Yes
    Witness aboveTransparent;
};

enum class Ask : uint8_t { NotOpaque = 1, NotTransparent = 2, Both = 3 };

// A triangle over its texture. Corners are in texels.
class Region
{
public:
    Region(const Texels &texels, const TriangleCorners &triangle, const Tolerances &tolerances, const AlphaRule &rule);

    // Coordinates are finite, and so near that there are numbers for what lies between texels. Nothing below may be
    // called otherwise.
    [[nodiscard]] bool measurable() const { return measurable_; }
    // The baker leaves triangles unknown that are further away than single precision distinguishes texels.
    [[nodiscard]] bool far() const { return far_; }

    // A part of the triangle: its corners, and the factor of the value there.
    struct Part {
        std::array<Point, 3> corners;
        std::array<double, 3> factors;
    };
    [[nodiscard]] Part part(const MicroCorners &corners, uint32_t level) const;
    // Bounds for the values at a part, margins included.
    [[nodiscard]] Range bounds(const Part &part) const;
    [[nodiscard]] double high() const { return high_; }
    [[nodiscard]] double low() const { return low_; }

    // Over a micro-triangle, with margins. May say Open; where all tolerances are 0 and the factor is the same all over
    // the triangle, only when work() is used up.
    [[nodiscard]] Verdict operator()(const MicroCorners &corners, uint32_t level, Ask ask);
    // The value in double precision.
    [[nodiscard]] Witness valueAt(const Part &part) const;

    // The number of further parts to examine. Huge slivers over a texture of noise would take hours.
    uint64_t work = 0;

private:
    // A cell that rounding hides.
    struct OpenCell {
        int64_t x, y;
        Witness least, most;
    };
    struct Search {
        bool wantsOpaque;
        bool wantsTransparent;
        Verdict verdict;
        std::vector<OpenCell> cells;
    };

    [[nodiscard]] TexelBox boxOf(const Part &part) const;
    [[nodiscard]] Range factorsOf(const Part &part) const;
    // Returns whether values in a range could answer an open question.
    [[nodiscard]] bool matters(const Search &search, const Range &values) const;
    void found(Search &search, const Witness &least, const Witness &most, double slack) const;
    void leaveOpen(Search &search, const Range &values) const;
    void visit(Search &search, const Part &part, unsigned depth, unsigned small);
    void divide(Search &search, const Part &part, unsigned depth, unsigned small);
    void sample(Search &search, const Point &at, double factor) const;
    [[nodiscard]] Range lookAtCells(Search &search, const Part &part, const TexelBox &box, const Range &factors);
    [[nodiscard]] Range bilinear(Search &search, Polygon polygon, int64_t x, int64_t y, const Range &factors) const;
    [[nodiscard]] Range nearest(Search &search, const Polygon &polygon, int64_t x, int64_t y,
                                const Range &factors) const;
    void leaveCell(Search &search, const OpenCell &cell, const Range &values) const;
    void decideExactly(Search &search, const MicroCorners &corners, uint32_t level);

    const Texels &texels_;
    TriangleCorners triangle_;
    AlphaRule rule_;
    double low_;
    double high_;
    bool measurable_ = true;
    bool far_ = false;
    bool exact_; // no tolerances
    bool even_;  // the factor is the same all over
    std::array<Point, 3> corners_;
    double marginX_ = 0;
    double marginY_ = 0;
    double slack_ = 0;      // no coordinate is off by more
    double valueSlack_ = 0; // nor a filtered value, before it is multiplied
    double factorMargin_ = 0;
};

} // namespace vellum::verify
