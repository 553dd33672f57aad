// SPDX-License-Identifier: Apache-2.0
// The plane of texels against the specification's formulas, and bounds against all texels of a box.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "bake_cases.h"
#include "bake_oracle.h"
#include "verify/texels.h"

using namespace vellum;
using namespace vellum::test;
using verify::Range;
using verify::TexelBox;
using verify::Texels;

TEST(Texels, AreThoseOfTheSpecification)
{
    TestRandom random(1);
    for (const Wrap wrap : kWraps) {
        for (const uint32_t size : {1u, 2u, 3u, 5u, 16u}) {
            AlphaTexture t = smoothTexture(random, size, 1);
            t.wrapU = wrap;
            t.wrapV = Wrap::Repeat;
            const Texels texels(t);
            for (int64_t x = -70; x <= 70; ++x) {
                const int64_t expected = specifiedTexel(x, size, wrap);
                const bool border = expected < 0 || expected >= size;
                ASSERT_EQ(texels.at(x, 3), border ? t.border : t.alpha[static_cast<size_t>(expected)])
                    << "texel " << x << " of " << size << ", wrap " << static_cast<int>(wrap);
            }
        }
    }
}

TEST(Texels, BoundsHoldAllTexelsOfABoxAndFitSmallOnes)
{
    TestRandom random(2);
    for (unsigned round = 0; round < 4000; ++round) {
        const auto size = [&] { return 1 + random() % (round % 4 == 0 ? 100 : 9); };
        const uint32_t width = size();
        AlphaTexture t = smoothTexture(random, width, size());
        t.wrapU = kWraps[random() % 5];
        t.wrapV = kWraps[random() % 5];
        const Texels texels(t);
        const auto from = [&] { return static_cast<int64_t>(random() % 61) - 30; };
        TexelBox box{from(), 0, from(), 0};
        box.right = box.left + static_cast<int64_t>(random() % 40);
        box.bottom = box.top + static_cast<int64_t>(random() % 40);
        Range exact{2, -1};
        for (int64_t y = box.top; y <= box.bottom; ++y) {
            for (int64_t x = box.left; x <= box.right; ++x) {
                exact.low = std::min(exact.low, double{texels.at(x, y)});
                exact.high = std::max(exact.high, double{texels.at(x, y)});
            }
        }
        const Range range = texels.range(box);
        ASSERT_LE(range.low, exact.low);
        ASSERT_GE(range.high, exact.high);
        const bool small = box.right - box.left < 4 && box.bottom - box.top < 4;
        // Boxes as large as the texture may be treated as all of it.
        if (small && t.width > 4 && t.height > 4) {
            ASSERT_EQ(range.low, exact.low);
            ASSERT_EQ(range.high, exact.high);
        }
        ASSERT_LE(texels.all().low, range.low);
        ASSERT_GE(texels.all().high, range.high);
    }
}

TEST(Texels, OneThatIsNotFiniteMakesBoundsInfinite)
{
    TestRandom random(3);
    for (const uint32_t size : {3u, 70u}) {
        AlphaTexture t = smoothTexture(random, size, size);
        t.wrapU = t.wrapV = Wrap::Clamp;
        const uint32_t place = size * (size / 2) + size / 2;
        for (const float value : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
            t.alpha[place] = value;
            const Texels texels(t);
            for (const int64_t reach : {0, 1, 5, 35, 100}) {
                const int64_t middle = size / 2;
                const Range range = texels.range({middle - reach, middle + reach, middle - reach, middle + reach});
                EXPECT_EQ(range.low, -std::numeric_limits<double>::infinity());
                EXPECT_EQ(range.high, std::numeric_limits<double>::infinity());
            }
            EXPECT_LE(texels.range({-9, -9, -9, -9}).high, 1);
        }
    }
}
