// SPDX-License-Identifier: Apache-2.0
// A triangle placed over the cells of a texture, in double precision, with bounds for what rounding can do to it.
//
// The triangle's own coordinates count cells from a whole position near its corners, so that they are small, whatever
// the texture coordinates are. A micro-triangle stands at a lattice point (i, j) with the corners (i, j), (i + n, j)
// and (i, j + n), n = 1 or -1; sub-triangles have an n of more.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

#include "bake/bake.h"
#include "bake/texture/cell_map.h"

namespace vellum
{

struct Point {
    double x = 0;
    double y = 0;
};

// The micro-triangle, or sub-triangle, at lattice point (i, j) with legs of |size| steps.
struct SubTriangle {
    int32_t i;
    int32_t j;
    int32_t size;
};

struct Placement {
    // `uvs` must be usable(): finite, and not too far away.
    Placement(const AlphaTexture &texture, const CellMap &map, const BakeOptions &options, const TriangleUvs &uvs,
              uint32_t level, double uvTerms = 0);

    [[nodiscard]] Point at(int32_t i, int32_t j) const
    {
        return {origin.x + i * stepI.x + j * stepJ.x, origin.y + i * stepI.y + j * stepJ.y};
    }

    // Calls `sink` with the location of each mixed cell that the sub-triangle touches, margins included, and perhaps of
    // others next to it, until it returns true; returns whether it did.
    template <typename Sink>
    bool forMixed(const CellMap &map, const SubTriangle &sub, Sink &&sink) const;
    // The approximate number of cells in the box around a sub-triangle.
    [[nodiscard]] double boxCells(const SubTriangle &sub) const;
    // Returns whether that box has all texels of a texture.
    [[nodiscard]] bool spansTexture(const CellMap &map, const SubTriangle &sub) const;

    int64_t unwrappedX; // the cell that local coordinates count from
    int64_t unwrappedY;
    int64_t baseX; // the same, near the texture
    int64_t baseY;
    Point origin; // vertex 0
    Point stepI;  // from a lattice point to the next towards vertex 1
    Point stepJ;  // and towards vertex 2
    Point low;    // the box of a sub-triangle of size 1 around its lattice point: min(0, stepI, stepJ)
    Point high;
    double marginX; // how far from the exact place, in cells, a sample may be
    double marginY;

    // Twice the area of a micro-triangle, in cells. Three functions count i, j and i + j in these units: their
    // gradients.
    double area;
    Point gradientI;
    Point gradientJ;
    Point gradientSum;

    double slack;        // no coordinate is off by more than this
    double lineSlack;    // nor one of the three functions by more than this
    double largestValue; // no finite texel is further from 0
    double valueSlack;   // nor a filtered value that is computed for such a coordinate
    bool exact;          // no tolerances: what rounding leaves open is decided exactly
};

// Returns whether the triangle can be placed: single precision distinguishes the texels that it covers.
bool usable(const TriangleUvs &uvs, const AlphaTexture &texture);

template <typename Sink>
bool Placement::forMixed(const CellMap &map, const SubTriangle &sub, Sink &&sink) const
{
    const auto each = [&](const CellMap::Word &word) {
        for (uint64_t rest = word.mixed; rest != 0; rest &= rest - 1)
            if (sink(map.place(word, std::countr_zero(rest))))
                return true;
        return false;
    };
    const Point corners[] = {at(sub.i, sub.j), at(sub.i + sub.size, sub.j), at(sub.i, sub.j + sub.size)};
    struct Edge {
        double top, bottom, x, slope;
    };
    std::array<Edge, 3> edges;
    double top = corners[0].y;
    double bottom = corners[0].y;
    for (size_t i = 0; i < 3; ++i) {
        const Point &p = corners[i];
        const Point &q = corners[(i + 1) % 3];
        const Point &a = q.y < p.y ? q : p;
        const Point &b = q.y < p.y ? p : q;
        // Both ends of a level edge belong to other edges, too.
        edges[i] = {a.y, b.y, a.x, b.y > a.y ? (b.x - a.x) / (b.y - a.y) : 0};
        top = std::min(top, p.y);
        bottom = std::max(bottom, p.y);
    }
    const double reachX = marginX + 2 * slack;
    const double reachY = marginY + 2 * slack;
    const auto columnOf = [&](double x) { return baseX + static_cast<int64_t>(std::floor(x)); };
    // The columns between two horizontal lines; none where the first is above the last.
    struct Columns {
        int64_t first, last;
    };
    const auto between = [&](double from, double to) -> Columns {
        double left = 1e300;
        double right = -1e300;
        for (const Edge &e : edges) {
            const double y0 = std::max(from, e.top);
            const double y1 = std::min(to, e.bottom);
            const double x0 = e.x + (y0 - e.top) * e.slope;
            const double x1 = e.x + (y1 - e.top) * e.slope;
            const bool meets = y0 <= y1;
            left = meets ? std::min({left, x0, x1}) : left;
            right = meets ? std::max({right, x0, x1}) : right;
        }
        return left > right ? Columns{1, 0} : Columns{columnOf(left - reachX), columnOf(right + reachX)};
    };

    const auto last = static_cast<int64_t>(std::floor(bottom + reachY));
    auto row = static_cast<int64_t>(std::floor(top - reachY));
    // Many rows can be irrelevant: those next to the outlines of a texture that repeats, or far outside one that does
    // not.
    constexpr int64_t kMany = 64;
    const bool many = last - row >= kMany;
    if (many && map.axisY().spans(static_cast<double>(baseY + row), static_cast<double>(baseY + last))) {
        const Columns all = between(top, bottom);
        if (!map.anyMixedIn(all.first, all.last))
            return false;
    }
    while (row <= last) {
        const double from = static_cast<double>(row) - reachY;
        if (many) {
            const Axis::Run same = map.axisY().run(baseY + row, baseY + last);
            if (same.step == 0 && same.count >= kMany) {
                const Columns all = between(from, static_cast<double>(row + same.count) + reachY);
                const auto any = [](const CellMap::Word &) { return true; };
                if (!map.forMixed(baseY + row, all.first, all.last, any)) {
                    row += same.count;
                    continue;
                }
            }
        }
        const Columns columns = between(from, static_cast<double>(row + 1) + reachY);
        if (map.forMixed(baseY + row, columns.first, columns.last, each))
            return true;
        ++row;
    }
    return false;
}

} // namespace vellum
