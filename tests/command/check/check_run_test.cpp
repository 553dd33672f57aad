// SPDX-License-Identifier: Apache-2.0
// `vellum check`: what becomes of cases that pass, fail, crash, hang and lie.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <gtest/gtest.h>

#include "check/results.h"

using namespace vellum::test;

namespace
{

using Statuses = std::map<std::string, std::string>;

constexpr int kNotRun = 125;

class Check : public testing::Test
{
protected:
    // The cases of these filters with VK_KHR_opacity_micromap.
    CheckRun run(std::vector<std::string> filters, std::vector<std::string> arguments = {},
                 const Environment &environment = {})
    {
        for (const std::string &filter : filters)
            arguments.insert(arguments.end(), {"--filter", "khr." + filter});
        return runCheck(folder_, arguments, environment);
    }
    // Number of triangles in a reproducer.
    size_t trianglesOf(const std::string &name)
    {
        const std::string text = textOf(folder_ / "out/failures" / (name + ".json"));
        const size_t begin = text.find("\"vertices\": [");
        EXPECT_NE(begin, std::string::npos) << text;
        const std::string vertices = text.substr(begin, text.find("}", begin) - begin);
        return static_cast<size_t>(std::count(vertices.begin(), vertices.end(), '[') - 1) / 3;
    }

    TemporaryFolder folder_;
};

} // namespace

TEST_F(Check, Pass)
{
    const CheckRun check = run({"good.*"});
    EXPECT_EQ(check.outcome.exitCode, 0) << check.outcome.errors;
    EXPECT_EQ(check.results, (Statuses{{"khr.good.0000", "Pass"},
                                       {"khr.good.0001", "Pass"},
                                       {"khr.good.0002", "Pass"},
                                       {"khr.good.0003", "Pass"},
                                       {"khr.good.0004", "Pass"}}));
    EXPECT_TRUE(check.failures.empty());
    EXPECT_EQ(lineOf(check.outcome, "khr.good").substr(0, 82),
              "khr.good        5        5       0       0       0       0             50       0.")
        << check.outcome.output;
}

TEST_F(Check, FailuresWithOneCauseArePutTogether)
{
    const CheckRun check = run({"bad.*"}, {"--jobs", "1"});
    EXPECT_EQ(check.outcome.exitCode, 1);
    EXPECT_EQ(check.results.size(), 5U);
    EXPECT_EQ(check.failures, check.results);
    EXPECT_EQ(check.results.at("khr.bad.0003"), "Fail");
    EXPECT_NE(check.outcome.output.find("  Fail: expected opaque, found \"transparent\" & <unknown>\n"
                                        "    5 cases, the first of which is khr.bad.0000\n"
                                        "    vellum check --replay " +
                                        (folder_ / "out" / "failures" / "khr.bad.0000.json").string() + "\n"),
              std::string::npos)
        << check.outcome.output;
    EXPECT_EQ(textOf(folder_ / "out/failures/khr.bad.0000.txt"), "an account");
    EXPECT_EQ(textOf(folder_ / "out/failures/khr.bad.0000.png"), std::string("\x89PNG\0\xff", 6));
    EXPECT_TRUE(std::filesystem::exists(folder_ / "out/failures/khr.bad.0002.json"));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out/failures/khr.bad.0003.json")) << "three of a cause are enough";
}

TEST_F(Check, FailFastEndsWithTheFirstFailure)
{
    const CheckRun check = run({"good.*", "bad.*"}, {"--jobs", "1", "--fail-fast"});
    EXPECT_EQ(check.outcome.exitCode, 1);
    EXPECT_EQ(check.failures.size(), 1U);
    EXPECT_LT(check.results.size(), 10U);
}

TEST_F(Check, MissingExtensionsAreSkipped)
{
    const CheckRun check = run({"skip.*", "good.0000"});
    EXPECT_EQ(check.outcome.exitCode, 0);
    EXPECT_EQ(check.results,
              (Statuses{{"khr.good.0000", "Pass"}, {"khr.skip.0000", "Skip"}, {"khr.skip.0001", "Skip"}}));
    EXPECT_NE(check.outcome.output.find("\nskipped:\n  Skip: the device has no pipelines\n    2 cases, the first of"),
              std::string::npos)
        << check.outcome.output;
}

