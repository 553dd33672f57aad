// SPDX-License-Identifier: Apache-2.0
// `vellum check`: which cases run, what is expected of them, and replaying.
#include <gtest/gtest.h>
#include <regex>
#include <set>

#include "check/results.h"

using namespace vellum::test;

namespace
{

using Statuses = std::map<std::string, std::string>;

class CheckSelection : public testing::Test
{
protected:
    CheckRun run(const std::vector<std::string> &arguments, const Environment &environment = {})
    {
        return runCheck(folder_, arguments, environment);
    }
    // The path of a file with this content.
    std::string file(const std::string &name, const std::string &text)
    {
        writeFile(folder_ / name, text);
        return (folder_ / name).string();
    }

    TemporaryFolder folder_;
};

std::vector<std::string> linesOfText(const std::string &text)
{
    std::vector<std::string> lines;
    for (size_t at = 0; at < text.size();) {
        const size_t end = std::min(text.find('\n', at), text.size());
        lines.push_back(text.substr(at, end - at));
        at = end + 1;
    }
    return lines;
}

} // namespace

TEST_F(CheckSelection, ListIsACaseList)
{
    const Outcome list = runVellum({"check", "--list", "--filter", "*.good.000[01]", "--filter", "khr.skip.*"});
    EXPECT_EQ(linesOfText(list.output), (std::vector<std::string>{"khr.good.0000", "khr.good.0001", "khr.skip.0000",
                                                                  "khr.skip.0001", "ext.good.0000", "ext.good.0001"}));
    const CheckRun check = run({"--caselist", file("cases", "# of today\n\n" + list.output)});
    EXPECT_EQ(check.outcome.exitCode, 0) << check.outcome.errors;
    EXPECT_EQ(check.results.size(), 6U);
    const Outcome ext = runVellum({"check", "--list", "--api", "ext"});
    EXPECT_EQ(ext.output.find("khr."), std::string::npos);
}

TEST_F(CheckSelection, Groups)
{
    const Outcome groups = runVellum({"check", "--groups"});
    EXPECT_EQ(groups.exitCode, 0);
    EXPECT_EQ(groups.output.substr(0, groups.output.find("bad")),
              "good (5 cases of each extension, 3 of them with --quick)\n  Passes\n  Checks: Section 1\n");
}

TEST_F(CheckSelection, ExtensionsOfTheDevice)
{
    const std::vector<std::string> good = {"--filter", "*.good.*"};
    EXPECT_EQ(run(good).results.size(), 10U);
    EXPECT_EQ(run(good, {{"VELLUM_FAKE_DEVICE", "ext"}}).results.size(), 5U);
    const CheckRun both = run({"--filter", "*.good.0000", "--api", "both"}, {{"VELLUM_FAKE_DEVICE", "khr"}});
    EXPECT_EQ(both.results, (Statuses{{"ext.good.0000", "Skip"}, {"khr.good.0000", "Pass"}}));
}

TEST_F(CheckSelection, SeedsAreStable)
{
    const std::vector<std::string> arguments = {"--filter", "khr.bad.0002"};
    const auto seedOf = [&](const std::vector<std::string> &more) {
        std::vector<std::string> all = arguments;
        all.insert(all.end(), more.begin(), more.end());
        run(all);
        const std::string text = textOf(folder_ / "out/failures/khr.bad.0002.json");
        std::smatch match;
        EXPECT_TRUE(std::regex_search(text, match, std::regex("\"seed\": \"(0x[0-9a-f]{16})\""))) << text;
        return match[1].str();
    };
    const std::string seed = seedOf({});
    EXPECT_EQ(seed, "0x4cbf5e65d5416b27") << "the cases of everybody's baselines change";
    EXPECT_EQ(seedOf({"--seed", "1"}), seed);
    EXPECT_EQ(seedOf({"--filter", "khr.bad.*", "--jobs", "3"}), seed) << "the other cases do not matter";
    EXPECT_NE(seedOf({"--seed", "2"}), seed);
}

