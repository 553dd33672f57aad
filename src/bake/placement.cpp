// SPDX-License-Identifier: Apache-2.0
#include "bake/placement.h"

#include <algorithm>

namespace vellum
{
namespace
{

// Above this many texels from the origin, single precision no longer distinguishes texels.
constexpr double kMaxTexels = 16777216.0;

double size(const Point &p)
{
    return std::abs(p.x) + std::abs(p.y);
}

} // namespace

bool usable(const TriangleUvs &uvs, const AlphaTexture &texture)
{
    return std::all_of(uvs.begin(), uvs.end(), [&](const TexCoord &t) {
        return std::isfinite(t.u) && std::isfinite(t.v) && std::abs(double{t.u}) * texture.width < kMaxTexels &&
               std::abs(double{t.v}) * texture.height < kMaxTexels;
    });
}

Placement::Placement(const AlphaTexture &texture, const CellMap &map, const BakeOptions &options,
                     const TriangleUvs &uvs, uint32_t level, double uvTerms)
{
    // A texture coordinate times the size is exact: 24 and 25 bits.
    std::array<Point, 3> vertices;
    for (size_t i = 0; i < 3; ++i)
        vertices[i] = {double{uvs[i].u} * texture.width - 0.5, double{uvs[i].v} * texture.height - 0.5};
    const auto [minX, maxX] = std::minmax({vertices[0].x, vertices[1].x, vertices[2].x});
    const auto [minY, maxY] = std::minmax({vertices[0].y, vertices[1].y, vertices[2].y});
    unwrappedX = static_cast<int64_t>(std::floor(minX));
    unwrappedY = static_cast<int64_t>(std::floor(minY));
    baseX = map.axisX().reduced(unwrappedX);
    baseY = map.axisY().reduced(unwrappedY);
    for (Point &p : vertices)
        p = {p.x - static_cast<double>(unwrappedX), p.y - static_cast<double>(unwrappedY)};
    const Point e1{vertices[1].x - vertices[0].x, vertices[1].y - vertices[0].y};
    const Point e2{vertices[2].x - vertices[0].x, vertices[2].y - vertices[0].y};
    const double scale = 1.0 / (1 << level); // a power of two: multiplying with it is exact
    origin = vertices[0];
    stepI = {e1.x * scale, e1.y * scale};
    stepJ = {e2.x * scale, e2.y * scale};
    low = {std::min({0.0, stepI.x, stepJ.x}), std::min({0.0, stepI.y, stepJ.y})};
    high = {std::max({0.0, stepI.x, stepJ.x}), std::max({0.0, stepI.y, stepJ.y})};

    // Where a sample can fall around the exact position: sub-texel precision; single-precision interpolation, whose
    // products and sums are as large as the coordinates themselves; and hits outside the micro-triangle.
    const auto margin = [&](float TexCoord::*axis, double texels) {
        const double largest =
            std::max<double>({std::abs(uvs[0].*axis), std::abs(uvs[1].*axis), std::abs(uvs[2].*axis), uvTerms});
        const double slope =
            std::abs(double{uvs[1].*axis} - uvs[0].*axis) + std::abs(double{uvs[2].*axis} - uvs[0].*axis);
        // No texel is further away than that, and it can be counted in cells.
        constexpr double kMost = 0x1p26;
        return std::min(kMost, options.subtexelTolerance + texels * (largest * options.interpolationTolerance +
                                                                     slope * options.barycentricTolerance));
    };
    marginX = margin(&TexCoord::u, texture.width);
    marginY = margin(&TexCoord::v, texture.height);

    const double twice = e1.x * e2.y - e1.y * e2.x;
    const double turn = twice < 0 ? -1 : 1;
    area = std::abs(twice) * scale;
    gradientI = {turn * e2.y, -turn * e2.x};
    gradientJ = {-turn * e1.y, turn * e1.x};
    gradientSum = {gradientI.x + gradientJ.x, gradientI.y + gradientJ.y};

    // With u = 2^-53 and m the largest coordinate of a vertex in texels: a vertex is off by 2um (the half, the whole
    // position), e1 and e2 by 6um, and a lattice point by 2um + 6um + 4um more for its own products and sums. The rest
    // is for later computations.
    const double largest = std::max({std::abs(minX), std::abs(maxX), std::abs(minY), std::abs(maxY), 1.0});
    slack = 0x1p-46 * largest;
    // The functions are cross products of a vector from the triangle to a cell that it touches, and an edge.
    lineSlack = 16 * slack * (size(e1) + size(e2) + marginX + marginY + 4);
    // Neighbouring texels differ by twice the largest, so a value changes by no more than four times that for each
    // texel of distance; and it is rounded itself, together with the cutoff.
    largestValue = map.largest();
    valueSlack = 64 * slack * map.largest() + 0x1p-46 * (map.largest() + std::abs(options.cutoff));
    exact = options.valueTolerance == 0 && marginX == 0 && marginY == 0;
}

double Placement::boxCells(const SubTriangle &sub) const
{
    const double steps = std::abs(static_cast<double>(sub.size));
    return ((high.x - low.x) * steps + 2 * marginX + 2) * ((high.y - low.y) * steps + 2 * marginY + 2);
}

bool Placement::spansTexture(const CellMap &map, const SubTriangle &sub) const
{
    const Point corner = at(sub.i, sub.j);
    const auto spans = [&](const Axis &axis, int64_t base, double Point::*along, double margin) {
        const double a = corner.*along + low.*along * sub.size;
        const double b = corner.*along + high.*along * sub.size;
        const auto from = static_cast<double>(base);
        return axis.spans(from + std::min(a, b) - margin, from + std::max(a, b) + margin);
    };
    return spans(map.axisX(), baseX, &Point::x, marginX) && spans(map.axisY(), baseY, &Point::y, marginY);
}

} // namespace vellum
