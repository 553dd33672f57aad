// SPDX-License-Identifier: Apache-2.0
// The conclusions of `vellum bench` from the rows of its parts, and the reports that it replaces.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>
#include <string_view>
#include <thread>
#ifndef _WIN32
#include <sys/resource.h>
#endif

#include "base/error.h"
#include "base/process.h"
#include "cli/base/files.h"
#include "cli/bench/bench_report.h"
#include "cli/bench/part.h"
#include "glb_file.h"

using namespace vellum;
using namespace vellum::cli;

TEST(BenchReport, SelfChecksPass)
{
    const auto passed = [](const char *row) {
        PartResult result;
        result.rows = {row};
        return selfChecksPassed({result});
    };
    EXPECT_TRUE(passed(R"({"row":"check","passed":1,"failed":0,"skipped":7})"));
    EXPECT_FALSE(passed(R"({"row":"check","passed":9,"failed":1,"skipped":0})"));
    EXPECT_FALSE(passed(R"({"row":"check","passed":0,"failed":0,"skipped":7})"));
    EXPECT_TRUE(passed(R"({"row":"frame"})"));
}

#if !defined(_WIN32) && !defined(__SANITIZE_ADDRESS__) // Windows has no limit of open files; the sanitizer opens some
TEST(BenchReport, APartWhoseProcessCannotBeStartedHasFailed)
{
    rlimit before{};
    getrlimit(RLIMIT_NOFILE, &before);
    const rlimit few{3, before.rlim_max};
    setrlimit(RLIMIT_NOFILE, &few);
    const PartResult result = runPartProcess({}, {}, 1, [] {});
    setrlimit(RLIMIT_NOFILE, &before);
    EXPECT_EQ(result.failure, "no pipe can be made: Too many open files");
}
#endif

namespace
{

std::string frameRow(unsigned level, bool heavy, double low, double middle, double high)
{
    return fmt::format(R"({{"row":"frame","level":{},"heavy":{},"ratio":[{},{},{}],"differingPixels":0}})", level,
                       heavy, low, middle, high);
}

PartResult framesOf(std::vector<std::string> rows)
{
    PartResult result;
    result.part = {PartKind::Frames, "emulated", gpu::Api::Khr, render::Trace::Query, 30};
    result.rows = std::move(rows);
    result.seconds = 30;
    return result;
}

using Sentences = std::vector<std::string>;

} // namespace

TEST(BenchReport, TheVerdictHasEveryLevelAndItsRange)
{
    const PartResult frames = framesOf({frameRow(3, false, 0.98, 1, 1.02), frameRow(3, true, 0.8, 0.8, 0.8),
                                        frameRow(5, false, 1.25, 1.25, 1.25), frameRow(5, true, 0.5, 0.5, 0.5),
                                        frameRow(7, false, 0.95, 0.96, 0.97)});
    EXPECT_EQ(
        verdictOf({frames}),
        (Sentences{
            "By ray queries, emulated micromaps (KHR) compared with a plain alpha test: level 3 is 1.00 times as fast "
            "(0.98 to 1.02, not distinguishable); level 5 is 0.80 times as fast (0.80 to 0.80); level 7 is 1.04 "
            "times as fast (1.03 to 1.05).",
            "By ray queries, emulated micromaps (KHR) compared with a heavy alpha test: level 3 is 1.25 times as fast "
            "(1.25 to 1.25); level 5 is 2.00 times as fast (2.00 to 2.00)."}));
}

TEST(BenchReport, TheVerdictHasTheSlowestBuildAndItsRange)
{
    const auto sentence = [](const char *ratio) {
        PartResult builds;
        builds.part = {PartKind::Builds, "ext", gpu::Api::Khr, render::Trace::Query, 30};
        builds.rows = {
            R"({"row":"build","what":"fast","withLayer":1,"withoutLayer":1,"ratio":[0.9,1,1.1]})",
            fmt::format(R"({{"row":"build","what":"slow","withLayer":2.5,"withoutLayer":2,"ratio":{}}})", ratio)};
        return verdictOf({builds}).at(0);
    };
    EXPECT_EQ(sentence("[1.2,1.25,1.3]"),
              "With KHR micromaps translated to the driver's EXT, builds without micromaps take "
              "up to 1.25 times as long (1.20 to 1.30): slow, 2.500 ms instead of 2.000.");
    EXPECT_EQ(sentence("[0.9,1.25,1.3]"),
              "With KHR micromaps translated to the driver's EXT, builds without micromaps take "
              "up to 1.25 times as long (0.90 to 1.30, not distinguishable): slow, 2.500 ms "
              "instead of 2.000.");
    EXPECT_EQ(sentence("[null,null,null]").find("slow"), std::string::npos);
}

