// SPDX-License-Identifier: Apache-2.0
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

} // namespace

// Without tolerances, states are mathematically exact, except where single precision cannot decide.
TEST_F(GpuBakeExact, ClaimsNothingThatIsNotSo)
{
    test::TestRandom random(2);
    Tally sum;
    for (unsigned round = 0; round < 400 && !HasFatalFailure(); ++round) {
        const test::RandomCase c = test::caseAnywhere(random, round);
        SCOPED_TRACE(testing::Message() << "round " << round << ": " << c);
        const auto &[texture, triangles, options] = c;
        const GpuBaked baked = runner_.bake(texture, triangles, onGpu(options));
        ASSERT_EQ(baked.micromap().validate(), std::nullopt);
        for (uint32_t k = 0; k < triangles.size(); ++k) {
            for (uint32_t i = 0; i < microTriangleCount(*options.level); ++i) {
                Oracle<long double> oracle(texture);
                oracle.addPolygon(test::cornersOf<long double>(texture, triangles[k], i, *options.level));
                const size_t wrong = sum.wrong;
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
    Tally sum;
    for (unsigned round = 0; round < 300 && !HasFatalFailure(); ++round) {
        const test::RandomCase c = test::caseOnGrid(random);
        SCOPED_TRACE(testing::Message() << "round " << round << ": " << c);
        const auto &[texture, triangles, options] = c;
        const GpuBaked baked = runner_.bake(texture, triangles, onGpu(options));
        for (uint32_t k = 0; k < triangles.size(); ++k) {
            for (uint32_t i = 0; i < microTriangleCount(*options.level); ++i) {
                Oracle<Rational> oracle(texture);
                oracle.addPolygon(test::cornersOf<Rational>(texture, triangles[k], i, *options.level));
                const Rational cutoff = Rational::of(options.cutoff);
                test::tally(sum, baked.stateOf(k, i), oracle.least(), oracle.most(), cutoff, cutoff, Rational(0));
            }
        }
        ASSERT_EQ(sum.wrong, 0u);
    }
    record(sum);
    // Many of these touch the cutoff exactly, which single precision cannot distinguish from crossing it.
    EXPECT_LE(sum.needless * 100, sum.all);
    EXPECT_GT(sum.mixed, sum.all / 10);
    EXPECT_LT(sum.mixed, sum.all - sum.all / 10);
}

// With the tolerances that a sampler needs, states hold over the micro-triangle and its margins.
TEST_F(GpuBakeExact, TolerancesCostNoMoreThanTheirMargins)
{
    test::TestRandom random(3);
    Tally sum;
    for (unsigned round = 0; round < 300 && !HasFatalFailure(); ++round) {
        const test::RandomCase c = test::caseWithTolerances(random, round);
        SCOPED_TRACE(testing::Message() << "round " << round << ": " << c);
        const auto &[texture, triangles, options] = c;
        const GpuBaked baked = runner_.bake(texture, triangles, onGpu(options));
        for (uint32_t k = 0; k < triangles.size(); ++k) {
            const std::array<long double, 2> margins = test::marginsOf(options, texture, triangles[k]);
            for (uint32_t i = 0; i < microTriangleCount(*options.level); ++i) {
                Oracle<long double> oracle(texture);
                oracle.addPolygon(test::widened(test::cornersOf<long double>(texture, triangles[k], i, *options.level),
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
