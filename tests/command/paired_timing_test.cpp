// SPDX-License-Identifier: Apache-2.0
// The summary of invented times by `render --mode compare`.
#include <gtest/gtest.h>
#include <thread>

#include "base/statistics.h"

using namespace vellum;

namespace
{

// Returns these in turn.
PairedTiming::Run scripted(std::vector<double> times)
{
    return [times = std::move(times), next = size_t{0}]() mutable { return times.at(next++); };
}

} // namespace

TEST(Statistics, MedianAndQuartiles)
{
    EXPECT_EQ(median({7}), 7);
    EXPECT_EQ(median({3, 1, 2}), 2);
    EXPECT_EQ(median({4, 1, 3, 2}), 2.5);
    const Quartiles q = quartiles({5, 1, 4, 2, 3});
    EXPECT_EQ(q.low, 2);
    EXPECT_EQ(q.middle, 3);
    EXPECT_EQ(q.high, 4);
    EXPECT_EQ(quartiles({1, 2}).low, 1.25);
}

// A machine that slows down all the time: a side that takes twice as long does so nevertheless.
TEST(PairedTiming, DriftCancels)
{
    PairedTiming timing(scripted({10, 12, 14, 16}), scripted({22, 26, 30}));
    for (int i = 0; i < 3; ++i)
        timing.measure();
    EXPECT_EQ(timing.pairs(), 3u);
    EXPECT_EQ(timing.ratio().middle, 2);
    EXPECT_EQ(timing.uncertainty(), 0);
    EXPECT_EQ(timing.a(), 13);
    EXPECT_EQ(timing.b(), 26);
}

TEST(PairedTiming, OneDisturbanceDoesNotMoveTheRatio)
{
    PairedTiming timing(scripted({10, 10, 10, 10, 10, 10}), scripted({11, 11, 500, 11, 11}));
    for (int i = 0; i < 5; ++i)
        timing.measure();
    EXPECT_DOUBLE_EQ(timing.ratio().middle, 1.1);
    EXPECT_DOUBLE_EQ(timing.ratio().high, 1.1);
}

// For a normal distribution: quartiles at 0.674 deviations, here 0.674 % of the ratio.
TEST(PairedTiming, UncertaintyShrinksWithTheRootOfThePairs)
{
    const auto after = [](size_t pairs) {
        std::vector<double> b;
        while (b.size() < pairs)
            b.insert(b.end(), {99.3255, 100, 100, 100.6745});
        PairedTiming timing(scripted(std::vector<double>(pairs + 1, 100)), scripted(b));
        for (size_t i = 0; i < pairs; ++i)
            timing.measure();
        return timing.uncertainty();
    };
    const double few = after(16);
    const double many = after(64);
    EXPECT_GT(few, 0);
    EXPECT_NEAR(few / many, 2, 0.2);
}

TEST(ShareOfOthers, ThreadsThatCompute)
{
    std::vector<std::jthread> others;
    for (unsigned i = 0; i < 4 * std::max(std::thread::hardware_concurrency(), 1U); ++i)
        others.emplace_back([](const std::stop_token &stop) {
            for (volatile unsigned value = 0; !stop.stop_requested();)
                value = value + 1;
        });
    const double share = shareOfOthers(0.3);
    EXPECT_GT(share, 0.4);
    EXPECT_LE(share, 1);
}