TEST_F(Check, ARunThatTestedNothingFails)
{
    writeFile(folder_ / "skips", "good\n");
    const CheckRun skipped = run({"good.*"}, {"--skips", (folder_ / "skips").string()});
    EXPECT_EQ(skipped.outcome.exitCode, kNotRun);
    EXPECT_EQ(skipped.outcome.errors,
              "vellum: nothing was tested: all cases were skipped, the first because: by --skips\n");
    EXPECT_EQ(skipped.results.size(), 5U);
    EXPECT_EQ(run({"skip.*"}).outcome.exitCode, kNotRun);
    EXPECT_EQ(runCheck(folder_, {"--filter", "ext.good.*"}, {{"VELLUM_FAKE_DEVICE", "khr"}}).outcome.exitCode, kNotRun);
}

TEST_F(Check, NewCasesOfAGroupThatSkipsComeToAnEnd)
{
    const CheckRun check = run({"skip.*"}, {"--minutes", "1"});
    EXPECT_EQ(check.outcome.exitCode, kNotRun);
    EXPECT_GE(check.results.size(), 20U);
    EXPECT_LE(check.results.size(), 30U);
}

TEST_F(Check, ACrashNamesItsSignalAndTheRunGoesOn)
{
    const CheckRun check = run({"crash.*", "good.0000"});
    EXPECT_EQ(check.outcome.exitCode, 1);
    EXPECT_EQ(check.results,
              (Statuses{{"khr.crash.0000", "Crash"}, {"khr.crash.0001", "Crash"}, {"khr.good.0000", "Pass"}}));
    EXPECT_NE(check.outcome.output.find("  Crash: " + kCrash + "\n    2 cases"), std::string::npos)
        << check.outcome.output;
}

TEST_F(Check, TheFirstCrashWithACauseIsShrunk)
{
    run({"crash.*", "lost.0000"}, {"--jobs", "1"});
    for (const char *name : {"khr.crash.0000", "khr.lost.0000"})
        EXPECT_EQ(trianglesOf(name), 3U);
    EXPECT_EQ(trianglesOf("khr.crash.0001"), 12U);
    EXPECT_NE(textOf(folder_ / "out/failures/khr.crash.0000.txt").find("the process ended: " + kCrash),
              std::string::npos);
    EXPECT_NE(textOf(folder_ / "out/failures/khr.lost.0000.txt").find("the device was lost: vkQueueSubmit"),
              std::string::npos);
}

TEST_F(Check, CasesThatHangHaveAReproducer)
{
    run({"hang.*"}, {"--timeout", "1"});
    EXPECT_EQ(trianglesOf("khr.hang.0000"), 12U);
    EXPECT_NE(textOf(folder_ / "out/failures/khr.hang.0000.txt").find("nothing within the time limit"),
              std::string::npos);
}

TEST_F(Check, ReportsNameKnownFaultsOfTheDevice)
{
    const CheckRun check = run({"good.0000"});
    EXPECT_NE(check.outcome.output.find("\nknown faults of the device: 1, because of which some things are not tested: "
                                        "knownFaults in results.json\n"),
              std::string::npos)
        << check.outcome.output;
    EXPECT_NE(
        textOf(folder_ / "out/junit.xml")
            .find("<property name=\"known fault\" value=\"rays are &#60;green&#62;: colours are not compared\"/>"),
        std::string::npos);
    const std::string json = textOf(folder_ / "out/results.json");
    EXPECT_NE(json.find("\"fault\": \"rays are <green>\""), std::string::npos) << json;
    EXPECT_NE(json.find("\"response\": \"colours are not compared\""), std::string::npos);
}

TEST_F(Check, CrashesBetweenOtherCasesLoseNoResult)
{
    const CheckRun check = run({"sometimes.*"}, {"--jobs", "2"});
    EXPECT_EQ(check.results.size(), 30U);
    EXPECT_FALSE(check.failures.empty());
    EXPECT_LT(check.failures.size(), 30U);
    for (const auto &[name, status] : check.failures)
        EXPECT_EQ(status, "Crash") << name;
}

TEST_F(Check, AFailedAssertionIsTheCause)
{
    const CheckRun check = run({"assertion.*"}, {"--json"});
    EXPECT_NE(
        check.outcome.output.find("\"Crash: " + kAbort + ": driver.c:12: draw: Assertion `\xef\xbf\xbd' failed.\""),
        std::string::npos)
        << check.outcome.output;
    EXPECT_NE(check.outcome.output.find("chatter"), std::string::npos);
    const std::string junit = textOf(folder_ / "out/junit.xml");
    EXPECT_NE(junit.find("draw: Assertion `&#65533;&#39; failed.\""), std::string::npos) << junit;
    EXPECT_NE(junit.find("chatter&#10;driver.c"), std::string::npos) << junit;
}

