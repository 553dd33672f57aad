// The GPU baker's states against the oracle of bake_oracle.h, which the CPU baker is held to as well: no claim is
// wrong, and few states are unknown without need.
#include <array>
#include <cmath>

#include "bake_cases.h"
#include "gpu_bake_run.h"

namespace
{

using namespace vt;
using namespace vellum;
using test::Oracle;
using test::Rational;
using test::Tally;

class GpuBakeExact : public GpuBakeTest
{
protected:
    void record(const Tally &sum)
    {
        RecordProperty("microTriangles", std::to_string(sum.all));
        RecordProperty("mixed", std::to_string(sum.mixed));
        RecordProperty("needless", std::to_string(sum.needless));
        std::printf("%zu micro-triangles, %zu mixed, %zu wrong, %zu needlessly unknown\n", sum.all, sum.mixed,
                    sum.wrong, sum.needless);
    }
};

void randomSampler(test::TestRandom &random, AlphaTexture &t)
{
    t.wrapU = test::kWraps[random() % 5];
    t.wrapV = test::kWraps[random() % 5];
    t.filter = random() % 4 == 0 ? Filter::Nearest : Filter::Bilinear;
}

} // namespace

// Without tolerances, anywhere: states are those of the mathematics, but for what single precision cannot tell.
TEST_F(GpuBakeExact, ClaimsNothingThatIsNotSo)
{
    test::TestRandom random(2);
    constexpr std::array<std::uint32_t, 2> kSizes[] = {{1, 1}, {3, 5}, {16, 16}, {64, 48}, {1023, 769}};
    Tally sum;
    for (unsigned round = 0; round < 400 && !HasFatalFailure(); ++round) {
        const auto [width, height] = kSizes[round % std::size(kSizes)];
        AlphaTexture t = test::smoothTexture(random, width, height);
        randomSampler(random, t);
        testing::Message message;
        message << "round " << round << ": ";
        test::describe(message, t);
        SCOPED_TRACE(message);
        BakeOptions options;
        options.exactly();
        options.level = random() % 5;
        options.cutoff = random() % 2 == 0 ? 0.5 : random.uniform(0.05, 0.95);
        const std::vector<TriangleUvs> triangles = test::randomTriangles(random, width, height);
        const GpuBaked baked = runner_.bake(t, triangles, onGpu(options));
        ASSERT_EQ(baked.micromap().validate(), std::nullopt);
        for (std::uint32_t k = 0; k < triangles.size(); ++k) {
            for (std::uint32_t i = 0; i < microTriangleCount(*options.level); ++i) {
                Oracle<long double> oracle(t);
                oracle.addPolygon(test::cornersOf<long double>(t, triangles[k], i, *options.level));
                const std::size_t wrong = sum.wrong;
                test::tally<long double>(sum, baked.stateOf(k, i), oracle.least(), oracle.most(), options.cutoff,
                                         options.cutoff, 1e-11L);
                ASSERT_EQ(sum.wrong, wrong)
                    << "triangle " << k << ", micro-triangle " << i << " is " << static_cast<int>(baked.stateOf(k, i))
                    << ", alpha from " << static_cast<double>(oracle.least()) << " to "
                    << static_cast<double>(oracle.most());
            }
        }
    }
    record(sum);
    EXPECT_LE(sum.needless * 500, sum.all);
    EXPECT_GT(sum.mixed, sum.all / 50);
}

// Corners on texel centres and sides, alpha equal to the cutoff: where the bounds for rounding show most.
TEST_F(GpuBakeExact, ClaimsNothingThatIsNotSoOnGrids)
{
    test::TestRandom random(1);
    constexpr std::array<std::uint32_t, 2> kSizes[] = {{1, 1}, {3, 5}, {4, 4}, {7, 2}, {1, 6}};
    Tally sum;
    for (unsigned round = 0; round < 300 && !HasFatalFailure(); ++round) {
        const auto [width, height] = kSizes[random() % std::size(kSizes)];
        AlphaTexture t = test::coarseTexture(random, width, height);
        randomSampler(random, t);
        testing::Message message;
        message << "round " << round << ": ";
        test::describe(message, t);
        SCOPED_TRACE(message);
        std::vector<TriangleUvs> triangles(3);
        for (TriangleUvs &uvs : triangles) {
            const float far = static_cast<float>(random() % 64) - 32;
            for (TexCoord &uv : uvs)
                uv = {far + static_cast<float>(random() % 192) / 64, static_cast<float>(random() % 192) / 64 - far};
            if (random() % 6 == 0)
                uvs[2] = uvs[0];
            if (random() % 12 == 0)
                uvs[1] = uvs[0];
        }
        BakeOptions options;
        options.exactly();
        options.level = random() % 4;
        const double cutoffs[] = {0.5, 0.25, 0.75, 0.4375, 1, 0};
        options.cutoff = cutoffs[random() % std::size(cutoffs)];
        const GpuBaked baked = runner_.bake(t, triangles, onGpu(options));
        for (std::uint32_t k = 0; k < triangles.size(); ++k) {
            for (std::uint32_t i = 0; i < microTriangleCount(*options.level); ++i) {
                Oracle<Rational> oracle(t);
                oracle.addPolygon(test::cornersOf<Rational>(t, triangles[k], i, *options.level));
                const Rational cutoff = Rational::of(options.cutoff);
                test::tally(sum, baked.stateOf(k, i), oracle.least(), oracle.most(), cutoff, cutoff, Rational(0));
            }
        }
        ASSERT_EQ(sum.wrong, 0u);
    }
    record(sum);
    EXPECT_LE(sum.needless * 200, sum.all);
    EXPECT_GT(sum.mixed, sum.all / 10);
    EXPECT_LT(sum.mixed, sum.all - sum.all / 10);
}

// With the tolerances that a sampler needs, over the micro-triangle with its margins.
TEST_F(GpuBakeExact, TolerancesCostNoMoreThanTheyAskFor)
{
    test::TestRandom random(3);
    constexpr std::array<std::uint32_t, 2> kSizes[] = {{3, 5}, {16, 16}, {64, 48}, {255, 129}};
    Tally sum;
    for (unsigned round = 0; round < 300 && !HasFatalFailure(); ++round) {
        const auto [width, height] = kSizes[round % std::size(kSizes)];
        AlphaTexture t = test::smoothTexture(random, width, height);
        randomSampler(random, t);
        testing::Message message;
        message << "round " << round << ": ";
        test::describe(message, t);
        SCOPED_TRACE(message);
        BakeOptions options;
        options.level = random() % 5;
        const std::vector<TriangleUvs> triangles = test::randomTriangles(random, width, height);
        const GpuBaked baked = runner_.bake(t, triangles, onGpu(options));
        for (std::uint32_t k = 0; k < triangles.size(); ++k) {
            const std::array<long double, 2> margins = test::marginsOf(options, t, triangles[k]);
            for (std::uint32_t i = 0; i < microTriangleCount(*options.level); ++i) {
                Oracle<long double> oracle(t);
                oracle.addPolygon(test::widened(test::cornersOf<long double>(t, triangles[k], i, *options.level),
                                                margins[0], margins[1]));
                test::tally<long double>(sum, baked.stateOf(k, i), oracle.least(), oracle.most(),
                                         options.cutoff - options.valueTolerance,
                                         options.cutoff + options.valueTolerance, 1e-11L);
            }
        }
        ASSERT_EQ(sum.wrong, 0u);
    }
    record(sum);
    EXPECT_LE(sum.needless * 1000, sum.all);
    EXPECT_GT(sum.mixed, sum.all / 50);
}
