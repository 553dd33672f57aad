// SPDX-License-Identifier: Apache-2.0
// What `vellum bench` concludes from the rows of its parts, and which reports it replaces.
#include <fstream>
#include <gtest/gtest.h>
#ifndef _WIN32
#include <sys/resource.h>
#endif

#include "cli/base/error.h"
#include "cli/base/output_file.h"
#include "cli/bench/bench_report.h"
#include "cli/bench/part_process.h"
#include "glb_file.h"

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

#ifndef _WIN32 // has no limit of open files
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
