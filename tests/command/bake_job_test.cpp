// SPDX-License-Identifier: Apache-2.0
// `vellum bake` of many files: lists, shards, logs, and disks that are full.
#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <gtest/gtest.h>
#include <map>
#include <numeric>
#include <set>

#include "command.h"
#include "glb_file.h"
#include "gltf/file/container.h"
#include "gltf/file/gltf_error.h"
#include "gltf/file/json_tree.h"
#include "job/shard.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

namespace fs = std::filesystem;

const std::pair<std::string, std::string> kOpaqueMaterial = {"\"alphaMode\": \"MASK\"", "\"alphaMode\": \"OPAQUE\""};

void writeText(const fs::path &path, const std::string &text)
{
    writeFile(path, {text.begin(), text.end()});
}

// The whole lines of a log.
std::vector<std::string> linesOf(const std::string &text)
{
    std::vector<std::string> lines;
    size_t begin = 0;
    for (size_t end = text.find('\n'); end != std::string::npos; end = text.find('\n', begin)) {
        lines.push_back(text.substr(begin, end - begin));
        begin = end + 1;
    }
    EXPECT_EQ(begin, text.size());
    return lines;
}

// The status of each file of a log, by the name of its input.
std::multimap<std::string, std::string> statusesIn(const fs::path &log)
{
    std::multimap<std::string, std::string> statuses;
    for (const std::string &line : linesOf(readText(log))) {
        const JsonTree json(line);
        EXPECT_TRUE(json.root()["output"].string() && json.root()["message"].string()) << line;
        EXPECT_TRUE(json.root()["bytes"].integer() && json.root()["milliseconds"].integer()) << line;
        EXPECT_EQ(json.root()["time"].string().value_or("").size(), std::strlen("2026-11-28T09:32:54.123Z")) << line;
        statuses.emplace(fs::path(json.root()["input"].string().value_or("")).filename().string(),
                         json.root()["status"].string().value_or(""));
    }
    return statuses;
}

using Statuses = std::multimap<std::string, std::string>;

// Models with alpha in the folder "in".
void writeCards(const TemporaryFolder &folder, std::initializer_list<const char *> names)
{
    fs::create_directories(folder / "in");
    for (const char *name : names)
        writeFile(folder / "in" / name, cardGlb());
}

} // namespace

TEST(BakeJob, TakesAList)
{
    const TemporaryFolder folder;
    for (const char *name : {"a.glb", "b.glb", "c.glb", "d.glb"})
        writeFile(folder / name, cardGlb());
    const auto path = [&](const char *name) { return (folder / name).string(); };
    // A byte order mark, CR LF, empty lines, an output, a folder, no end of the last line.
    const std::string list = "\xef\xbb\xbf" + path("a.glb") + "\t" + path("out/one.glb") + "\r\n\r\n\n" +
                             path("b.glb") + "\t" + path("sub/") + "\n" + path("c.glb") + "\t\n" + path("d.glb");
    writeText(folder / "list", list);
    const Outcome outcome = runVellum({"bake", "--files", path("list")});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    for (const char *name : {"out/one.glb", "sub/b.glb", "c.omm.glb", "d.omm.glb"})
        EXPECT_TRUE(fs::exists(folder / name)) << name;
    EXPECT_EQ(runVellum({"bake", "--files", "-", "-o", path("all")}, {}, folder / "list").exitCode, 0);
    EXPECT_TRUE(fs::exists(folder / "all/c.glb"));
    EXPECT_TRUE(fs::exists(folder / "all/d.glb"));
    EXPECT_FALSE(fs::exists(folder / "all/a.glb"));
    EXPECT_EQ(runVellum({"bake", "--files", path("list"), "-o", path("a.glb")}).exitCode, 2);
    EXPECT_EQ(runVellum({"bake", "--files", path("missing")}).exitCode, 1);
}

