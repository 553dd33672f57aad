// SPDX-License-Identifier: Apache-2.0
// Decides in exact arithmetic what double precision leaves open: values that equal the cutoff, outlines that run along
// an edge. Fractions of integers of any size; slow, and seldom needed.
#pragma once

#include <array>
#include <boost/multiprecision/cpp_int.hpp>
#include <cstdint>

#include "verify/polygon.h"
#include "verify/texels.h"

namespace vellum::verify
{

using Fraction =
    boost::multiprecision::number<boost::multiprecision::cpp_rational_backend, boost::multiprecision::et_off>;

// The possible outcomes of the alpha test.
struct Outcomes {
    bool opaque = false;
    bool transparent = false;
};

class ExactPart
{
public:
    // A micro-triangle: corners of the lattice with 2^level steps along the edges of `triangle`, whose coordinates are
    // finite.
    ExactPart(const AlphaTexture &texture, const TriangleCorners &triangle, const MicroCorners &corners,
              uint32_t level);

    // The outcomes in what the closed micro-triangle and a cell of the filter have in common; both where a texel of the
    // cell is not finite. For Filter::Nearest the cell is the texel itself, without its right and lower side; else the
    // closed square from the centre of that texel to the next. A value times `scale` is opaque from `cutoff` on.
    [[nodiscard]] Outcomes outcomesIn(const Texels &texels, int64_t x, int64_t y, double scale, double cutoff) const;

private:
    struct Corner {
        Fraction x;
        Fraction y;
    };
    std::array<Corner, 3> corners_;
};

} // namespace vellum::verify