TEST(BenchReport, ABusyMachineIsNoisy)
{
    const std::string quiet = frameRow(3, false, 0.98, 1, 1.02);
    const std::string wide = frameRow(5, false, 0.9, 1, 1.1);
    const auto noisy = [](const std::vector<std::string> &rows) {
        return verdictOf({framesOf(rows)}).at(0).starts_with("Noisy: run again. ");
    };
    EXPECT_TRUE(noisy({wide, wide, quiet}));
    EXPECT_NE(benchJson({framesOf({wide, wide, quiet})}, {}, 1).find("\"noisy\":true"), std::string::npos);
    EXPECT_NE(benchJson({framesOf({quiet})}, {}, 1).find("\"noisy\":false"), std::string::npos);
    EXPECT_EQ(verdictOf({framesOf({wide, quiet})}),
              (std::vector<std::string>{
                  "Noisy: run again. No times are compared: those of 1 of 2 comparisons of frames spread by more than "
                  "10 %, so other programs use the device, or its speed changes."}));
    EXPECT_FALSE(noisy({wide, quiet, quiet}));
    PartResult busy = framesOf({quiet});
    busy.others = 0.19;
    EXPECT_EQ(verdictOf({busy}).size(), 1U);
    busy.others = 0.85;
    PartResult builds;
    builds.part = {PartKind::Builds, "ext", gpu::Api::Khr, render::Trace::Query, 30};
    builds.rows = {R"({"row":"build","what":"slow","withLayer":2.5,"withoutLayer":2,"ratio":[1.2,1.25,1.3]})"};
    EXPECT_EQ(verdictOf({framesOf({quiet}), busy, builds}),
              (std::vector<std::string>{
                  "Noisy: run again. No times are compared: other programs took up to 85 % of the processors."}));
    EXPECT_FALSE(noisy({frameRow(3, false, 0.48, 0.5, 0.52), quiet})) << "relative to the median";
}

TEST(BenchReport, ASlowPartIsCompleteAndNamed)
{
    PartResult frames = framesOf({frameRow(3, false, 1, 1, 1)});
    frames.seconds = 69;
    EXPECT_EQ(verdictOf({frames}).size(), 1U);
    frames.seconds = 95;
    EXPECT_EQ(verdictOf({frames}).back(),
              "The part frames-query-emulated-khr took 95 seconds instead of 30: the device or the machine is slow.");
    frames.failure = "hung: no progress for 60 seconds";
    EXPECT_EQ(verdictOf({frames}).back(),
              "The part frames-query-emulated-khr was not completed: hung: no progress for 60 seconds.");
}

// A part that is slow goes on; one that makes no progress is ended, whatever its driver prints.
TEST(BenchReport, SlowIsNotHung)
{
    const auto run = [](const char *behaviour) {
        return runPartProcess({}, {gpu::DeviceSelection(behaviour), {}}, 2, [] {});
    };
    const PartResult slow = run("slow");
    EXPECT_EQ(slow.failure, "");
    EXPECT_EQ(slow.rows, std::vector<std::string>{R"({"row":"frame"})"});
    EXPECT_GT(slow.seconds, 2.5);
    const PartResult hung = run("hung");
    EXPECT_EQ(hung.failure, "hung: no progress for 2 seconds");
}

TEST(BenchReport, ReplacesReportsOfAllVersions)
{
    const vellum::test::TemporaryFolder folder;
    const auto replaces = [&](const std::string &text) {
        std::ofstream(folder / "report.json") << text;
        try {
            checkWritable(folder / "report.json", false);
        } catch (const Error &) {
            return false;
        }
        return true;
    };
    const std::string report = benchJson({}, {}, 1);
    EXPECT_TRUE(replaces(report));
    const size_t number = report.find("/1\"") + 1;
    EXPECT_TRUE(replaces(std::string(report).replace(number, 1, "12")));
    EXPECT_FALSE(replaces(std::string(report).replace(number, 1, "")));
    EXPECT_FALSE(replaces(std::string(report).replace(number, 1, "x")));
    EXPECT_FALSE(replaces(R"({"schema":"vellum/1","command":"bake",)"));
    EXPECT_FALSE(replaces(R"({"schema":"vellum/1)"));
}

// runPartProcess starts this program as the part; its device name selects its behaviour.
int main(int count, char **words)
{
    const std::vector<std::string_view> arguments(words, words + count);
    if (count < 3 || arguments[1] != "bench") {
        testing::InitGoogleTest(&count, words);
        return RUN_ALL_TESTS();
    }
    prepareProcess(count, words); // lines end alike on every system
    const bool slow = std::ranges::find(arguments, "slow") != arguments.end();
    for (int i = 0; !slow || i < 15; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(200));
        std::printf("%s\n", slow ? kProgressEvent : R"({"frame":"of a driver"})");
        std::fflush(stdout);
    }
    std::puts(rowEvent(R"({"row":"frame"})").c_str());
    return 0;
}