TEST(BakeJob, NamesTheBadLineOfAList)
{
    const TemporaryFolder folder;
    writeFile(folder / "a.glb", cardGlb());
    const std::string a = (folder / "a.glb").string();
    const std::string out = (folder / "out.glb").string();
    const std::string zero("x\0y", 3);
    const std::map<std::string, std::string> cases = {
        {a + "\t" + out + "\tmore", "more than one tab"},
        {"\t" + out, "no input"},
        {zero, "zero byte"},
        {"-", "standard streams"},
        {a + "\t-", "standard streams"},
        {folder.path().string(), "is a folder"},
        {a + "\t" + (folder / "out.png").string(), "must end in"},
    };
    for (const auto &[line, text] : cases) {
        writeText(folder / "list", a + "\t" + out + "\n\n" + line + "\n");
        const Outcome outcome = runVellum({"bake", "--files", (folder / "list").string()});
        EXPECT_EQ(outcome.exitCode, 2) << line;
        EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
        EXPECT_NE(outcome.errors.find("list: line 3: "), std::string::npos) << outcome.errors;
        EXPECT_NE(outcome.errors.find(text), std::string::npos) << outcome.errors;
        EXPECT_FALSE(fs::exists(out));
    }
    writeText(folder / "list", a + "\t" + out + "\n" + a + "\t" + out + "\n");
    const Outcome twice = runVellum({"bake", "--files", (folder / "list").string()});
    EXPECT_EQ(twice.exitCode, 2);
    EXPECT_NE(twice.errors.find("would both be written to"), std::string::npos) << twice.errors;
    writeText(folder / "list", "\r\n\n");
    EXPECT_EQ(runVellum({"bake", "--files", (folder / "list").string()}).exitCode, 1);
}