TEST_F(Check, HungProcessesAreKilled)
{
    const CheckRun check = run({"hang*", "good.0000"}, {"--timeout", "1"});
    EXPECT_EQ(check.outcome.exitCode, 1);
    EXPECT_EQ(check.results,
              (Statuses{{"khr.good.0000", "Pass"}, {"khr.hang.0000", "Timeout"}, {"khr.hang-twice.0000", "Timeout"}}));
}

TEST_F(Check, ALostDeviceIsACrash)
{
    const CheckRun check = run({"lost.*"});
    EXPECT_EQ(check.outcome.exitCode, 1);
    EXPECT_EQ(check.results, (Statuses{{"khr.lost.0000", "Crash"}, {"khr.lost.0001", "Crash"}}));
    EXPECT_NE(check.outcome.output.find("  DeviceLost: vkQueueSubmit\n    2 cases"), std::string::npos)
        << check.outcome.output;
}

TEST_F(Check, AProcessThatEndsInACaseIsACrash)
{
    const CheckRun check = run({"exit.*", "throw.*"});
    EXPECT_EQ(check.results, (Statuses{{"khr.exit.0000", "Crash"}, {"khr.throw.0000", "Fail"}}));
    EXPECT_NE(check.outcome.output.find("Fail: exception: no memory"), std::string::npos) << check.outcome.output;
}

TEST_F(Check, ACrashAfterTheLastCaseCounts)
{
    const CheckRun check = run({"end.*"}, {"--jobs", "1"});
    EXPECT_EQ(check.results, (Statuses{{"khr.end.0000", "Pass"}, {"khr.end.0001", "Pass"}, {"khr.end.0002", "Crash"}}));
    EXPECT_NE(check.outcome.output.find("Crash: " + kCrash + " when the device was closed"), std::string::npos)
        << check.outcome.output;
}

TEST_F(Check, OutputOfDriversIsNotAResult)
{
    const CheckRun check = run({"junk.*", "events.*"});
    EXPECT_EQ(check.outcome.exitCode, 0) << check.outcome.output;
    EXPECT_EQ(check.results.size(), 5U);
    EXPECT_EQ(check.outcome.output.find("event"), check.outcome.output.find("events")) << "only the group's name";
}

TEST_F(Check, PassingTheSecondTimeIsAFlake)
{
    const CheckRun check = run({"flake.*"}, {}, {{"VELLUM_FAKE_FOLDER", folder_.path().string()}});
    EXPECT_EQ(check.outcome.exitCode, 0);
    EXPECT_EQ(check.results, (Statuses{{"khr.flake.0000", "Flake"}, {"khr.flake.0001", "Flake"}}));
    EXPECT_NE(check.outcome.output.find("2 flakes"), std::string::npos) << check.outcome.output;
}

// The cases before it are shrunk from the front.
TEST_F(Check, ACrashThatOtherCasesOfItsProcessCauseIsAFailure)
{
    const CheckRun check = run({"worn.*"}, {"--jobs", "1"});
    EXPECT_EQ(check.outcome.exitCode, 1);
    EXPECT_EQ(check.failures, (Statuses{{"khr.worn.0007", "Crash"}}));
    const std::filesystem::path file = folder_ / "out/failures/khr.worn.0007.json";
    EXPECT_NE(check.outcome.output.find("  Crash: " + kCrash +
                                        "\n    1 case, the first of which is khr.worn.0007\n"
                                        "    only after the 3 cases before it in its process, which this runs first:\n"
                                        "    vellum check --replay " +
                                        file.string() + "\n"),
              std::string::npos)
        << check.outcome.output;
    EXPECT_NE(textOf(folder_ / "out/failures/khr.worn.0007.txt").find("khr.worn.0004, khr.worn.0005, khr.worn.0006\n"),
              std::string::npos);
    const Outcome replayed = runVellum({"check", "--replay", file.string()});
    EXPECT_EQ(replayed.exitCode, 1) << replayed.errors;
    EXPECT_EQ(
        replayed.output.find("khr.worn.0007: Crash: " + kCrash +
                             "\nmicromaps: fake\n"
                             "run after these in the same process: khr.worn.0004, khr.worn.0005, khr.worn.0006\n"),
        0U)
        << replayed.output;
    const Outcome merged =
        runVellum({"check", "--output", (folder_ / "all").string(), "--merge", (folder_ / "out").string()});
    EXPECT_NE(merged.output.find("    only after the 3 cases before it in its process"), std::string::npos)
        << merged.output;
    EXPECT_EQ(run({"worn.0007"}).outcome.exitCode, 0);
}

