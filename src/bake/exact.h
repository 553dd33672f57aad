// SPDX-License-Identifier: Apache-2.0
// The decisions of the classifier in exact arithmetic, for where rounding could get them wrong: a corner that lies just
// on an outline, an edge along it. They are rare but in textures and coordinates that are laid out on a grid.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "bake/bake.h"
#include "bake/numbers/big_int.h"
#include "bake/texture/cell_map.h"

namespace vellum
{

// A point of the lattice that the corners of a triangle's micro-triangles form: vertex 0 is (0, 0), vertex 1 is
// (2^level, 0), vertex 2 is (0, 2^level).
struct LatticePoint {
    int32_t i;
    int32_t j;
};

class ExactTriangle
{
public:
    // The texture must outlive this. `uvs` are finite.
    ExactTriangle(const AlphaTexture &texture, double cutoff, const TriangleUvs &uvs, uint32_t level);

    // Returns whether the alpha test has both outcomes in the part of a micro-triangle that lies in a cell; both are
    // closed. `cell` is in unwrapped positions. A texel of its that is not finite makes any part of it have both.
    [[nodiscard]] bool crosses(const std::array<LatticePoint, 3> &corners, const Cell &cell) const;
    // The outcome at a point: 1 opaque, 0 transparent, -1 where a texel is not finite.
    [[nodiscard]] int side(LatticePoint point, const CellMap &map) const;

private:
    struct Point {
        BigInt x;
        BigInt y;
    };
    // A point in 64-bit integers, which suffice for nearly all triangles and are much faster.
    struct SmallPoint {
        int64_t x;
        int64_t y;
    };
    struct Rational;
    struct Range;
    struct Box;
    struct Patch;

    [[nodiscard]] Point place(LatticePoint point) const;
    // Seen from the cell.
    [[nodiscard]] std::array<Point, 3> cornersIn(const std::array<LatticePoint, 3> &lattice, const Cell &cell) const;
    [[nodiscard]] Patch patch(const Cell &cell) const;
    [[nodiscard]] std::optional<std::array<SmallPoint, 3>> smallCorners(const std::array<LatticePoint, 3> &lattice,
                                                                        const Cell &cell) const;
    // `touchesQuarter(right, bottom)` returns whether the micro-triangle touches a quarter of the cell.
    template <typename Touches>
    [[nodiscard]] bool crossesNearest(const Cell &cell, Touches &&touchesQuarter) const;
    [[nodiscard]] bool crossesNearest(const std::array<LatticePoint, 3> &lattice, const Cell &cell) const;
    [[nodiscard]] bool touches(const std::array<Point, 3> &corners, const Box &box, bool openRight,
                               bool openBottom) const;

    Filter filter_;
    double cutoff_;
    uint32_t level_;
    unsigned shiftX_; // a texel is 2^shiftX_ units of x
    unsigned shiftY_;
    std::array<Point, 3> vertices_; // vertex 0, and the other two from there
    std::array<SmallPoint, 3> smallVertices_;
    bool small_; // smallVertices_ has the values of vertices_; otherwise they do not fit
};

} // namespace vellum
