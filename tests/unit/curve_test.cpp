// SPDX-License-Identifier: Apache-2.0
// The order of micro-triangles: index to corners and barycentrics to index, against each other and against what the
// specification's figures show.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/curve.h"
#include "core/micromap.h"
#include "test_random.h"

using namespace vellum;

namespace
{

// All micro-triangles up to level 9, and some of each level above.
std::vector<uint32_t> indicesToTest(uint32_t level)
{
    std::vector<uint32_t> indices;
    const uint32_t count = microTriangleCount(level);
    if (level <= 9) {
        for (uint32_t i = 0; i < count; ++i)
            indices.push_back(i);
        return indices;
    }
    test::TestRandom random(level);
    for (int i = 0; i < 200000; ++i)
        indices.push_back(random() % count);
    indices.push_back(0);
    indices.push_back(count - 1);
    return indices;
}

Barycentrics mix(const std::array<Barycentrics, 3> &corners, float a, float b, float c)
{
    return {corners[0].u * a + corners[1].u * b + corners[2].u * c,
            corners[0].v * a + corners[1].v * b + corners[2].v * c};
}

class CurveOfLevel : public testing::TestWithParam<uint32_t>
{
};

} // namespace

TEST_P(CurveOfLevel, PointsInsideAMicroTriangleHaveItsIndex)
{
    const uint32_t level = GetParam();
    for (const uint32_t index : indicesToTest(level)) {
        const auto corners = microTriangleCorners(index, level);
        // Well inside: multiples of 2^-level / 8 are exact even at level 12.
        for (const auto &w : {std::array{0.375f, 0.375f, 0.25f}, std::array{0.75f, 0.125f, 0.125f},
                              std::array{0.125f, 0.75f, 0.125f}, std::array{0.125f, 0.125f, 0.75f}}) {
            const Barycentrics p = mix(corners, w[0], w[1], w[2]);
            ASSERT_EQ(shared::curveIndex(p.u, p.v, level), index) << "level " << level;
        }
    }
}

TEST_P(CurveOfLevel, CornersMakeAMicroTriangleOnTheGrid)
{
    const uint32_t level = GetParam();
    const float steps = static_cast<float>(1u << level);
    for (const uint32_t index : indicesToTest(level)) {
        const auto c = microTriangleCorners(index, level);
        for (const Barycentrics &p : c) {
            ASSERT_EQ(p.u * steps, std::floor(p.u * steps));
            ASSERT_EQ(p.v * steps, std::floor(p.v * steps));
            ASSERT_GE(p.u, 0);
            ASSERT_GE(p.v, 0);
            ASSERT_LE(p.u + p.v, 1);
        }
        const double area = (double{c[1].u} - c[0].u) * (double{c[2].v} - c[0].v) -
                            (double{c[2].u} - c[0].u) * (double{c[1].v} - c[0].v);
        ASSERT_EQ(std::abs(area) * steps * steps, 1.0);
    }
}

TEST_P(CurveOfLevel, NeighboursOnTheCurveTouch)
{
    const uint32_t level = GetParam();
    for (const uint32_t index : indicesToTest(level)) {
        if (index + 1 == microTriangleCount(level))
            continue;
        int common = 0;
        for (const Barycentrics &a : microTriangleCorners(index, level))
            for (const Barycentrics &b : microTriangleCorners(index + 1, level))
                common += a.u == b.u && a.v == b.v ? 1 : 0;
        ASSERT_GE(common, 1) << "level " << level << ", index " << index;
    }
}

TEST_P(CurveOfLevel, TheLevelAboveIsAQuarter)
{
    const uint32_t level = GetParam();
    if (level == 0)
        return;
    test::TestRandom random(level);
    for (int i = 0; i < 20000; ++i) {
        const uint32_t index = random() % microTriangleCount(level);
        const Barycentrics p = mix(microTriangleCorners(index, level), 0.375f, 0.375f, 0.25f);
        ASSERT_EQ(shared::curveIndex(p.u, p.v, level - 1), index / 4);
    }
}