TEST_F(Check, AHangThatOtherCasesOfItsProcessCauseIsAFailure)
{
    const CheckRun check = run({"worn.*"}, {"--jobs", "1", "--timeout", "1"}, {{"VELLUM_FAKE_WORN", "hang"}});
    EXPECT_EQ(check.outcome.exitCode, 1);
    EXPECT_EQ(check.failures, (Statuses{{"khr.worn.0007", "Timeout"}}));
    EXPECT_NE(check.outcome.output.find("    only after the 7 cases before it in its process"), std::string::npos)
        << check.outcome.output;
}

TEST_F(Check, ACrashThatDoesNotRepeatIsAFlake)
{
    const auto crashOnce = [&](const std::vector<std::string> &arguments) {
        const TemporaryFolder marks;
        return run({"crash-once.*"}, arguments, {{"VELLUM_FAKE_FOLDER", marks.path().string()}});
    };
    const CheckRun check = crashOnce({"--jobs", "1"});
    EXPECT_EQ(check.outcome.exitCode, 0) << check.outcome.output;
    EXPECT_EQ(check.results, (Statuses{{"khr.crash-once.0000", "Flake"},
                                       {"khr.crash-once.0001", "Flake"},
                                       {"khr.crash-once.0002", "Flake"}}));
    const CheckRun failed = crashOnce({"--fail-on-flake"});
    EXPECT_EQ(failed.outcome.exitCode, 1);
    EXPECT_NE(failed.outcome.errors.find("vellum: 3 flakes fail the run, by --fail-on-flake\n"), std::string::npos)
        << failed.outcome.errors;
    writeFile(folder_ / "flakes", "crash-once\n");
    const CheckRun known = crashOnce({"--fail-on-flake", "--flakes", (folder_ / "flakes").string()});
    EXPECT_EQ(known.outcome.exitCode, 0) << known.outcome.errors;
    EXPECT_EQ(known.results.at("khr.crash-once.0000"), "KnownFlake");
    EXPECT_EQ(crashOnce({"--fail-on-flake", "--fail-fast", "--jobs", "1"}).results.size(), 1U);
    const std::string out = (folder_ / "out").string();
    EXPECT_EQ(runVellum({"check", "--output", out + "2", "--merge", out, "--fail-on-flake"}).exitCode, 1);
    EXPECT_EQ(runVellum({"check", "--output", out + "2", "--merge", out}).exitCode, 0);
}

#ifndef _WIN32 // has no limit of file sizes
TEST_F(Check, ResultsThatCannotBeWrittenArePrinted)
{
    const Outcome full = runVellumWithFileLimit(
        {"check", "--filter", "*.bad.*", "--filter", "*.good.*", "--output", (folder_ / "full").string()}, 2000);
    EXPECT_EQ(full.exitCode, 1) << full.errors;
    EXPECT_NE(full.output.find("    10 cases, the first of which is "), std::string::npos) << full.output;
    EXPECT_EQ(linesOf(folder_ / "full/results.csv").size(), 20U);
    EXPECT_NE(textOf(folder_ / "full/results.json").find("\"it has not ended\""), std::string::npos)
        << "nothing is half-written";
}
#endif

TEST_F(Check, ADeviceThatCannotBeOpenedEndsTheRun)
{
    for (const char *behaviour : {"throw", "crash"}) {
        const CheckRun check = run({"good.*", "sometimes.*"}, {"--jobs", "1"}, {{"VELLUM_FAKE_OPEN", behaviour}});
        EXPECT_EQ(check.outcome.exitCode, 1);
        EXPECT_EQ(check.results.size(), 35U);
        EXPECT_EQ(check.results.at("khr.good.0000"), "Crash");
        EXPECT_EQ(check.results.at("khr.sometimes.0029"), "Missing");
        EXPECT_NE(check.outcome.output.find("the device cannot be opened"), std::string::npos) << check.outcome.output;
    }
    const CheckRun check = run({"good.0000"}, {"--timeout", "1"}, {{"VELLUM_FAKE_OPEN", "hang"}});
    EXPECT_EQ(check.results, (Statuses{{"khr.good.0000", "Timeout"}}));
}