TEST_F(CheckSelection, MinutesMakeNewCases)
{
    const CheckRun check = run({"--filter", "khr.good.*", "--minutes", "0.03", "--jobs", "2"});
    EXPECT_EQ(check.outcome.exitCode, 0) << check.outcome.errors;
    EXPECT_GT(check.results.size(), 5U);
    EXPECT_TRUE(check.results.contains("khr.good.0000"));
    EXPECT_TRUE(check.results.contains("khr.good.0005"));
    const CheckRun one = run({"--filter", "khr.good.0002", "--minutes", "1"});
    EXPECT_EQ(one.results, (Statuses{{"khr.good.0002", "Pass"}})) << "there are no others";
}

TEST_F(CheckSelection, QuickIsTheFirstCasesOfEachGroup)
{
    const std::vector<std::string> arguments = {"--quick", "--filter", "*.good.*", "--filter", "*.junk.*"};
    const CheckRun check = run(arguments);
    EXPECT_EQ(check.outcome.exitCode, 0) << check.outcome.errors;
    Statuses expected;
    for (const std::string api : {"khr", "ext"})
        for (const char *name : {".good.0000", ".good.0001", ".good.0002", ".junk.0000"})
            expected[api + name] = "Pass";
    EXPECT_EQ(check.results, expected);
    const Outcome list = runVellum({"check", "--quick", "--list"});
    EXPECT_NE(list.output.find("ext.good.0002\next.bad.0000\n"), std::string::npos) << list.output;
    EXPECT_NE(list.output.find("khr.sometimes.0019\nkhr.end.0000\n"), std::string::npos) << list.output;
    EXPECT_EQ(
        run({"--quick", "--filter", "khr.good.0003"}).outcome.errors,
        "vellum: --filter khr.good.0003 matches no case of a quick run; did you mean khr.good.*?; vellum check --quick "
        "--list prints them\n");
}

TEST_F(CheckSelection, NamesGroupsThatWereHardlyTested)
{
    const std::string skips = file("skips.txt", "good.000[0-2]\nbad.000[0-4]\n");
    const CheckRun check = run({"--skips", skips, "--api", "khr", "--filter", "*.good.*", "--filter", "*.bad.*",
                                "--filter", "*.skip.*", "--filter", "*.junk.*"});
    EXPECT_EQ(check.outcome.exitCode, 0);
    EXPECT_NE(
        check.outcome.output.find("\nskipped:\n  Skip: by --skips\n    8 cases, the first of which is khr.good.0000\n"
                                  "  Skip: the device has no pipelines\n"),
        std::string::npos)
        << check.outcome.output;
    EXPECT_NE(check.outcome.output.find("\nlittle tested: khr.good (2 of 5, 3 skipped)\n"
                                        "\nnot tested: khr.bad (5 skipped), khr.skip (2 skipped)\n"),
              std::string::npos)
        << check.outcome.output;
    EXPECT_NE(check.outcome.output.find("fake: 5 cases in "), std::string::npos) << check.outcome.output;
    EXPECT_NE(check.outcome.output.find(" s, 10 skipped, no failure\n"), std::string::npos) << check.outcome.output;

    const CheckRun ended =
        run({"--api", "khr", "--filter", "*.bad.*", "--filter", "*.good.*", "--jobs", "1", "--fail-fast"});
    EXPECT_NE(ended.outcome.output.find("\nlittle tested: khr.bad (1 of 5)\n"), std::string::npos)
        << ended.outcome.output;
    const CheckRun few = run({"--filter", "khr.good.0000"});
    EXPECT_EQ(few.outcome.output.find("little tested"), std::string::npos) << few.outcome.output;
}