// The sum of u and v has fewer bits than they have: rounded, it can be on the other side of a diagonal.
TEST_P(CurveOfLevel, PointsBesideADiagonalAreOnTheirSide)
{
    const double steps = 1u << GetParam();
    test::TestRandom random(GetParam());
    uint32_t tested = 0;
    while (tested < 20000) {
        const float v = static_cast<float>(random() & 0xffffffu) / 0x1000000;
        float u = static_cast<float>(static_cast<double>(1 + random() % (1u << GetParam())) / steps - double{v});
        const float towards = random() % 2 == 0 ? 1.0f : 0.0f;
        for (uint32_t i = random() % 4; i > 0; --i)
            u = std::nextafter(u, towards);
        // Smaller ones are rounded where they are added to others.
        if (u < 1.0f / 4096 || v < 1.0f / 4096 || double{u} + v >= 1)
            continue;
        const double cellU = std::floor(u * steps), cellV = std::floor(v * steps);
        const bool far = u * steps - cellU + (v * steps - cellV) >= 1;
        const auto corners = microTriangleCorners(shared::curveIndex(u, v, GetParam()), GetParam());
        const auto isOrigin = [&](const Barycentrics &c) { return c.u * steps == cellU && c.v * steps == cellV; };
        ASSERT_EQ(std::ranges::none_of(corners, isOrigin), far) << u << ", " << v;
        ++tested;
    }
}

INSTANTIATE_TEST_SUITE_P(All, CurveOfLevel, testing::Range(0u, 13u));

TEST(Curve, LevelOneIsVertex0MiddleVertex1Vertex2)
{
    EXPECT_EQ(shared::curveIndex(0.1f, 0.1f, 1), 0u);
    EXPECT_EQ(shared::curveIndex(0.3f, 0.3f, 1), 1u);
    EXPECT_EQ(shared::curveIndex(0.8f, 0.1f, 1), 2u);
    EXPECT_EQ(shared::curveIndex(0.1f, 0.8f, 1), 3u);
}

// The specification's figure of level 2, by the centres of its micro-triangles in twelfths.
TEST(Curve, LevelTwoIsAsInTheSpecification)
{
    const int centers[16][2] = {{1, 1}, {2, 2}, {1, 4},  {4, 1}, {5, 2}, {4, 4}, {2, 5}, {5, 5},
                                {7, 1}, {8, 2}, {10, 1}, {7, 4}, {4, 7}, {2, 8}, {1, 7}, {1, 10}};
    bool seen[16] = {};
    for (const auto &c : centers) {
        const uint32_t index =
            shared::curveIndex(static_cast<float>(c[0]) / 12.0f, static_cast<float>(c[1]) / 12.0f, 2);
        ASSERT_LT(index, 16u);
        EXPECT_FALSE(seen[index]);
        seen[index] = true;
    }
    EXPECT_EQ(shared::curveIndex(1 / 12.0f, 1 / 12.0f, 2), 0u);
    EXPECT_EQ(shared::curveIndex(10 / 12.0f, 1 / 12.0f, 2), 10u);
    EXPECT_EQ(shared::curveIndex(1 / 12.0f, 10 / 12.0f, 2), 15u);
}

TEST(Curve, AnyInputIsSafe)
{
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const float infinity = std::numeric_limits<float>::infinity();
    const float values[] = {nan, infinity, -infinity, -1, -1e-30f, 0, 0.5f, 0.99999994f, 1, 1.0000001f, 2, 1e30f};
    for (uint32_t level = 0; level <= 12; ++level)
        for (const float u : values)
            for (const float v : values)
                EXPECT_LT(shared::curveIndex(u, v, level), microTriangleCount(level)) << u << ", " << v;
}

TEST(Curve, VerticesOfTheTriangle)
{
    for (uint32_t level = 0; level <= 12; ++level) {
        const uint32_t last = microTriangleCount(level) - 1;
        EXPECT_EQ(shared::curveIndex(0, 0, level), 0u);
        EXPECT_EQ(shared::curveIndex(0, 1, level), last);
        EXPECT_EQ(shared::curveIndex(1, 0, level), last / 3 * 2); // 2222 in base 4
    }
}
