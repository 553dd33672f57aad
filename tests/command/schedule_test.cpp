// SPDX-License-Identifier: Apache-2.0
// The time that `vellum check` expects the remaining cases to take.
#include "cli/check/cases.h"

#include <gtest/gtest.h>

using namespace vellum;
using cli::Schedule;
using cli::Stream;

namespace
{

constexpr check::Group kFast{.name = "fast", .cases = 100, .quick = 20};
constexpr check::Group kSlow{.name = "slow", .cases = 10, .quick = 2};

// Takes a number of cases of the first stream, of so many seconds each.
void run(Schedule &schedule, int count, double seconds)
{
    Stream *stream = schedule.choose();
    ASSERT_NE(stream, nullptr);
    for (int i = 0; i < count; ++i) {
        stream->next();
        stream->note(check::Status::Pass, seconds);
    }
}

} // namespace

TEST(Schedule, ExpectsOfEachGroupWhatItsCasesTook)
{
    Schedule schedule;
    schedule.add({check::Api::Khr, kSlow, {0, 1, 2, 3}});
    schedule.add({check::Api::Khr, kFast, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9}});
    EXPECT_DOUBLE_EQ(schedule.expectedSeconds(), 0) << "nothing is known";
    run(schedule, 2, 3); // as much as the quick run, of 20 cases, of the other group
    EXPECT_DOUBLE_EQ(schedule.expectedSeconds(), 2 * 3 + 10 * 6.0 / 20);
    EXPECT_DOUBLE_EQ(schedule.spentSeconds(), 6);
    run(schedule, 2, 3);
    EXPECT_DOUBLE_EQ(schedule.expectedSeconds(), 10 * 6.0 / 20);
    run(schedule, 5, 0.1);
    EXPECT_DOUBLE_EQ(schedule.expectedSeconds(), 5 * 0.1);
}

TEST(Schedule, ARepeatedCaseIsNoCase)
{
    Schedule schedule;
    schedule.add({check::Api::Khr, kSlow, {0, 1}});
    Stream *stream = schedule.choose();
    stream->next();
    stream->note(check::Status::Crash, 1);
    stream->noteRepeated(30);
    EXPECT_DOUBLE_EQ(schedule.expectedSeconds(), 1);
    EXPECT_DOUBLE_EQ(stream->seconds, 31);
}
