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

BakeOptions exactly(std::uint32_t level)
{
    BakeOptions o;
    o.level = level;
    o.threads = 1;
    o.valueTolerance = o.subtexelTolerance = o.barycentricTolerance = o.interpolationTolerance = 0;
    return o;
}

State stateOf(const BakeResult &result, std::uint32_t triangle, std::uint32_t index, std::uint32_t level)
{
    const std::int32_t special = result.micromap.indices[triangle];
    if (const auto state = specialState(special))
        return *state;
    const MicromapTriangle &t = result.micromap.triangles[static_cast<std::size_t>(special)];
    EXPECT_EQ(t.subdivisionLevel, level);
    return readState(result.micromap.data.data() + t.dataOffset, index, t.format);
}

template <typename N>
void compareAll(Tally &sum, const AlphaTexture &texture, const std::vector<TriangleUvs> &triangles,
                const BakeOptions &options, const N &hidden)
{
    const BakeResult result = bake(texture, triangles, options);
    ASSERT_EQ(result.micromap.validate(), std::nullopt);
    const N cutoff = test::numberOf(options.cutoff, N{});
    for (std::uint32_t t = 0; t < triangles.size(); ++t) {
        for (std::uint32_t i = 0; i < microTriangleCount(*options.level); ++i) {
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
    constexpr std::array<std::uint32_t, 2> kSizes[] = {{1, 1}, {3, 5}, {4, 4}, {7, 2}, {1, 6}};
    Tally sum;
    for (unsigned round = 0; round < 500 && !HasFatalFailure(); ++round) {
        const auto [width, height] = kSizes[random() % std::size(kSizes)];
        AlphaTexture t = coarseTexture(random, width, height);
        t.wrapU = kWraps[random() % 5];
        t.wrapV = kWraps[random() % 5];
        t.filter = random() % 3 == 0 ? Filter::Nearest : Filter::Bilinear;
        testing::Message message;
        message << "round " << round << ": ";
        describe(message, t);
        SCOPED_TRACE(message);
        // Corners on texel centres, sides and quarters, and some nowhere; slivers, segments and points.
        const unsigned steps = random() % 2 == 0 ? 2 * width : 8;
        const auto coordinate = [&](std::int64_t shift) {
            const auto k = static_cast<std::int64_t>(random() % (3 * steps)) + shift;
            return static_cast<float>(k) / static_cast<float>(steps);
        };
        std::vector<TriangleUvs> triangles;
        for (int n = 0; n < 3; ++n) {
            const auto shift = static_cast<std::int64_t>(random() % 64) - 32;
            TriangleUvs uvs;
            for (TexCoord &uv : uvs) {
                uv = {coordinate(shift), coordinate(-shift)};
                // 1/3 and the like are longer than the fractions of the oracle can be.
                uv.u = std::round(uv.u * 64) / 64;
                uv.v = std::round(uv.v * 64) / 64;
            }
            if (random() % 6 == 0)
                uvs[2] = uvs[0];
            if (random() % 12 == 0)
                uvs[1] = uvs[0];
            triangles.push_back(uvs);
        }
        BakeOptions options = exactly(random() % 4);
        const double cutoffs[] = {0.5, 0.25, 0.75, 0.4375, 1, 0};
        options.cutoff = cutoffs[random() % std::size(cutoffs)];
        compareAll<Rational>(sum, t, triangles, options, Rational(0));
    }
    EXPECT_EQ(sum.wrong, 0u);
    EXPECT_EQ(sum.needless, 0u);
    EXPECT_GT(sum.mixed, sum.all / 10);
    EXPECT_LT(sum.mixed, sum.all - sum.all / 10);
    RecordProperty("microTriangles", std::to_string(sum.all));
    RecordProperty("mixed", std::to_string(sum.mixed));
}

// Any textures and coordinates, in long double: what is within its rounding of the cutoff may be either.
TEST(BakeExact, EqualsTheMathematicsAnywhere)
{
    test::TestRandom random(2);
    constexpr std::array<std::uint32_t, 2> kSizes[] = {{1, 1}, {3, 5}, {16, 16}, {64, 48}, {1023, 769}};
    Tally sum;
    for (unsigned round = 0; round < 400 && !HasFatalFailure(); ++round) {
        const auto [width, height] = kSizes[round % std::size(kSizes)];
        AlphaTexture t = smoothTexture(random, width, height);
        t.wrapU = kWraps[random() % 5];
        t.wrapV = kWraps[random() % 5];
        t.filter = random() % 4 == 0 ? Filter::Nearest : Filter::Bilinear;
        testing::Message message;
        message << "round " << round << ": ";
        describe(message, t);
        SCOPED_TRACE(message);
        BakeOptions options = exactly(random() % 5);
        options.cutoff = random() % 2 == 0 ? 0.5 : random.uniform(0.05, 0.95);
        compareAll<long double>(sum, t, randomTriangles(random, width, height), options, 1e-11L);
    }
    EXPECT_EQ(sum.wrong, 0u);
    EXPECT_EQ(sum.needless, 0u);
    EXPECT_GT(sum.mixed, sum.all / 50);
    RecordProperty("microTriangles", std::to_string(sum.all));
    RecordProperty("mixed", std::to_string(sum.mixed));
}

// With tolerances, the same over the micro-triangle with its margins: their Minkowski sum.
TEST(BakeExact, TolerancesCostNoMoreThanTheyAskFor)
{
    test::TestRandom random(3);
    constexpr std::array<std::uint32_t, 2> kSizes[] = {{3, 5}, {16, 16}, {64, 48}, {255, 129}};
    Tally sum;
    for (unsigned round = 0; round < 300 && !HasFatalFailure(); ++round) {
        const auto [width, height] = kSizes[round % std::size(kSizes)];
        AlphaTexture t = smoothTexture(random, width, height);
        t.wrapU = kWraps[random() % 5];
        t.wrapV = kWraps[random() % 5];
        t.filter = random() % 4 == 0 ? Filter::Nearest : Filter::Bilinear;
        testing::Message message;
        message << "round " << round << ": ";
        describe(message, t);
        SCOPED_TRACE(message);
        BakeOptions options;
        options.threads = 1;
        options.level = random() % 5;
        const std::vector<TriangleUvs> triangles = randomTriangles(random, width, height);
        const BakeResult result = bake(t, triangles, options);
        for (std::uint32_t k = 0; k < triangles.size(); ++k) {
            const TriangleUvs &uvs = triangles[k];
            const auto [marginX, marginY] = test::marginsOf(options, t, uvs);
            for (std::uint32_t i = 0; i < microTriangleCount(*options.level); ++i) {
                Oracle<long double> oracle(t);
                oracle.addPolygon(widened(cornersOf<long double>(t, uvs, i, *options.level), marginX, marginY));
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
