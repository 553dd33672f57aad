// SPDX-License-Identifier: Apache-2.0
// Functions whose results do not depend on the platform: std::sin, std::log2 and their like may differ in the last bit
// between C libraries and processors, and with it what is baked. Sums, products, quotients, std::sqrt, std::frexp and
// std::remainder do not, as long as the compiler does not fuse them (-ffp-contract=off).
#pragma once

#include <array>
#include <cmath>
#include <limits>

namespace vellum
{

// The least n with 2^n >= `x`, which is positive and finite.
inline int ceilLog2(double x)
{
    int exponent = 0;
    return std::frexp(x, &exponent) == 0.5 ? exponent - 1 : exponent;
}

// The least float that is not below `value`, so that comparing floats with it is comparing them with `value`.
inline float floatAtLeast(double value)
{
    if (value > double{std::numeric_limits<float>::max()})
        return std::numeric_limits<float>::infinity();
    if (value < -double{std::numeric_limits<float>::max()})
        return -std::numeric_limits<float>::max();
    const auto rounded = static_cast<float>(value);
    return double{rounded} >= value ? rounded : std::nextafter(rounded, std::numeric_limits<float>::infinity());
}

struct SineCosine {
    double sine;
    double cosine;
};

// Within 1e-15 for angles up to a full turn; each further turn adds 3e-16.
inline SineCosine sineCosine(double angle)
{
    constexpr double kHalfPi = 0x1.921fb54442d18p+0;
    constexpr double kHalfPiRest = 0x1.1a62633145c07p-54; // rest of pi / 2 beyond the double
    const double turned = std::remainder(angle, 4 * kHalfPi);
    if (std::isnan(turned))
        return {turned, turned};
    const double quarters = std::floor(turned / kHalfPi + 0.5); // -2 to 2
    const double x = turned - quarters * kHalfPi - quarters * kHalfPiRest;
    const double xx = x * x;
    double sine = 0;
    double cosine = 0;
    for (int n = 18; n >= 0; n -= 2) { // Taylor's series; |x| is at most pi / 4
        cosine = 1 - cosine * xx / ((n + 1) * (n + 2));
        sine = 1 - sine * xx / ((n + 2) * (n + 3));
    }
    sine *= x;
    const std::array<double, 4> waves{sine, cosine, -sine, -cosine};
    const auto quadrant = static_cast<unsigned>(static_cast<int>(quarters)) % 4;
    return {waves[quadrant], waves[(quadrant + 1) % 4]};
}

} // namespace vellum