// Each file is in one shard. Which, depends neither on the order and the sizes of the files nor on what else is in the
// list.
TEST(BakeJob, ShardsDivideTheFiles)
{
    const TemporaryFolder folder;
    constexpr size_t kFiles = 24;
    const fs::path out = folder / "out";
    std::string list;
    std::string reversed;
    for (size_t i = 0; i < kFiles; ++i) {
        const std::string path = (folder / ("f" + std::to_string(i) + ".glb")).string();
        writeFile(path, cardGlb({kOpaqueMaterial}));
        list += path + "\n";
        reversed.insert(0, path + "\n");
    }
    writeFile(folder / "more.glb", cardGlb({kOpaqueMaterial}));
    writeText(folder / "list", list);
    writeText(folder / "changed", reversed + (folder / "more.glb").string() + "\n");
    std::set<std::string> seen;
    for (const char *shard : {"3/3", "1/3", "2/3"}) {
        std::set<std::string> files[2];
        for (const size_t run : {size_t{0}, size_t{1}}) {
            // Bytes after the chunks belong to no chunk.
            Bytes larger = cardGlb({kOpaqueMaterial});
            larger.resize(larger.size() + run * 100'000);
            writeFile(folder / "f3.glb", larger);
            const Outcome outcome = runVellum({"bake", "--files", (folder / (run == 0 ? "list" : "changed")).string(),
                                               "-o", out.string(), "--shard", shard, "--copy"});
            EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
            for (const fs::directory_entry &entry : fs::directory_iterator(out))
                files[run].insert(entry.path().filename().string());
            files[run].erase("more.glb");
            fs::remove_all(out);
        }
        EXPECT_EQ(files[0], files[1]);
        for (const std::string &file : files[0])
            EXPECT_TRUE(seen.insert(file).second) << file;
    }
    EXPECT_EQ(seen.size(), kFiles);
    writeText(folder / "one", (folder / "more.glb").string());
    size_t without = 0;
    for (const char *shard : {"1/2", "2/2"}) {
        const Outcome outcome =
            runVellum({"bake", "--files", (folder / "one").string(), "-o", out.string(), "--shard", shard, "--copy"});
        EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
        without += outcome.output.find("no file is in this shard") == std::string::npos ? 0u : 1u;
    }
    EXPECT_EQ(without, 1u);
}

// By fixed names: which files are in a part depends on the folder of the outputs.
TEST(BakeJob, ShardsAreAboutEqual)
{
    constexpr uint32_t kShards = 7;
    std::array<uint32_t, kShards> counts = {};
    for (uint32_t i = 0; i < 7'000; ++i) {
        for (uint32_t shard = 0; shard < kShards; ++shard)
            counts[shard] += job::isInShard("out/set" + std::to_string(i % 10) + "/" + std::to_string(i) + ".glb",
                                            {shard + 1, kShards});
    }
    EXPECT_EQ(std::accumulate(counts.begin(), counts.end(), 0u), 7'000u);
    for (const uint32_t count : counts)
        EXPECT_NEAR(count, 1'000, 100);
}

// An input that is repaired after one shard has ended, and so has another size, is in its shard still.
TEST(BakeJob, ARepairedFileStaysInItsShard)
{
    const TemporaryFolder folder;
    std::string list;
    size_t bytes = 100'000;
    for (const char *name : {"a.glb", "b.glb", "c.glb"}) {
        Bytes glb = cardGlb();
        glb.resize(bytes);
        bytes -= bytes == 100'000 ? 40'000 : 10'000;
        writeFile(folder / name, *name == 'c' ? Bytes(bytes, 'x') : glb);
        list += (folder / name).string() + "\n";
    }
    writeText(folder / "list", list);
    const auto bake = [&](const std::string &shard) {
        const std::string log = (folder / ("log" + shard.substr(0, 1))).string();
        return runVellum({"bake", "--files", (folder / "list").string(), "-o", (folder / "out").string(), "--shard",
                          shard, "--log", log, "--resume", log});
    };
    const bool failed[2] = {bake("1/2").exitCode == 1, bake("2/2").exitCode == 1};
    EXPECT_NE(failed[0], failed[1]);
    Bytes repaired = cardGlb();
    repaired.resize(130'000);
    writeFile(folder / "c.glb", repaired);
    const Outcome again = bake(failed[0] ? "1/2" : "2/2");
    EXPECT_EQ(again.exitCode, 0) << again.errors;
    for (const char *name : {"a.glb", "b.glb", "c.glb"})
        EXPECT_TRUE(fs::exists(folder / "out" / name)) << name;
}

TEST(BakeJob, OneFileHasNoShards)
{
    const TemporaryFolder folder;
    writeFile(folder / "a.glb", cardGlb());
    const std::string a = (folder / "a.glb").string();
    for (const std::vector<std::string> &files : {std::vector<std::string>{a}, {"-", "-"}, {a, "-"}}) {
        std::vector<std::string> bake = {"bake", "--shard", "2/2"};
        bake.insert(bake.end(), files.begin(), files.end());
        const Outcome outcome = runVellum(bake, {}, a);
        EXPECT_EQ(outcome.exitCode, 2) << outcome.errors;
        EXPECT_EQ(outcome.output, "");
    }
}

// Their names in a log would be those of other files.
TEST(BakeJob, StandardStreamsHaveNoLog)
{
    const TemporaryFolder folder;
    const std::string a = (folder / "a.glb").string();
    writeFile(a, cardGlb());
    for (const std::vector<std::string> &files : {std::vector<std::string>{"-"}, {a, "-"}, {"-", a + ".glb"}}) {
        for (const char *option : {"--log", "--resume"}) {
            std::vector<std::string> bake = {"bake", option, (folder / "log").string()};
            bake.insert(bake.end(), files.begin(), files.end());
            const Outcome outcome = runVellum(bake, {}, a);
            EXPECT_EQ(outcome.exitCode, 2) << outcome.errors;
            EXPECT_EQ(outcome.output, "");
        }
    }
}

TEST(BakeJob, TheLogTellsCopiesFromFilesThatLostTheirMicromaps)
{
    const TemporaryFolder folder;
    writeFile(folder / "card.glb", cardGlb());
    ASSERT_EQ(runVellum({"bake", (folder / "card.glb").string(), (folder / "a.glb").string()}).exitCode, 0);
    writeFile(folder / "b.glb", cardGlb({kOpaqueMaterial}));
    const std::string log = (folder / "log").string();
    EXPECT_EQ(runVellum({"bake", (folder / "a.glb").string(), (folder / "b.glb").string(), "-o",
                         (folder / "out").string() + "/", "--copy", "--exclude-material", "leaf", "--log", log})
                  .exitCode,
              0);
    EXPECT_EQ(statusesIn(log), (Statuses{{"a.glb", "removed"}, {"b.glb", "unchanged"}}));
}

TEST(BakeJob, LogsAndResumes)
{
    const TemporaryFolder folder;
    fs::create_directories(folder / "in");
    writeFile(folder / "in/a.glb", cardGlb());
    writeFile(folder / "in/b.glb", cardGlb({kOpaqueMaterial}));
    writeFile(folder / "in/c.glb", Bytes{'x'});
    writeFile(folder / "in/d.glb", cardGlb());
    const std::string log = (folder / "log.jsonl").string();
    const std::string second = log + ".2";
    const std::vector<std::string> bake = {
        "bake", (folder / "in").string(), "-o", (folder / "out").string(), "--log", log, "--resume", log, "-j", "2"};
    EXPECT_EQ(runVellum(bake).exitCode, 1);
    EXPECT_EQ(statusesIn(log),
              (Statuses{{"a.glb", "baked"}, {"b.glb", "unchanged"}, {"c.glb", "failed"}, {"d.glb", "baked"}}));
    // Only what failed, and what was written and is no longer there. What was done before gets no line.
    EXPECT_FALSE(fs::exists(folder / "out/b.glb"));
    fs::remove(folder / "out/d.glb");
    writeFile(folder / "in/c.glb", cardGlb());
    std::vector<std::string> toSecond = bake;
    toSecond[5] = second;
    const Outcome resumed = runVellum(toSecond);
    EXPECT_EQ(resumed.exitCode, 0) << resumed.errors;
    EXPECT_NE(resumed.output.find("2 files were done before\n"), std::string::npos) << resumed.output;
    EXPECT_EQ(statusesIn(second), (Statuses{{"c.glb", "baked"}, {"d.glb", "baked"}}));
    // Merged by cat in any order, with lines that are cut off, one of them in front of another log, and one nested.
    const std::string first = readText(log);
    const std::string nested = first.substr(0, first.find("\"bytes\"")) + "\"bytes\":" + std::string(1'000'000, '[') +
                               std::string(1'000'000, ']') + "}\n";
    for (const bool newestLast : {true, false}) {
        writeText(log, (newestLast ? first : readText(second)) + R"({"input":"x)" +
                           (newestLast ? readText(second) : first) + nested + std::string(100000, '[') +
                           "\n{\"input\":\"" + std::string(9, '{'));
        for (int run = 0; run < 2; ++run) {
            const Outcome merged = runVellum(bake);
            EXPECT_EQ(merged.exitCode, 0) << merged.errors;
            EXPECT_NE(merged.output.find("4 files were done before\n"), std::string::npos) << merged.output;
        }
    }
    std::vector<std::string> asJson = bake;
    asJson.insert(asJson.end(), {"--json", "--shard", "1/1"});
    const Outcome reported = runVellum(asJson);
    EXPECT_EQ(JsonTree(reported.output).root()["done"].integer(), 4) << reported.output;
    // An input of another size is another one.
    writeFile(folder / "in/a.glb", cardGlb({{"\"leaf\"", "\"leaves of another name\""}}));
    const Outcome changed = runVellum(bake);
    EXPECT_EQ(changed.exitCode, 0) << changed.errors;
    EXPECT_NE(changed.output.find("3 files were done before\n"), std::string::npos) << changed.output;
    // The next line does not go on in one that is cut off.
    fs::remove(folder / "out/d.glb");
    EXPECT_EQ(runVellum(bake).exitCode, 0);
    EXPECT_NE(readText(log).find("{{{\n{\"input\""), std::string::npos);
}

// They belong to no chunk, and to the size of the file.
TEST(BakeJob, BytesAfterAGlbCount)
{
    const TemporaryFolder folder;
    Bytes glb = cardGlb();
    glb.push_back('x');
    writeFile(folder / "a.glb", glb);
    const std::string log = (folder / "log").string();
    const std::vector<std::string> bake = {"bake",  (folder / "a.glb").string(), "--log", log, "--resume", log,
                                           "--json"};
    const Outcome first = runVellum(bake);
    EXPECT_TRUE(has(first.output, "\"bytes\": " + std::to_string(glb.size()) + ",")) << first.output;
    const Outcome second = runVellum(bake);
    EXPECT_EQ(JsonTree(second.output).root()["done"].integer(), 1) << second.output;
}

// Whatever is left of the first line.
TEST(BakeJob, ALogMayBeginWithALineThatIsCutOff)
{
    const TemporaryFolder folder;
    writeFile(folder / "a.glb", cardGlb());
    const std::string log = (folder / "log").string();
    const std::vector<std::string> bake = {"bake", (folder / "a.glb").string(), "--log", log, "--resume", log};
    for (const char *rest : {"", "{", "{\"inp", "{\"input\":\"", "{\"input\":\"x"}) {
        writeText(log, rest);
        fs::remove(folder / "a.omm.glb");
        for (int run = 0; run < 3; ++run) {
            const Outcome outcome = runVellum(bake);
            EXPECT_EQ(outcome.exitCode, 0) << rest << outcome.errors;
            EXPECT_EQ(outcome.output.find("1 file was done before") != std::string::npos, run > 0) << outcome.output;
        }
    }
}

// Names are locations: not of the working directory, and whatever bytes they have.
TEST(BakeJob, ALogNamesLocations)
{
    const TemporaryFolder folder;
    for (const char *name : {"one", "two"}) {
        fs::create_directories(folder / name);
        writeFile(folder / name / "a.glb", cardGlb());
    }
    const std::string log = (folder / "log").string();
    const fs::path before = fs::current_path();
    const auto bakeIn = [&](const char *name, const std::string &input) {
        fs::current_path(folder / name);
        const Outcome outcome = runVellum({"bake", input, "--log", log, "--resume", log});
        fs::current_path(before);
        EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
        return outcome;
    };
    const std::string done = "1 file was done before\n";
    const std::string none = "name none of these files";
    EXPECT_EQ(bakeIn("one", "a.glb").errors, "");
    const Outcome other = bakeIn("two", "a.glb");
    EXPECT_EQ(other.output.find(done), std::string::npos) << other.output;
    EXPECT_NE(other.errors.find(none), std::string::npos) << other.errors;
    EXPECT_TRUE(fs::exists(folder / "two/a.omm.glb"));
    for (const std::string &input : {std::string("./a.glb"), (folder / "one/../one/a.glb").string()})
        EXPECT_NE(bakeIn("one", input).output.find(done), std::string::npos) << input;
#ifndef _WIN32
    for (const char *name : {"\xff.glb", "\xfe.glb"})
        writeFile(folder / "one" / name, cardGlb());
    EXPECT_EQ(bakeIn("one", "\xff.glb").output.find(done), std::string::npos);
    EXPECT_EQ(bakeIn("one", "\xfe.glb").output.find(done), std::string::npos);
    EXPECT_NE(bakeIn("one", "\xff.glb").output.find(done), std::string::npos);
    EXPECT_TRUE(fs::exists(folder / "one" / "\xfe.omm.glb"));
#endif
}

// All files of an output are there, with the sizes that they had.
TEST(BakeJob, ResumingNeedsAllFilesOfAnOutput)
{
    const TemporaryFolder folder;
    fs::create_directories(folder / "in");
    writeCardGltf(folder / "in/tree.gltf");
    const std::string log = (folder / "log").string();
    const std::vector<std::string> bake = {
        "bake", (folder / "in").string(), "-o", (folder / "out").string(), "--log", log, "--resume", log};
    EXPECT_EQ(runVellum(bake).exitCode, 0);
    std::set<fs::path> files;
    for (const fs::directory_entry &entry : fs::directory_iterator(folder / "out"))
        files.insert(entry.path());
    EXPECT_EQ(files.size(), 4u); // the .gltf, its micromaps, and copies of its buffer and its image
    for (const fs::path &file : files) {
        EXPECT_NE(runVellum(bake).output.find("1 file was done before\n"), std::string::npos);
        const Bytes bytes = readFile(file);
        fs::remove(file);
        const Outcome again = runVellum(bake);
        EXPECT_EQ(again.exitCode, 0) << again.errors;
        EXPECT_EQ(again.output.find("done before"), std::string::npos) << file;
        EXPECT_EQ(readFile(file), bytes);
    }
    Bytes cut = readFile(folder / "out/tree.gltf");
    cut.pop_back();
    writeFile(folder / "out/tree.gltf", cut);
    EXPECT_EQ(runVellum({"bake", (folder / "in").string(), "-o", (folder / "out").string(), "--resume", log, "--force"})
                  .output.find("done before"),
              std::string::npos);
}

TEST(BakeJob, WhatWasDoneWithOtherOptionsIsBakedAgain)
{
    const TemporaryFolder folder;
    writeCards(folder, {"a.glb", "b.glb"});
    const std::string log = (folder / "log").string();
    const auto bake = [&](std::vector<std::string> options) {
        options.insert(options.begin(), {"bake", (folder / "in").string(), "-o", (folder / "out").string(), "--log",
                                         log, "--resume", log});
        return runVellum(options);
    };
    EXPECT_EQ(bake({"--level", "5"}).exitCode, 0);
    // What does not matter to outputs, and a value that is the default.
    for (const std::vector<std::string> &same :
         {std::vector<std::string>{"-j", "1"}, {"--report"}, {"--value-tolerance", "0.00784313725490196"}}) {
        std::vector<std::string> options = {"--level", "5"};
        options.insert(options.end(), same.begin(), same.end());
        EXPECT_NE(bake(options).output.find("2 files were done before\n"), std::string::npos) << same.front();
    }
    size_t before = linesOf(readText(log)).size();
    for (const std::vector<std::string> &other : {std::vector<std::string>{"--level", "2"},
                                                  {"--level", "5", "--states", "2"},
                                                  {"--level", "5", "--blend"},
                                                  {"--level", "5", "--exclude-mesh", "x"},
                                                  {"--level", "5", "--min-known", "0.1"},
                                                  {"--level", "5", "--copy"}}) {
        const Outcome outcome = bake(other);
        EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
        EXPECT_EQ(outcome.output.find("done before"), std::string::npos) << outcome.output;
        EXPECT_NE(outcome.errors.find("vellum: 2 files were done before with other options or another version, and are "
                                      "baked again\n"),
                  std::string::npos)
            << other.back() << outcome.errors;
        EXPECT_EQ(linesOf(readText(log)).size(), before += 2);
    }
}

TEST(BakeJob, AFileWithoutTheRequiredMicromapsHasFailed)
{
    const TemporaryFolder folder;
    writeFile(folder / "a.glb", cardGlb({kOpaqueMaterial}));
    const std::string log = (folder / "log").string();
    for (int run = 0; run < 2; ++run)
        EXPECT_EQ(runVellum({"bake", (folder / "a.glb").string(), "--require-micromaps", "--log", log, "--resume", log})
                      .exitCode,
                  7);
    EXPECT_EQ(statusesIn(log), (Statuses{{"a.glb", "failed"}, {"a.glb", "failed"}}));
    EXPECT_NE(readText(log).find("no primitive gets a micromap"), std::string::npos);
}

// Whether the files are there yet does not matter.
TEST(BakeJob, AnOutputIsNoInputOfAnother)
{
    const TemporaryFolder folder;
    writeFile(folder / "a.glb", cardGlb());
    const auto path = [&](const char *name) { return (folder / name).string(); };
    writeText(folder / "list", path("a.glb") + "\t" + path("b.glb") + "\n" + path("b.glb") + "\t" + path("c.glb"));
    const Outcome outcome = runVellum({"bake", "--files", path("list"), "-j", "1"});
    EXPECT_EQ(outcome.exitCode, 1);
    EXPECT_NE(outcome.errors.find("a.glb: the output " + path("b.glb") + " is read for " + path("b.glb")),
              std::string::npos)
        << outcome.errors;
    EXPECT_FALSE(fs::exists(folder / "b.glb"));
    EXPECT_FALSE(fs::exists(folder / "c.glb"));
}

TEST(BakeJob, ALogIsNeverAnotherFile)
{
    const TemporaryFolder folder;
    writeFile(folder / "a.glb", cardGlb());
    writeText(folder / "notes.txt", "notes\n");
    const std::string a = (folder / "a.glb").string();
    for (const fs::path &log : {folder / "notes.txt", folder.path(), folder / "none/log"}) {
        const Outcome outcome = runVellum({"bake", a, "--log", log.string()});
        EXPECT_EQ(outcome.exitCode, 1) << log;
        EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
        EXPECT_FALSE(fs::exists(folder / "a.omm.glb"));
    }
    EXPECT_EQ(readText(folder / "notes.txt"), "notes\n");
    for (const char *log : {"missing", "notes.txt", "a.glb"})
        EXPECT_EQ(runVellum({"bake", a, "--resume", (folder / log).string()}).exitCode, 1) << log;
    EXPECT_FALSE(fs::exists(folder / "a.omm.glb"));
}

#ifndef _WIN32
TEST(BakeJob, StopsWhereNothingCanBeWritten)
{
    for (const auto &[variable, error] :
         {std::pair{"VELLUM_WRITE_ERROR", ENOSPC}, {"VELLUM_WRITE_ERROR", EROFS}, {"VELLUM_ACCESS_ERROR", EACCES}}) {
        const TemporaryFolder folder;
        writeCards(folder, {"a.glb", "b.glb", "c.glb"});
        const Outcome outcome = runVellum(
            {"bake", (folder / "in").string(), "-o", (folder / "out").string(), "-j", "1", "--level", "8", "--log",
             (folder / "log").string()},
            {{"LD_PRELOAD", VELLUM_STOPPED_CALL}, {"VELLUM_STOPPED_CALL", "-1"}, {variable, std::to_string(error)}});
        EXPECT_EQ(outcome.exitCode, 1);
        EXPECT_EQ(outcome.errorLines(), 4) << outcome.errors;
        EXPECT_NE(outcome.errors.find("c.glb: not baked: "), std::string::npos) << outcome.errors;
        EXPECT_NE(outcome.errors.find("vellum: stopped: "), std::string::npos) << outcome.errors;
        EXPECT_NE(outcome.errors.find(std::string(std::strerror(error)) + ": 0 of 3 files were baked\n"),
                  std::string::npos)
            << outcome.errors;
        EXPECT_FALSE(fs::exists(folder / "out"));
        const Statuses statuses = statusesIn(folder / "log"); // of the file that found it
        EXPECT_EQ(statuses, error == EACCES ? Statuses{} : (Statuses{{"a.glb", "failed"}}));
    }
}

// A file that is too large for the disk does not stop those that fit, and a quota is one of a folder.
TEST(BakeJob, BakesWhatFits)
{
    const TemporaryFolder folder;
    const auto largeGlb = [](size_t bytes) {
        return cardGlb({{"\"asset\": {", "\"asset\": {" + std::string(bytes, ' ')}});
    };
    writeFile(folder / "large.glb", largeGlb(600'000));
    std::string list = (folder / "large.glb").string() + "\n";
    for (const char *name : {"a.glb", "b.glb", "c.glb"}) {
        writeFile(folder / name, cardGlb());
        list += (folder / name).string() + "\n";
    }
    writeText(folder / "list", list);
    const std::vector<std::pair<std::string, std::string>> full = {{"LD_PRELOAD", VELLUM_STOPPED_CALL},
                                                                   {"VELLUM_STOPPED_CALL", "-1"},
                                                                   {"VELLUM_WRITE_ERROR", std::to_string(ENOSPC)},
                                                                   {"VELLUM_WRITE_MOST", "100000"}};
    const Outcome outcome = runVellum({"bake", "--files", (folder / "list").string(), "-j", "1"}, full);
    EXPECT_EQ(outcome.exitCode, 1);
    EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
    for (const char *name : {"a.omm.glb", "b.omm.glb", "c.omm.glb"})
        EXPECT_TRUE(fs::exists(folder / name)) << name;
    // Those that cannot fit are not baked: they are as large, or larger than what is free.
    for (const char *free : {"1000000000", "500000"}) {
        writeFile(folder / "other.glb", largeGlb(*free == '1' ? 600'000 : 599'000));
        writeText(folder / "list", (folder / "large.glb").string() + "\n" + (folder / "other.glb").string());
        std::vector<std::pair<std::string, std::string>> known = full;
        known.emplace_back("VELLUM_FREE_BYTES", free);
        const Outcome both = runVellum({"bake", "--files", (folder / "list").string(), "-j", "1"}, known);
        EXPECT_NE(both.errors.find("other.glb: not baked: "), std::string::npos) << both.errors;
    }
    fs::create_directories(folder / "sub");
    writeText(folder / "list", (folder / "a.glb").string() + "\t" + (folder / "a2.glb").string() + "\n" +
                                   (folder / "b.glb").string() + "\t" + (folder / "b2.glb").string() + "\n" +
                                   (folder / "c.glb").string() + "\t" + (folder / "sub/c.glb").string());
    const Outcome quota =
        runVellum({"bake", "--files", (folder / "list").string(), "-j", "1", "--log", (folder / "log").string()},
                  {full[0], full[1], {"VELLUM_WRITE_ERROR", std::to_string(EDQUOT)}});
    EXPECT_EQ(quota.exitCode, 1);
    EXPECT_EQ(statusesIn(folder / "log"), (Statuses{{"a.glb", "failed"}, {"c.glb", "failed"}})) << quota.errors;
}

TEST(BakeJob, AnInterruptedBakeHasLoggedWhatIsDone)
{
    const TemporaryFolder folder;
    writeCards(folder, {"a.glb", "b.glb"});
    const std::string log = (folder / "log").string();
    const std::vector<std::string> bake = {
        "bake", (folder / "in").string(), "-o", (folder / "out").string(), "-j", "1", "--log", log, "--resume", log};
    // Calls of the first file, and the line of the log; then one of the second file.
    int call = 0;
    while (interruptVellumAtCall(bake, SIGTERM, call, VELLUM_STOPPED_CALL) && !fs::exists(folder / "out/a.glb"))
        ++call;
    EXPECT_EQ(statusesIn(log), (Statuses{{"a.glb", "baked"}}));
    EXPECT_EQ(runVellum(bake).exitCode, 0);
    EXPECT_EQ(statusesIn(log), (Statuses{{"a.glb", "baked"}, {"b.glb", "baked"}}));
}
#endif

TEST(BakeJob, PlanningReadsTheJsonOnly)
{
    const TemporaryFolder folder;
    const Bytes glb = cardGlb();
    writeFile(folder / "whole.glb", glb);
    const Container whole = findContainer(glb);
    const Container json = readJson(folder / "whole.glb");
    EXPECT_EQ(json.json(), whole.json());
    EXPECT_EQ(json.bytes.size(), whole.jsonOffset + whole.jsonSize);
    Bytes cut = glb;
    cut.pop_back();
    Bytes wrong = glb;
    std::memset(wrong.data() + 12, 0xff, 4);
    for (const Bytes &bytes : {cut, wrong, Bytes{}, Bytes{'g', 'l', 'T', 'F'}}) {
        writeFile(folder / "bad.glb", bytes);
        EXPECT_THROW(readJson(folder / "bad.glb"), GltfError);
    }
    // So an earlier output is known as such by its JSON, whatever is behind it.
    const std::vector<std::string> bake = {"bake", (folder / "whole.glb").string()};
    EXPECT_EQ(runVellum(bake).exitCode, 0);
    const Bytes baked = readFile(folder / "whole.omm.glb");
    Bytes damaged = baked;
    const Container output = findContainer(baked);
    std::memset(damaged.data() + output.jsonOffset + output.jsonSize, 0xff, 4);
    writeFile(folder / "whole.omm.glb", damaged);
    EXPECT_EQ(runVellum(bake).exitCode, 0);
    EXPECT_EQ(readFile(folder / "whole.omm.glb"), baked);
    writeCardGltf(folder / "tree.gltf");
    EXPECT_TRUE(JsonTree(readJson(folder / "tree.gltf").json()).root()["meshes"].exists());
}