TEST_F(CheckSelection, BaselineIsDeqpRunners)
{
    const std::string baseline = file("fails.txt", "# known\n"
                                                   "khr.bad.0000,Fail\n"
                                                   "khr.bad.0001,Crash\n"
                                                   "khr.bad.0002,ExpectedFail,1.5\n"
                                                   "khr.crash.0000,Crash\n"
                                                   "khr.crash.0001,Fail\n"
                                                   "khr.good.0000,Fail\n"
                                                   "khr.good.0001,Pass\n"
                                                   "khr.good.0002,Timeout\n"
                                                   "khr.skip.0000,Crash\n"
                                                   "khr.lost.0000,Crash\n");
    const CheckRun check = run({"--baseline", baseline, "--filter", "khr.bad.*", "--filter", "khr.crash.*", "--filter",
                                "khr.good.*", "--filter", "khr.skip.*", "--filter", "khr.lost.0000"});
    EXPECT_EQ(check.outcome.exitCode, 1);
    const Statuses expected = {
        {"khr.bad.0000", "ExpectedFail"},  {"khr.bad.0001", "UnexpectedImprovement(Fail)"},
        {"khr.bad.0002", "ExpectedFail"},  {"khr.bad.0003", "Fail"},
        {"khr.bad.0004", "Fail"},          {"khr.crash.0000", "ExpectedFail"},
        {"khr.crash.0001", "Crash"},       {"khr.good.0000", "UnexpectedImprovement(Pass)"},
        {"khr.good.0001", "Pass"},         {"khr.good.0002", "UnexpectedImprovement(Pass)"},
        {"khr.good.0003", "Pass"},         {"khr.good.0004", "Pass"},
        {"khr.lost.0000", "ExpectedFail"}, {"khr.skip.0000", "UnexpectedImprovement(Skip)"},
        {"khr.skip.0001", "Skip"},
    };
    EXPECT_EQ(check.results, expected);
    Statuses failures = expected;
    std::erase_if(failures, [](const auto &entry) {
        return entry.second == "Pass" || entry.second == "Skip" || entry.second == "ExpectedFail";
    });
    EXPECT_EQ(check.failures, failures);
    EXPECT_NE(check.outcome.output.find("\nbetter than the baseline, which is to be updated:\n"
                                        "  UnexpectedImprovement(Pass)\n"
                                        "    2 cases, the first of which is khr.good.0000\n"),
              std::string::npos)
        << check.outcome.output;
    EXPECT_EQ(check.outcome.output.find("  Pass\n"), std::string::npos) << check.outcome.output;
    EXPECT_NE(check.outcome.output.find(", 3 failures (4 expected failures, 4 unexpected improvements)"),
              std::string::npos)
        << check.outcome.output;
}

TEST_F(CheckSelection, SimilarGroups)
{
    const CheckRun check = run({"--filter", "khr.goood.*"});
    EXPECT_EQ(check.outcome.errors,
              "vellum: --filter khr.goood.* matches no case; did you mean khr.good.*?; vellum check "
              "--list prints them\n");
}

TEST_F(CheckSelection, FailuresAreTheNextBaseline)
{
    const std::vector<std::string> filters = {"--filter", "khr.bad.*", "--filter", "khr.crash.*"};
    EXPECT_EQ(run(filters).outcome.exitCode, 1);
    const std::string baseline = file("baseline.csv", textOf(folder_ / "out/failures.csv"));
    std::vector<std::string> again = filters;
    again.insert(again.end(), {"--baseline", baseline});
    const CheckRun check = run(again);
    EXPECT_EQ(check.outcome.exitCode, 0) << check.outcome.output;
    EXPECT_EQ(textOf(folder_ / "out/failures.csv"), "");
    EXPECT_NE(check.outcome.output.find("7 expected failures"), std::string::npos) << check.outcome.output;
}

TEST_F(CheckSelection, ImprovementsAreTheNextBaseline)
{
    const std::string crashes = file("crashes.csv", "khr.bad.0000,Crash\n");
    EXPECT_EQ(run({"--filter", "khr.bad.0000", "--baseline", crashes}).outcome.exitCode, 1);
    const std::string improved = file("improved.csv", textOf(folder_ / "out/failures.csv"));
    EXPECT_EQ(textOf(improved), "khr.bad.0000,UnexpectedImprovement(Fail)\n");
    const CheckRun check = run({"--filter", "khr.bad.0000", "--baseline", improved});
    EXPECT_EQ(check.results, (Statuses{{"khr.bad.0000", "ExpectedFail"}}));
    EXPECT_EQ(check.outcome.exitCode, 0);
}

TEST_F(CheckSelection, SkipsAndFlakes)
{
    const std::string skips = file("skips.txt", "# too slow\nkhr.hang.*\n");
    const std::string flakes = file("flakes.txt", "bad.000[12]$\n");
    const CheckRun check = run({"--skips", skips, "--flakes", flakes, "--filter", "khr.hang.*", "--filter",
                                "khr.hang-twice.*", "--filter", "khr.bad.000[123]", "--timeout", "30"});
    EXPECT_EQ(check.outcome.exitCode, 1);
    EXPECT_EQ(check.results, (Statuses{{"khr.bad.0001", "KnownFlake"},
                                       {"khr.bad.0002", "KnownFlake"},
                                       {"khr.bad.0003", "Fail"},
                                       {"khr.hang-twice.0000", "Skip"},
                                       {"khr.hang.0000", "Skip"}}));
}