#ifndef _WIN32 // has no limit of open files
TEST_F(Check, FewerWorkersThanJobs)
{
    const std::vector<std::string> arguments = {
        "check", "--filter", "*.good.*", "--jobs", "4", "--output", (folder_ / "out").string()};
    const Outcome outcome = runVellumWithOpenFiles(arguments, 12);
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_EQ(statusesIn(folder_ / "out/results.csv").size(), 10U);
}

// The failures of all slots at one time are one attempt; others follow, half a second apart.
TEST_F(Check, WorkersAreStartedAgainAfterAPause)
{
    const auto begin = std::chrono::steady_clock::now();
    const CheckRun check = run({"used-up-crash.*", "sometimes.*"}, {"--jobs", "6"});
    EXPECT_EQ(check.outcome.exitCode, 1) << check.outcome.errors;
    EXPECT_NE(check.outcome.output.find("  Missing: no worker can be started: "), std::string::npos)
        << check.outcome.output;
    EXPECT_GT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(2));
}

TEST_F(Check, ResultsOutliveWorkersThatCannotBeStarted)
{
    struct Row {
        const char *group;
        const char *result; // of its only case
        bool quick;
        size_t results;
    };
    for (const Row &row :
         {Row{"used-up", "Pass", false, 36}, {"used-up", "Pass", true, 24}, {"used-up-crash", "Crash", false, 36}}) {
        std::vector<std::string> arguments = {"--jobs", "1"};
        if (row.quick)
            arguments.emplace_back("--quick");
        CheckRun check = run({"good.*", row.group + std::string(".*"), "sometimes.*"}, arguments);
        EXPECT_EQ(check.outcome.exitCode, 1) << check.outcome.errors;
        EXPECT_EQ(check.results.size(), row.results);
        EXPECT_EQ(check.results["khr.good.0002"], "Pass");
        EXPECT_EQ(check.results["khr." + std::string(row.group) + ".0000"], row.result);
        EXPECT_EQ(check.results["khr.sometimes.0000"], "Missing");
        EXPECT_NE(check.outcome.output.find("  Missing: no worker can be started: "), std::string::npos)
            << check.outcome.output;
        EXPECT_NE(textOf(folder_ / "out/junit.xml").find("<failure type=\"Missing\""), std::string::npos);
    }
}
#endif

TEST_F(Check, NoDeviceIsAnError)
{
    for (const char *device : {"none", "crash"}) {
        const CheckRun check = run({"good.*"}, {}, {{"VELLUM_FAKE_DEVICE", device}});
        EXPECT_EQ(check.outcome.exitCode, kNotRun);
        EXPECT_EQ(check.outcome.errorLines(), 1) << check.outcome.errors;
        EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
    }
    EXPECT_EQ(run({"good.*"}, {"--api", "khr"}, {{"VELLUM_FAKE_DEVICE", "ext"}}).outcome.exitCode, kNotRun);
}

TEST_F(Check, ProgressIsPlainLinesWithoutATerminal)
{
    const CheckRun check = run({"bad.0000", "hang.*"}, {"--jobs", "1", "--timeout", "1", "--progress", "0.2"});
    const std::string &lines = check.outcome.errors;
    EXPECT_NE(lines.find("\nvellum: checking: 1 of 2 cases, 1 failure, khr.hang, about "), std::string::npos) << lines;
    EXPECT_NE(lines.find(" s left\n"), std::string::npos) << lines;
    EXPECT_EQ(std::count_if(lines.begin(), lines.end(), [](char c) { return c < ' ' && c != '\n'; }), 0) << lines;
    const CheckRun begun =
        run({"bad.0000", "hang.*", "lost.*"}, {"--jobs", "1", "--timeout", "1", "--progress", "0.2"});
    EXPECT_NE(begun.outcome.errors.find("\nvellum: checking: 1 of 4 cases, 1 failure, khr.hang\n"), std::string::npos)
        << "no estimate before a third has ended\n"
        << begun.outcome.errors;
    const CheckRun timed = run({"hang.*"}, {"--timeout", "1", "--progress", "0.2", "--minutes", "0.01"});
    EXPECT_NE(timed.outcome.errors.find("vellum: checking: 0 cases, 0 failures, khr.hang, 0 s left\n"),
              std::string::npos)
        << timed.outcome.errors;
    for (const char *pause : {"0", "100"})
        EXPECT_EQ(run({"hang.*"}, {"--timeout", "1", "--progress", pause}).outcome.errors, "khr.hang.0000: Timeout\n");
}

