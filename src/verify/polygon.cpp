// SPDX-License-Identifier: Apache-2.0
#include "verify/polygon.h"

#include <algorithm>

namespace vellum::verify
{
namespace
{

// Of a box, counterclockwise where y points up.
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

} // namespace vellum::verify
