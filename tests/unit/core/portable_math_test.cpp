// SPDX-License-Identifier: Apache-2.0
// Functions of which the results are the same on all platforms, against the C library's.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "core/portable_math.h"

using namespace vellum;

TEST(PortableMath, CeilLog2)
{
    for (int n = -1074; n < 1024; ++n) {
        const double power = std::ldexp(1.0, n);
        EXPECT_EQ(ceilLog2(power), n);
        if (n >= -1022) {
            EXPECT_EQ(ceilLog2(std::nextafter(power, std::numeric_limits<double>::infinity())), n + 1);
            EXPECT_EQ(ceilLog2(std::nextafter(power * 2, 0.0)), n + 1);
        }
    }
}

TEST(PortableMath, SineAndCosine)
{
    const auto check = [](double angle, double tolerance) {
        const SineCosine is = sineCosine(angle);
        EXPECT_NEAR(is.sine, std::sin(angle), tolerance) << angle;
        EXPECT_NEAR(is.cosine, std::cos(angle), tolerance) << angle;
    };
    std::mt19937 random(1);
    std::uniform_real_distribution<double> turns(-2, 2);
    for (int i = 0; i < 100000; ++i)
        check(turns(random) * std::numbers::pi, 1e-15);
    for (int eighth = -16; eighth <= 16; ++eighth)
        for (const double step : {-0x1p-50, 0.0, 0x1p-50})
            check(eighth * std::numbers::pi / 4 + step, 1e-15);
    for (double angle = 10; angle < 1e9; angle *= 1.7)
        check(angle, angle * 1e-16 + 1e-15);
    EXPECT_EQ(sineCosine(0).sine, 0);
    EXPECT_EQ(sineCosine(0).cosine, 1);
    EXPECT_TRUE(std::isnan(sineCosine(std::numeric_limits<double>::infinity()).sine));
}

// Exactly these, on every platform.
TEST(PortableMath, SineAndCosineAreTheSameEverywhere)
{
    EXPECT_EQ(sineCosine(0.5).sine, 0x1.eaee8744b05fp-2);
    EXPECT_EQ(sineCosine(0.5).cosine, 0x1.c1528065b7d5p-1);
    EXPECT_EQ(sineCosine(-2.25).sine, -0x1.8e5f9c2d0e3aap-1);
    EXPECT_EQ(sineCosine(-2.25).cosine, -0x1.419ff91b9ba6cp-1);
    EXPECT_EQ(sineCosine(5).sine, -0x1.eaf81f5e09933p-1);
    EXPECT_EQ(sineCosine(5).cosine, 0x1.22785706b4addp-2);
}
