// SPDX-License-Identifier: Apache-2.0
// Tests whether the alpha test has both outcomes in the part of a micro-triangle that lies in one cell, in double
// precision.
#pragma once

#include <array>

#include "bake/numbers/float4.h"
#include "bake/placement.h"
#include "bake/texture/cell_map.h"

namespace vellum
{

enum class Crossing {
    No,   // one outcome, or the two do not touch
    Yes,  // both
    Open, // rounding hides it
};

// A mixed cell in single precision: enough to say what is far from doubtful.
struct NearCell {
    float x, y;             // of texel f00, from a point near by
    float i, j;             // the lattice functions of Placement at the middle
    float f00, cx, cy, cxy; // the filtered value is f00 + cx * x + cy * y + cxy * x * y; not a number if a texel is
                            // not finite
};

class PieceTest
{
public:
    PieceTest(const Placement &placement, Filter filter, const Thresholds &thresholds);

    // `corner` is the lattice point of a micro-triangle, seen from the cell's texel f00; it has size 1, or -1 if
    // `inverted`. Margins around the micro-triangle belong to it.
    [[nodiscard]] Crossing operator()(Point corner, bool inverted, const Cell &cell) const
    {
        return filter_ == Filter::Bilinear ? bilinear(corner, shapes_[inverted ? 1 : 0], cell)
                                           : nearest(corner, shapes_[inverted ? 1 : 0], cell);
    }

    // Returns false where a cell lies beyond an edge.
    [[nodiscard]] bool touches(Point corner, bool inverted) const
    {
        for (const Line &line : shapes_[inverted ? 1 : 0].lines) {
            const double reach = 0.5 * (std::abs(line.gradient.x) + std::abs(line.gradient.y)) + lineSlack_;
            if ((0.5 - corner.x) * line.gradient.x + (0.5 - corner.y) * line.gradient.y + line.constant < -reach)
                return false;
        }
        return true;
    }

    // Sets the values of a cell in single precision, and not its place.
    void setValues(NearCell &near, const Cell &cell) const;
    // Tests bilinear filtering four times as fast, and returns Open more often. The place of the cell does not matter.
    [[nodiscard]] Crossing quick(Point corner, bool inverted, const NearCell &cell) const;
    [[nodiscard]] const Thresholds &thresholds() const { return thresholds_; }

private:
    // An edge of a micro-triangle, moved outwards by the margins.
    struct Edge {
        Point start; // from the lattice point
        Point delta;
        Point inverse; // of delta; 0 where delta is
    };
    // A function that is not negative on the inner side of an edge: w.x * gradient.x + w.y * gradient.y + constant, for
    // w from the lattice point.
    struct Line {
        Point gradient;
        double constant;
    };
    // The edges and lines of a shape, a lane for each; the last edge is there twice.
    struct QuickShape {
        Float4 startX, startY, deltaX, deltaY, inverseX, inverseY;
        std::array<float, 3> lineX, lineY, lineConstant;
        float lowX, lowY, highX, highY;
    };
    struct Shape {
        std::array<Edge, 3> edges;
        std::array<Line, 3> lines;
        Point low; // the box around it, from the lattice point
        Point high;
    };

    void makeQuick(const Placement &placement);
    [[nodiscard]] Crossing bilinear(Point corner, const Shape &shape, const Cell &cell) const;
    [[nodiscard]] Crossing nearest(Point corner, const Shape &shape, const Cell &cell) const;

    Filter filter_;
    bool margins_;
    double clip_; // how far beyond its sides a cell is clipped
    double lineSlack_;
    double opaqueSurely_; // values from here on are opaque, whatever rounding did
    double opaquePerhaps_;
    double transparentSurely_;
    double transparentPerhaps_;
    Thresholds thresholds_;
    std::array<Shape, 2> shapes_;
    std::array<QuickShape, 2> quick_;
    bool tame_; // values are neither too large nor too small for products of them in single precision
    float quickClip_;
    float quickLineSlack_;
    float quickOpaqueSurely_;
    float quickOpaquePerhaps_;
    float quickTransparentSurely_;
    float quickTransparentPerhaps_;
};

} // namespace vellum
