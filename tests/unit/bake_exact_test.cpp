// SPDX-License-Identifier: Apache-2.0
// The baker's states against the oracle of bake_oracle.h: with no tolerances, equal to the mathematics.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "bake/bake.h"
#include "bake_cases.h"
#include "bake_oracle.h"
#include "test_random.h"

using namespace vellum;
using test::Oracle;
using test::OraclePoint;
using test::Rational;
using namespace vellum::test;

namespace
{

State stateOf(const BakeResult &result, uint32_t triangle, uint32_t index, uint32_t level)
{
    const int32_t special = result.micromap.indices[triangle];
    if (const auto state = specialState(special))
        return *state;
    const MicromapTriangle &t = result.micromap.triangles[static_cast<size_t>(special)];
    EXPECT_EQ(t.subdivisionLevel, level);
    return readState(result.micromap.data.data() + t.dataOffset, index, t.format);
}

template <typename N>
void compareAll(Tally &sum, const RandomCase &c, const N &hidden)
{
    const auto &[texture, triangles, options] = c;
    const BakeResult result = bake(texture, triangles, options);
    ASSERT_EQ(result.micromap.validate(), std::nullopt);
    const N cutoff = test::numberOf(options.cutoff, N{});
    for (uint32_t t = 0; t < triangles.size(); ++t) {
        for (uint32_t i = 0; i < microTriangleCount(*options.level); ++i) {
            Oracle<N> oracle(texture);
            oracle.addPolygon(cornersOf<N>(texture, triangles[t], i, *options.level));
            const Tally before = sum;
            const State state = stateOf(result, t, i, *options.level);
            tally(sum, state, oracle.least(), oracle.most(), cutoff, cutoff, hidden);
            ASSERT_TRUE(sum.wrong == before.wrong && sum.needless == before.needless)
                << "triangle " << t << ", micro-triangle " << i << " is " << static_cast<int>(state) << ", alpha from "
                << static_cast<double>(oracle.least()) << " to " << static_cast<double>(oracle.most());
        }
    }
}

} // namespace

TEST(BakeExact, EqualsExactArithmeticOnGrids)
{
    test::TestRandom random(1);
    Tally sum;
    for (unsigned round = 0; round < 500 && !HasFatalFailure(); ++round) {
        const RandomCase c = caseOnGrid(random);
        SCOPED_TRACE(testing::Message() << "round " << round << ": " << c);
        compareAll<Rational>(sum, c, Rational(0));
    }
    EXPECT_EQ(sum.wrong, 0u);
    EXPECT_EQ(sum.needless, 0u);
    EXPECT_GT(sum.mixed, sum.all / 10);
    EXPECT_LT(sum.mixed, sum.all - sum.all / 10);
    RecordProperty("microTriangles", std::to_string(sum.all));
    RecordProperty("mixed", std::to_string(sum.mixed));
}

// So near to a side of texels that the machine's integers cannot represent the distance.
TEST(BakeExact, EqualsExactArithmeticNextToASide)
{
    test::TestRandom random(4);
    Tally sum;
    for (unsigned round = 0; round < 200 && !HasFatalFailure(); ++round) {
        RandomCase c = caseOnGrid(random);
        c.texture.filter = Filter::Nearest;
        const float sign = random() % 2 == 0 ? 1.0f : -1.0f;
        for (TriangleUvs &uvs : c.triangles)
            for (TexCoord &uv : uvs)
                uv.u = sign * static_cast<float>(1 + random() % 3) * 0x1p-80f;
        SCOPED_TRACE(testing::Message() << "round " << round << ": " << c);
        compareAll<long double>(sum, c, 0);
    }
    EXPECT_EQ(sum.wrong, 0u);
    EXPECT_EQ(sum.needless, 0u);
    EXPECT_GT(sum.mixed, sum.all / 50);
}

// Along the sides of texels rounding decides nothing: each of 16 million micro-triangles is looked at exactly. All of
// them read what lies behind the side.
TEST(BakeExact, TakesNoMinutesAlongASide)
{
    AlphaTexture texture;
    texture.width = 2;
    texture.height = 2;
    texture.alpha = {1, 0, 0, 0};
    texture.filter = Filter::Nearest;
    BakeOptions options;
    options.exactly().level = 12;
    const std::vector<TriangleUvs> triangles = {
        {TexCoord{0, 0.5f}, {0.25f, 0.5f}, {0.4375f, 0.5f}},       // of no area, under the opaque texel
        {TexCoord{0.5f, 0}, {0.5f, 0.3f}, {0.5f, 0.125f}},         // right of it
        {TexCoord{0.5f, 0.5f}, {0.625f, 0.375f}, {0.75f, 0.25f}}}; // and at its corner
    for (const TriangleUvs &triangle : triangles) {
        const BakeResult result = bake(texture, {&triangle, 1}, options);
        EXPECT_EQ(result.micromap.indices, std::vector<int32_t>{specialIndex(State::Transparent)});
    }
}

// Any textures and coordinates, in long double: values within its rounding of the cutoff may have either state.
TEST(BakeExact, EqualsTheMathematicsAnywhere)
{
    test::TestRandom random(2);
    Tally sum;
    for (unsigned round = 0; round < 400 && !HasFatalFailure(); ++round) {
        const RandomCase c = caseAnywhere(random, round);
        SCOPED_TRACE(testing::Message() << "round " << round << ": " << c);
        compareAll<long double>(sum, c, 1e-11L);
    }
    EXPECT_EQ(sum.wrong, 0u);
    EXPECT_EQ(sum.needless, 0u);
    EXPECT_GT(sum.mixed, sum.all / 50);
    RecordProperty("microTriangles", std::to_string(sum.all));
    RecordProperty("mixed", std::to_string(sum.mixed));
}

// With tolerances, the states hold over the micro-triangle and its margins: their Minkowski sum.
TEST(BakeExact, TolerancesCostNoMoreThanTheirMargins)
{
    test::TestRandom random(3);
    Tally sum;
    for (unsigned round = 0; round < 300 && !HasFatalFailure(); ++round) {
        const RandomCase c = caseWithTolerances(random, round);
        SCOPED_TRACE(testing::Message() << "round " << round << ": " << c);
        const auto &[texture, triangles, options] = c;
        const BakeResult result = bake(texture, triangles, options);
        for (uint32_t k = 0; k < triangles.size(); ++k) {
            const TriangleUvs &uvs = triangles[k];
            const auto [marginX, marginY] = test::marginsOf(options, texture, uvs);
            for (uint32_t i = 0; i < microTriangleCount(*options.level); ++i) {
                Oracle<long double> oracle(texture);
                oracle.addPolygon(widened(cornersOf<long double>(texture, uvs, i, *options.level), marginX, marginY));
                tally<long double>(sum, stateOf(result, k, i, *options.level), oracle.least(), oracle.most(),
                                   options.cutoff - options.valueTolerance, options.cutoff + options.valueTolerance,
                                   1e-11L);
            }
        }
        ASSERT_EQ(sum.wrong, 0u);
    }
    EXPECT_LE(sum.needless * 1000, sum.all);
    EXPECT_GT(sum.mixed, sum.all / 50);
    RecordProperty("microTriangles", std::to_string(sum.all));
    RecordProperty("mixed", std::to_string(sum.mixed));
    RecordProperty("needless", std::to_string(sum.needless));
}