TEST_F(CheckSelection, Replay)
{
    run({"--filter", "khr.bad.0000", "--filter", "khr.crash.0000"});
    const std::string failures = (folder_ / "out/failures/").string();
    const Outcome shrunk = runVellum({"check", "--replay", failures + "khr.bad.0000.json"});
    EXPECT_EQ(shrunk.exitCode, 1);
    EXPECT_EQ(shrunk.output, "khr.bad.0000: Fail: replayed {\"triangles\":1}\nmicromaps: fake\n") << shrunk.errors;
    const Outcome whole = runVellum({"check", "--replay", failures + "khr.crash.0000.json"});
    EXPECT_EQ(whole.exitCode, 1);
    EXPECT_EQ(whole.output, "khr.crash.0000: Crash: " + kCrash + "\nmicromaps: fake\nThe last output was:\n?? <&\n")
        << whole.errors;
    const std::string good =
        std::regex_replace(textOf(failures + "khr.bad.0000.json"), std::regex("triangles"), "good");
    const Outcome passes = runVellum({"check", "--replay", file("good.json", good)});
    EXPECT_EQ(passes.exitCode, 0) << passes.errors;
}

// Also after --merge.
TEST_F(CheckSelection, ReplayHasTheOptionsOfTheDevice)
{
    const CheckRun check = run({"--filter", "khr.bad.0000", "--no-layer", "--device", "my GPU"});
    const std::string line = "    vellum check --no-layer --device \"my GPU\" --replay ";
    EXPECT_NE(check.outcome.output.find(line + (folder_ / "out").string()), std::string::npos) << check.outcome.output;
    const std::string all = (folder_ / "all").string();
    const Outcome merged = runVellum({"check", "--merge", (folder_ / "out").string(), "--output", all});
    EXPECT_NE(merged.output.find(line + all), std::string::npos) << merged.output;
    const std::string emulated = run({"--filter", "khr.bad.0000", "--implementation", "emulated"}).outcome.output;
    EXPECT_NE(emulated.find("    vellum check --implementation emulated --replay "), std::string::npos) << emulated;
}

TEST_F(CheckSelection, ResultsAreACaseList)
{
    ASSERT_EQ(
        run({"--filter", "khr.good.0001", "--filter", "khr.good.0003", "--filter", "khr.bad.0002"}).outcome.exitCode,
        1);
    const std::string results = file("results.csv", textOf(folder_ / "out/results.csv"));
    const CheckRun again = run({"--caselist", results});
    EXPECT_EQ(again.outcome.exitCode, 1) << again.outcome.errors;
    EXPECT_EQ(again.results, statusesIn(results));
    EXPECT_FALSE(again.results.empty());
}

TEST_F(CheckSelection, GroupsOfAFilter)
{
    const Outcome all = runVellum({"check", "--groups"});
    const Outcome good = runVellum({"check", "--groups", "--filter", "khr.good.*"});
    EXPECT_EQ(good.output.find("good ("), 0U) << good.output;
    EXPECT_EQ(good.output.find("bad ("), std::string::npos) << good.output;
    EXPECT_LT(good.output.size(), all.output.size());
    EXPECT_EQ(runVellum({"check", "--groups", "--filter", "khr.none.*"}).exitCode, 2);
}