TEST_F(Check, SettingsThatTheLayerIgnoresAreUsageErrors)
{
    const CheckRun check = run({"good.*"}, {}, {{"VELLUM_FAKE_DEVICE", "setting"}});
    EXPECT_EQ(check.outcome.exitCode, 2);
    EXPECT_EQ(check.outcome.errors, "vellum: VELLUM-setting: there is no setting VELLUM_VALIDTE\n");
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
}

TEST_F(Check, TheLayerIsKeptOut)
{
    const std::string layer = "VK_LAYER_VELLUM_opacity_micromap";
#ifdef _WIN32
    const std::string separator = ";";
#else
    const std::string separator = ":";
#endif
    const Environment on = {{"VELLUM_FAKE_DEVICE", "variables"},
                            {"VK_INSTANCE_LAYERS", "VK_LAYER_a" + separator + layer + separator + "VK_LAYER_b"},
                            {"VK_LOADER_LAYERS_ENABLE", layer + ",*c"},
                            {"VK_LOADER_LAYERS_DISABLE", "VK_LAYER_d"}};
    const CheckRun failed = run({"good.*"}, {"--no-layer"}, {{"VELLUM_FAKE_DEVICE", "layer"}});
    EXPECT_EQ(failed.outcome.exitCode, kNotRun);
    EXPECT_EQ(failed.outcome.errors.find(
                  "vellum: --no-layer does not keep the layer out: micromaps are emulated by the layer " + layer),
              0U)
        << failed.outcome.errors;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
    EXPECT_EQ(run({"good.*"}, {}, {{"VELLUM_FAKE_DEVICE", "layer"}}).outcome.exitCode, 0);
    EXPECT_EQ(lineOf(run({"good.*"}, {"--no-layer"}, on).outcome, "micromaps:"),
              "micromaps: VK_LAYER_a" + separator + "VK_LAYER_b|*c|VK_LAYER_d,VELLUM|");
    EXPECT_EQ(lineOf(run({"good.*"}, {}, on).outcome, "micromaps:"),
              "micromaps: VK_LAYER_a" + separator + "VELLUM" + separator + "VK_LAYER_b|VELLUM,*c|VK_LAYER_d|");
}

#ifndef _WIN32 // sends Ctrl-C to all processes of a console only
TEST_F(Check, Interruption)
{
    const std::filesystem::path output = folder_ / "out";
    const Outcome outcome = interruptVellum(
        {"check", "--filter", "khr.good.*", "--filter", "khr.hang.*", "--jobs", "1", "--output", output.string()},
        SIGINT, folder_ / "hangs", {{"VELLUM_FAKE_FOLDER", folder_.path().string()}});
    EXPECT_EQ(outcome.signal, SIGINT);
    EXPECT_EQ(statusesIn(output / "results.csv").size(), 5U) << outcome.errors;
    EXPECT_NE(outcome.output.find("interrupted"), std::string::npos) << outcome.output;
    EXPECT_EQ(lineOf(outcome, "khr.good").substr(0, 18), "khr.good        5 ");
    EXPECT_EQ(outcome.output.find("\nkhr.hang "), std::string::npos) << "no row of zeros\n" << outcome.output;
    const Outcome merged = runVellum({"check", "--output", (folder_ / "all").string(), "--merge", output.string()});
    EXPECT_NE(merged.errors.find("out: interrupted\n"), std::string::npos) << merged.errors;
    const std::string replaced =
        "vellum: the results in " + output.string() + " are not whole (interrupted); this run replaces them\n";
    EXPECT_EQ(run({"good.*"}).outcome.errors.find(replaced), 0U);
    EXPECT_EQ(run({"good.*"}).outcome.errors.find("not whole"), std::string::npos) << "of a run that is whole";
}

// In the folder of a run that was whole.
TEST_F(Check, ResultsOfAKilledRunAreNotWhole)
{
    const std::filesystem::path output = folder_ / "out";
    EXPECT_EQ(run({"good.*"}).outcome.exitCode, 0);
    const Outcome outcome = interruptVellum(
        {"check", "--filter", "khr.good.*", "--filter", "khr.hang.*", "--jobs", "1", "--output", output.string()},
        SIGKILL, folder_ / "hangs", {{"VELLUM_FAKE_FOLDER", folder_.path().string()}});
    EXPECT_EQ(outcome.signal, SIGKILL);
    const Outcome merged = runVellum({"check", "--output", (folder_ / "all").string(), "--merge", output.string()});
    EXPECT_EQ(merged.exitCode, kNotRun);
    EXPECT_NE(merged.errors.find("out: it has not ended\n"), std::string::npos) << merged.errors;
}
#endif
