// SPDX-License-Identifier: Apache-2.0
#include "verify/polygon.h"

#include <algorithm>
#include <limits>

namespace vellum::verify
{
namespace
{

// The corners of a box, counterclockwise where y points up.
constexpr std::array<Point, 4> kBox{{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}};

// The corner of the box that is furthest out, seen along an edge of a polygon whose inner side is on the left.
unsigned outermost(const Point &edge)
{
    // (edge.y, -edge.x) points outwards.
    if (edge.y >= 0 && edge.x > 0)
        return 1;
    if (edge.y > 0)
        return 2;
    return edge.x < 0 ? 3 : 0;
}

Point towards(const Point &from, const Point &to)
{
    return {to.x - from.x, to.y - from.y};
}

// `corners` go counterclockwise, or there are two.
Polygon widenedCorners(const Point *corners, unsigned count, const Point &margin)
{
    Polygon sum;
    for (unsigned i = 0; i < count; ++i) {
        const Point &p = corners[i];
        const unsigned last = outermost(towards(p, corners[(i + 1) % count]));
        unsigned corner = outermost(towards(corners[(i + count - 1) % count], p));
        const auto add = [&] { sum.add({p.x + kBox[corner].x * margin.x, p.y + kBox[corner].y * margin.y}); };
        for (add(); corner != last; add())
            corner = (corner + 1) % 4;
    }
    return sum;
}

} // namespace

Polygon widened(const std::array<Point, 3> &triangle, double marginX, double marginY)
{
    Polygon polygon;
    if (marginX == 0 && marginY == 0) {
        for (const Point &p : triangle)
            polygon.add(p);
        return polygon;
    }
    const Point margin{marginX, marginY};
    const Point a = towards(triangle[0], triangle[1]);
    const Point b = towards(triangle[0], triangle[2]);
    const double left = a.x * b.y;
    const double right = a.y * b.x;
    const double turn = left - right;
    if (std::abs(turn) > 0x1p-50 * (std::abs(left) + std::abs(right))) {
        const std::array<Point, 3> corners{triangle[0], triangle[turn > 0 ? 1 : 2], triangle[turn > 0 ? 2 : 1]};
        return widenedCorners(corners.data(), 3, margin);
    }
    // The third corner is on the longest edge, give or take less than is promised.
    std::array<Point, 2> ends{triangle[0], triangle[1]};
    const auto length = [](const Point &p, const Point &q) { return std::abs(q.x - p.x) + std::abs(q.y - p.y); };
    if (length(triangle[1], triangle[2]) > length(ends[0], ends[1]))
        ends = {triangle[1], triangle[2]};
    if (length(triangle[0], triangle[2]) > length(ends[0], ends[1]))
        ends = {triangle[0], triangle[2]};
    if (length(ends[0], ends[1]) > 0)
        return widenedCorners(ends.data(), 2, margin);
    for (const Point &corner : kBox)
        polygon.add({ends[0].x + corner.x * margin.x, ends[0].y + corner.y * margin.y});
    return polygon;
}

Extremes extremesOver(const Polygon &polygon, const CellTexels &texels, double x, double y)
{
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    const double a = texels.f10 - texels.f00;
    const double b = texels.f01 - texels.f00;
    const double c = (texels.f11 - texels.f01) - a;
    const auto polar = [&](const Point &p, const Point &q) {
        return texels.f00 + a * (p.x + q.x) / 2 + b * (p.y + q.y) / 2 + c * (p.x * q.y + q.x * p.y) / 2;
    };
    const auto local = [&](const Point &p) { return Point{p.x - x, p.y - y}; };

    Extremes extremes{kInfinity, {{}, kInfinity}, {{}, -kInfinity}, -kInfinity};
    const auto found = [&](const Point &at, double value) {
        if (value < extremes.least.value)
            extremes.least = {at, value};
        if (value > extremes.most.value)
            extremes.most = {at, value};
    };
    const auto bounded = [&](double value) {
        extremes.floor = std::min(extremes.floor, value);
        extremes.ceiling = std::max(extremes.ceiling, value);
    };
    Point p = local(polygon[polygon.count() - 1]);
    double first = polar(p, p);
    for (unsigned i = 0; i < polygon.count(); ++i) {
        const Point q = local(polygon[i]);
        const double inner = polar(p, q);
        const double last = polar(q, q);
        found(polygon[i], last);
        bounded(last);
        const bool below = inner < first && inner < last;
        const bool above = inner > first && inner > last;
        if (below || above) {
            const double t = (first - inner) / ((first - inner) + (last - inner));
            const double before = first + t * (inner - first);
            const double after = inner + t * (last - inner);
            const double turn = before + t * (after - before);
            bounded(before);
            bounded(turn);
            bounded(after);
            found({p.x + t * (q.x - p.x) + x, p.y + t * (q.y - p.y) + y}, turn);
        }
        p = q;
        first = last;
    }
    return extremes;
}

} // namespace vellum::verify
