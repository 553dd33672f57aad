// SPDX-License-Identifier: Apache-2.0
// A triangle to verify and the lattice of its micro-triangles' corners; convex polygons in double precision, how they
// are cut, and the filtered value over the part of one that lies in a cell of a bilinear filter.
#pragma once

#include <array>
#include <cstdint>

namespace vellum::verify
{

// The values at a triangle's vertices 0, 1, 2.
struct TriangleCorners {
    std::array<float, 3> u{};
    std::array<float, 3> v{};
    std::array<float, 3> alpha{1, 1, 1}; // multiplied with the texture's value, interpolated
    // The largest value in a renderer's single-precision computation of u and v: margins are relative to this, where it
    // is more than the largest coordinate.
    float terms = 0;
    bool operator==(const TriangleCorners &) const = default;
};

// Vertex 0 is (0, 0), vertex 1 is (2^level, 0) and vertex 2 is (0, 2^level).
struct LatticePoint {
    int32_t i = 0;
    int32_t j = 0;
};
using MicroCorners = std::array<LatticePoint, 3>;

struct Point {
    double x = 0;
    double y = 0;
};

inline Point middle(const Point &a, const Point &b)
{
    return {(a.x + b.x) / 2, (a.y + b.y) / 2};
}

// Corners in order. One without area, down to a point, is as good as any.
class Polygon
{
public:
    // A heptagon that is cut four times. Rounding may have bent it: each cut makes at most half as many corners more.
    static constexpr unsigned kMost = 36;

    void add(const Point &p) { corners_[count_++] = p; }
    [[nodiscard]] unsigned count() const { return count_; }
    [[nodiscard]] const Point &operator[](unsigned i) const { return corners_[i]; }

    // Leaves what is on one side of a line along an axis, the line included: coordinate * sign <= bound * sign.
    void cut(double Point::*axis, double bound, double sign)
    {
        Polygon rest;
        for (unsigned i = 0; i < count_; ++i) {
            const Point &from = corners_[i];
            const Point &to = corners_[i + 1 < count_ ? i + 1 : 0];
            const double over = (from.*axis - bound) * sign;
            const double overNext = (to.*axis - bound) * sign;
            if (over <= 0)
                rest.add(from);
            if ((over < 0 && overNext > 0) || (over > 0 && overNext < 0)) {
                const double t = over / (over - overNext);
                Point crossing{from.x + t * (to.x - from.x), from.y + t * (to.y - from.y)};
                crossing.*axis = bound;
                rest.add(crossing);
            }
        }
        *this = rest;
    }

    // The part inside a box.
    void cut(double left, double right, double top, double bottom)
    {
        cut(&Point::x, left, -1);
        cut(&Point::x, right, 1);
        cut(&Point::y, top, -1);
        cut(&Point::y, bottom, 1);
    }

private:
    std::array<Point, kMost> corners_;
    unsigned count_ = 0;
};

// All points that are in a box of twice the margins around a point of the triangle: their Minkowski sum. A corner is
// off by no more than 2^-47 of the largest coordinate.
Polygon widened(const std::array<Point, 3> &triangle, double marginX, double marginY);

// The texels at the corners of a cell: the square between the centres of four texels, in which the value is
// f(s, t) = f00 + a s + b t + c s t.
struct CellTexels {
    double f00, f10, f01, f11;
};

// A value that was found, and where.
struct Witness {
    Point at; // in texels, unwrapped
    double value = 0;
};

struct Extremes {
    // No value is below `floor` or above the upper bound.
    double floor;
    Witness least; // found: the true least value is between `floor` and this
    Witness most;
    double ceiling;
};

// In double precision, with nothing added for rounding. `polygon` has corners, and (x, y) is the position of texel f00.
//
// A bilinear function has no extreme inside a polygon, for its Hessian is indefinite, so only its sides matter. On a
// side f is a quadratic, which lies between its Bernstein coefficients: the values at the ends, and the polar form of f
// at both. If the inner one is the furthest out, the side is divided at the extreme, after which the coefficients next
// to it are the extreme itself.
Extremes extremesOver(const Polygon &polygon, const CellTexels &texels, double x, double y);

} // namespace vellum::verify