TEST_F(CheckSelection, ShardsTogetherAreTheWholeRun)
{
    const std::vector<std::string> cases = {"--filter", "*.good.*", "--filter", "khr.bad.*", "--filter", "khr.skip.*"};
    const CheckRun whole = run(cases);
    EXPECT_EQ(whole.outcome.exitCode, 1);
    const auto folder = [&](const std::string &name) { return (folder_ / name).string(); };
    std::vector<std::string> merge = {"check", "--output", folder("all"), "--json", "--merge"};
    size_t results = 0;
    for (const std::string shard : {"1", "2", "3"}) {
        std::vector<std::string> one = {"check", "--shard", shard + "/3", "--output", folder(shard)};
        one.insert(one.end(), cases.begin(), cases.end());
        EXPECT_NE(runVellum(one).exitCode, 2);
        const size_t own = statusesIn(folder_ / shard / "results.csv").size();
        EXPECT_GT(own, whole.results.size() / 3 - 2);
        results += own;
        merge.push_back(folder(shard));
    }
    EXPECT_EQ(results, whole.results.size());
    const Outcome merged = runVellum(merge);
    EXPECT_EQ(merged.exitCode, 1) << merged.errors;
    EXPECT_EQ(statusesIn(folder_ / "all/results.csv"), whole.results);
    EXPECT_EQ(statusesIn(folder_ / "all/failures.csv"), whole.failures);
    EXPECT_NE(merged.output.find(R"("cause": "Fail: )"), std::string::npos) << merged.output;
    for (const char *file : {"khr.bad.0000.json", "khr.bad.0000.txt", "khr.bad.0000.png"})
        EXPECT_EQ(textOf(folder_ / "all/failures" / file), textOf(folder_ / "out/failures" / file)) << file;
    EXPECT_EQ(runVellum({"check", "--replay", folder("all") + "/failures/khr.bad.0000.json"}).exitCode, 1);
}

// As in a run: the case with the lowest number is named, and three of a cause have files.
TEST_F(CheckSelection, MergedFailuresOfACause)
{
    std::vector<std::string> merge = {"check", "--output", (folder_ / "all").string(), "--merge"};
    for (const std::string shard : {"1", "2"}) {
        const std::string out = (folder_ / shard).string();
        EXPECT_EQ(runVellum({"check", "--filter", "khr.bad.*", "--shard", shard + "/2", "--output", out}).exitCode, 1);
        merge.push_back(out);
    }
    ASSERT_TRUE(statusesIn(folder_ / "1/results.csv").contains("khr.bad.0001"));
    const Outcome merged = runVellum(merge);
    const auto replayOf = [&](const std::string &name) {
        return "    5 cases, the first of which is khr.bad.0000\n    vellum check --replay " +
               (folder_ / "all/failures" / (name + ".json")).string() + "\n";
    };
    EXPECT_NE(merged.output.find(replayOf("khr.bad.0000")), std::string::npos) << merged.output;
    for (const char *extension : {".json", ".txt", ".png"})
        for (int number = 0; number < 5; ++number)
            EXPECT_EQ(std::filesystem::exists(folder_ / "all/failures" /
                                              ("khr.bad.000" + std::to_string(number) + extension)),
                      number < 3)
                << number << extension;
    // In a run, others may be the first to end.
    std::filesystem::remove(folder_ / "2/failures/khr.bad.0000.json");
    std::filesystem::remove_all(folder_ / "all");
    const Outcome without = runVellum(merge);
    EXPECT_NE(without.output.find(replayOf("khr.bad.0001")), std::string::npos) << without.output;
}

TEST_F(CheckSelection, FailuresOfAnEarlierRunGo)
{
    const std::vector<std::string> known = {"--filter", "khr.bad.*", "--baseline",
                                            file("known.csv", "khr.bad.0000,Fail\n")};
    const std::filesystem::path failures = folder_ / "out/failures";
    const auto names = [](const std::filesystem::path &of) {
        std::set<std::string> found;
        for (const auto &entry : std::filesystem::directory_iterator(of))
            found.insert(entry.path().filename().string());
        return found;
    };
    run({"--filter", "khr.bad.0000"});
    EXPECT_TRUE(std::filesystem::exists(failures / "khr.bad.0000.json"));
    writeFile(failures / "notes.txt", "of the user");
    run(known);
    EXPECT_FALSE(std::filesystem::exists(failures / "khr.bad.0000.json")) << "it failed as expected";
    EXPECT_FALSE(std::filesystem::exists(failures / "khr.bad.0000.png"));
    EXPECT_TRUE(std::filesystem::exists(failures / "khr.bad.0001.json"));
    EXPECT_EQ(textOf(failures / "notes.txt"), "of the user");
    // Files of a folder without results are not those of a run: they stay, and are no reproducers.
    const std::filesystem::path out = folder_ / "out";
    std::filesystem::remove_all(out);
    std::filesystem::create_directories(failures);
    writeFile(failures / "khr.bad.0000.json", "of another program");
    std::vector<std::string> forced = known;
    forced.emplace_back("--force");
    run(forced);
    EXPECT_EQ(textOf(failures / "khr.bad.0000.json"), "of another program");
    runVellum({"check", "--merge", out.string(), "--output", (folder_ / "all").string()});
    std::set<std::string> written = names(failures); // of the three cases of the cause that failed first
    written.erase("khr.bad.0000.json");
    EXPECT_EQ(written.size(), 9u);
    EXPECT_EQ(names(folder_ / "all/failures"), written);
}

TEST_F(CheckSelection, NewCasesInABaseline)
{
    const std::string baseline = file("fails.txt", "khr.good.0123,Pass\n");
    const std::string flakes = file("flakes.txt", "^khr.good.0123$\n");
    const CheckRun check = run(
        {"--filter", "khr.good.*", "--minutes", "0.01", "--baseline", baseline, "--skips", flakes, "--flakes", flakes});
    EXPECT_EQ(check.outcome.exitCode, 0) << check.outcome.errors;
}

TEST_F(CheckSelection, ShardsWithoutCases)
{
    const CheckRun empty = run({"--filter", "khr.good.0000", "--shard", "2/9"});
    const CheckRun other = run({"--filter", "khr.good.0000", "--shard", "1/9"});
    EXPECT_EQ(empty.outcome.exitCode, 0) << empty.outcome.errors;
    EXPECT_EQ(empty.outcome.errorLines(), 1) << empty.outcome.errors;
    EXPECT_EQ(empty.results.size() + other.results.size(), 1U);
}

// New cases, which are not in the plan, count as well.
TEST_F(CheckSelection, AShardOfNewCasesOnlyFails)
{
    for (const std::string shard : {"1", "2"}) {
        const CheckRun check = run({"--filter", "khr.crash.*", "--minutes", "0.02", "--shard", shard + "/40"});
        EXPECT_EQ(check.outcome.exitCode, check.failures.empty() ? 125 : 1) << check.outcome.errors;
        EXPECT_FALSE(check.failures.empty());
    }
}

TEST_F(CheckSelection, MergedTextsAreThoseOfOneRun)
{
    std::vector<std::string> arguments = {"check",     "--jobs",   "1",          "--timeout", "1",  "--filter",
                                          "khr.bad.*", "--filter", "khr.hang.*", "--shard",   "1/1"};
    const auto folder = [&](const std::string &name) { return (folder_ / name).string(); };
    arguments.insert(arguments.end(), {"--output", folder("one")});
    EXPECT_EQ(runVellum(arguments).exitCode, 1);
    EXPECT_EQ(runVellum({"check", "--output", folder("all"), "--merge", folder("one")}).exitCode, 1);
    EXPECT_EQ(textOf(folder_ / "all/junit.xml"), textOf(folder_ / "one/junit.xml"));
    EXPECT_EQ(textOf(folder_ / "all/results.json"),
              std::regex_replace(textOf(folder_ / "one/results.json"), std::regex("one([/\\\\]+failures)"), "all$1"));
    EXPECT_TRUE(std::filesystem::exists(folder_ / "all/failures/khr.hang.0000.json"));
}

TEST_F(CheckSelection, FoldersOfReportsAreMade)
{
    const std::filesystem::path junit = folder_ / "new/reports/all.xml";
    const Outcome outcome = runVellum(
        {"check", "--filter", "khr.good.*", "--output", (folder_ / "new").string(), "--junit", junit.string()});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_TRUE(std::filesystem::exists(junit));
}

TEST_F(CheckSelection, RunsThatAreNotMerged)
{
    const auto folder = [&](const std::string &name) { return (folder_ / name).string(); };
    const auto make = [&](const std::string &name, const std::vector<std::string> &more) {
        std::vector<std::string> all = {"check", "--filter", "khr.good.*", "--output", folder(name)};
        all.insert(all.end(), more.begin(), more.end());
        EXPECT_EQ(runVellum(all).exitCode, 0);
    };
    make("first", {"--shard", "1/2"});
    make("second", {"--shard", "2/2"});
    make("seed", {"--shard", "2/2", "--seed", "2"});
    make("quick", {"--shard", "2/2", "--quick"});
    make("third", {"--shard", "3/3"});
    make("whole", {});
    std::filesystem::create_directory(folder_ / "version");
    writeFile(folder_ / "version/results.json",
              std::regex_replace(textOf(folder_ / "second/results.json"), std::regex("\"version\": \""), "$&1"));
    const Outcome missing = runVellum({"check", "--output", folder("all"), "--merge", folder("first")});
    EXPECT_EQ(missing.exitCode, 125);
    EXPECT_NE(missing.errors.find("of 2 shards these are missing: 2"), std::string::npos) << missing.errors;
    EXPECT_NE(missing.output.find("of 2 shards these are missing: 2"), std::string::npos) << missing.output;
    EXPECT_NE(textOf(folder_ / "all/junit.xml").find("of 2 shards these are missing: 2"), std::string::npos);
    EXPECT_FALSE(statusesIn(folder_ / "all/results.csv").empty());
    const Outcome again = runVellum({"check", "--output", folder("again"), "--merge", folder("all")});
    EXPECT_EQ(again.exitCode, 125) << "it is still missing";
    const std::string own = folder("first") + "/results.json";
    EXPECT_EQ(runVellum({"check", "--output", folder("first"), "--merge", own, folder("second")}).exitCode, 2);
    for (const std::string other : {"first", "seed", "quick", "third", "whole", "version", "none"}) {
        const Outcome wrong = runVellum({"check", "--output", folder("x"), "--merge", folder("first"), folder(other)});
        EXPECT_EQ(wrong.exitCode, 2) << other;
        EXPECT_EQ(wrong.errorLines(), 1) << wrong.errors;
        EXPECT_FALSE(std::filesystem::exists(folder_ / "x")) << other;
    }
    const std::string results = textOf(folder_ / "whole/results.json");
    for (size_t bytes = 0; bytes < results.size(); bytes += 1 + results.size() / 50) {
        writeFile(folder_ / "cut.json", results.substr(0, bytes));
        EXPECT_EQ(runVellum({"check", "--output", folder("x"), "--merge", folder("cut.json")}).exitCode, 2) << bytes;
    }
    EXPECT_EQ(runVellum({"check", "--output", folder("whole"), "--merge", folder("whole")}).exitCode, 2);
}

TEST_F(CheckSelection, MergingTakesNoOptionOfRuns)
{
    const std::string out = (folder_ / "out").string();
    ASSERT_EQ(run({"--filter", "khr.good.0000"}).outcome.exitCode, 0);
    for (const auto &[option, value] : std::map<std::string, std::string>{{"--seed", "1"},
                                                                          {"--shard", "1/2"},
                                                                          {"--api", "khr"},
                                                                          {"--timeout", "5"},
                                                                          {"--baseline", file("a", "")},
                                                                          {"--skips", file("b", "")},
                                                                          {"--flakes", file("c", "")}}) {
        const Outcome outcome = runVellum({"check", "--merge", out, "--output", out + "2", option, value});
        EXPECT_EQ(outcome.exitCode, 2) << option;
        EXPECT_EQ(outcome.errors, "vellum: --merge runs no cases, so it takes no " + option + "\n");
    }
}

TEST_F(CheckSelection, ReplayingTakesNoOptionOfRuns)
{
    run({"--filter", "khr.bad.0000"});
    const std::string failure = (folder_ / "out/failures/khr.bad.0000.json").string();
    const std::vector<std::vector<std::string>> wrong = {
        {"--json"},
        {"--list"},
        {"--groups"},
        {"--quick"},
        {"--fail-on-flake"},
        {"--junit", (folder_ / "a.xml").string()},
        {"--results", (folder_ / "a.csv").string()},
        {"--output", (folder_ / "other").string()},
        {"--baseline", file("a", "")},
        {"--skips", file("b", "")},
        {"--flakes", file("c", "")},
        {"--seed", "2"},
        {"--shard", "1/2"},
        {"--api", "ext"},
    };
    for (std::vector<std::string> words : wrong) {
        const std::string option = words.front();
        words.insert(words.begin(), {"check", "--replay", failure});
        const Outcome outcome = runVellum(words);
        EXPECT_EQ(outcome.exitCode, 2) << option;
        EXPECT_EQ(outcome.errors, "vellum: --replay runs one case, so it takes no " + option + "\n");
    }
    const Outcome outcome =
        runVellum({"check", "--replay", failure, "--no-layer", "--device", "fake", "--timeout", "9"});
    EXPECT_EQ(outcome.exitCode, 1) << outcome.errors;
}

TEST_F(CheckSelection, OtherFilesStay)
{
    std::filesystem::create_directory(folder_ / "out");
    writeFile(folder_ / "out/results.csv", "of another program");
    EXPECT_EQ(run({"--filter", "khr.good.0000"}).outcome.exitCode, 1);
    EXPECT_EQ(textOf(folder_ / "out/results.csv"), "of another program");
    EXPECT_EQ(run({"--filter", "khr.good.0000", "--force"}).outcome.exitCode, 0);
    EXPECT_EQ(run({"--filter", "khr.good.0000"}).outcome.exitCode, 0) << "of an earlier run";
}

TEST_F(CheckSelection, OutputThatCannotBeWritten)
{
    writeFile(folder_ / "out", "a file");
    const CheckRun check = run({"--filter", "khr.good.0000"});
    EXPECT_EQ(check.outcome.exitCode, 1);
    EXPECT_EQ(check.outcome.errorLines(), 1) << check.outcome.errors;
}

TEST_F(CheckSelection, WrongCommandLines)
{
    const std::string good = "khr.good.0000\n";
    const std::vector<std::vector<std::string>> wrong = {
        {"--filter", "khr.none.*"},
        {"--shard", "0/3"},
        {"--shard", "4/3"},
        {"--merge", folder_.path().string(), "--quick"},
        {"--filter", "khr.good.*", "--filter", "khr.none.*"},
        {"--filter", "khr.none.*", "--minutes", "1"},
        {"--filter", "khr.none.*", "--list"},
        {"--filter", "ext.good.*", "--api", "khr"},
        {"--filter", "khr.crash.*", "--caselist", file("good", good)},
        {"--caselist", file("unknown", good + "khr.none.0000\n")},
        {"--caselist", file("short", "khr.good.0\n")},
        {"--caselist", file("empty", "# nothing\n")},
        {"--caselist", (folder_ / "missing").string()},
        {"--baseline", file("name", "khr.good.0000,Fail\nkhr.other.0000,Fail\n")},
        {"--baseline", file("beyond", "khr.good.0004,Fail\nkhr.good.0005,Fail\n")},
        {"--skips", file("skips-beyond", "khr.good.0004\nkhr.good.9999\n")},
        {"--flakes", file("flakes-beyond", "khr.good.0005\n")},
        {"--skips", file("skips", "khr.good\nkhr.other\n")},
        {"--flakes", file("flakes", "khr.other\n")},
        {"--baseline", file("status", "khr.good.0000,Broken\n")},
        {"--baseline", file("no-status", good)},
        {"--baseline", file("twice", "khr.good.0000,Fail\nkhr.good.0000,Fail\n")},
        {"--skips", file("expression", "khr.good.(\n")},
        {"--flakes", file("baseline", "khr.good.0000,Fail\n")},
        {"--replay", file("text", "no JSON")},
        {"--replay", file("report", "{\"command\": \"bake\"}")},
        {"--replay", file("later", R"({"schema": "vellum/2", "command": "check --replay"})")},
        {"--replay", (folder_ / "missing").string()},
        {"--quick", "--minutes", "1"},
        {"--quick", "--caselist", file("good", good)},
        {"--quick", "--filter", "khr.good.0003"},
        {"--progress", "-1"},
        {"--minutes", "1", "--caselist", file("good", good)},
        {"--api", "vulkan"},
        {"--jobs", "0"},
        {"--timeout", "-1"},
        {"--seed", "one"},
        {"--worker"},
    };
    for (const std::vector<std::string> &arguments : wrong) {
        const CheckRun check = run(arguments);
        EXPECT_EQ(check.outcome.exitCode, 2) << arguments.front() << " " << arguments.back() << check.outcome.errors;
        EXPECT_EQ(check.outcome.errorLines(), 1) << check.outcome.errors;
        EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
    }
}
