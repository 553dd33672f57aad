// SPDX-License-Identifier: Apache-2.0
// The filtered value over the part of a convex polygon that lies in one cell of a bilinear filter: the square between
// the centres of four texels, in which the value is f(s, t) = f00 + a s + b t + c s t.
#pragma once

#include <array>

#include "verify/polygon.h"

namespace vellum::verify
{

// The texels at the corners of a cell.
struct CellTexels {
    double f00, f10, f01, f11;
};

// A value that was found, and where.
struct Witness {
    Point at; // in texels, unwrapped
    double value = 0;
};

struct Extremes {
    // Nothing is below the first or above the last.
    double floor;
    Witness least; // found: the true least value is between `floor` and this
    Witness most;
    double ceiling;
};

// In double precision, with nothing added for rounding. `polygon` has corners, and (x, y) is where texel f00 is.
//
// A bilinear function has no extreme inside a polygon, for its Hessian is indefinite; so its sides are looked at. On a
// side f is a quadratic, which lies between its Bernstein coefficients: the values at the ends, and the polar form of f
// at both. Where the inner one is the furthest out, the side is divided at the turn, after which the coefficients
// beside the turn are the extreme itself.
Extremes extremesOver(const Polygon &polygon, const CellTexels &texels, double x, double y);

} // namespace vellum::verify
