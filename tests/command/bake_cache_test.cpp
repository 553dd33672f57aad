// SPDX-License-Identifier: Apache-2.0
// `vellum bake --cache`: hits, misses, damage, many processes, and folders that cannot be used.
#include <algorithm>
#include <cerrno>
#include <csignal>
#include <gtest/gtest.h>
#include <string_view>
#include <thread>

#include "command.h"
#include "glb_file.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

namespace fs = std::filesystem;

// The card with a cutoff of its own.
Bytes cardWith(int cutoff)
{
    return cardGlb({{"\"alphaCutoff\": 0.25", "\"alphaCutoff\": 0.25" + std::to_string(1000 + cutoff)}});
}

// A folder with a card, a cache, and outputs.
struct Cached {
    TemporaryFolder folder;
    std::string cache = (folder / "cache").string();

    Cached() { writeFile(folder / "card.glb", cardGlb()); }

    Outcome bake(const std::string &input, const std::vector<std::string> &more = {})
    {
        std::vector<std::string> words = {"bake", (folder / input).string(), (folder / "out.glb").string(), "--cache",
                                          cache};
        words.insert(words.end(), more.begin(), more.end());
        return runVellum(words);
    }
    // The file that is written without a cache.
    Bytes plain(const std::string &input, const std::vector<std::string> &more = {})
    {
        std::vector<std::string> words = {"bake", (folder / input).string(), (folder / "plain.glb").string(), "--cache",
                                          ""};
        words.insert(words.end(), more.begin(), more.end());
        EXPECT_EQ(runVellum(words).exitCode, 0);
        return readFile(folder / "plain.glb");
    }
    void expect(const std::string &counts, const std::vector<std::string> &more = {},
                const std::string &input = "card.glb")
    {
        const Outcome outcome = bake(input, more);
        EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
        EXPECT_EQ(outcome.errors, "");
        EXPECT_NE(outcome.output.find("; cache: " + counts + "\n"), std::string::npos) << outcome.output;
        EXPECT_EQ(readFile(folder / "out.glb"), plain(input, more));
    }
    [[nodiscard]] std::vector<fs::path> entries() const
    {
        std::vector<fs::path> files;
        for (const fs::directory_entry &entry : fs::recursive_directory_iterator(cache))
            if (entry.is_regular_file())
                files.push_back(entry.path());
        return files;
    }
};

} // namespace

TEST(BakeCache, HitsAndMisses)
{
    Cached cached;
    cached.expect("0 hits, 1 miss");
    cached.expect("1 hit, 0 misses");
    cached.expect("0 hits, 1 miss", {"--level", "5"});
    cached.expect("1 hit, 0 misses", {"--level", "5", "--max-level", "6", "-j", "1"});
    cached.expect("0 hits, 1 miss", {"--budget", "60"});
    cached.expect("1 hit, 0 misses", {"--budget", "60"});
    // A file of another kind with the same texture and mesh.
    writeCardGltf(cached.folder / "sub/card.gltf");
    const Outcome outcome =
        runVellum({"bake", (cached.folder / "sub/card.gltf").string(), "--json"}, {{"VELLUM_CACHE", cached.cache}});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_NE(outcome.output.find("\"hits\": 1,"), std::string::npos) << outcome.output;
    // None by an empty name, whatever the environment has.
    const Outcome none =
        runVellum({"bake", (cached.folder / "card.glb").string(), "--cache", ""}, {{"VELLUM_CACHE", cached.cache}});
    EXPECT_EQ(none.output.find("cache"), std::string::npos) << none.output;
    // A dry run looks, and keeps nothing.
    const size_t count = cached.entries().size();
    EXPECT_EQ(cached.bake("card.glb", {"--level", "2", "--dry-run"}).exitCode, 0);
    EXPECT_EQ(cached.entries().size(), count);
    EXPECT_EQ(cached.bake("card.glb", {"--cache-size", "1000"}).exitCode, 2);
    EXPECT_EQ(cached.bake("card.glb", {"--cache-size", "much"}).exitCode, 2);
}

TEST(BakeCache, DamagedEntriesAreReplaced)
{
    Cached cached;
    cached.expect("0 hits, 1 miss");
    const std::vector<fs::path> entries = cached.entries();
    ASSERT_EQ(entries.size(), 1u);
    const Bytes whole = readFile(entries[0]);
    Bytes wrong = whole;
    wrong[wrong.size() / 2] ^= 1;
    Bytes longer = whole;
    longer.push_back(0);
    for (const Bytes &damaged : {wrong, longer, Bytes(whole.begin(), whole.end() - 1), Bytes{}}) {
        writeFile(entries[0], damaged);
        cached.expect("0 hits, 1 miss");
        EXPECT_EQ(readFile(entries[0]), whole);
    }
    cached.expect("1 hit, 0 misses");
}

TEST(BakeCache, FourProcessesShareOne)
{
    Cached cached;
    fs::create_directories(cached.folder / "in");
    for (int i = 0; i < 20; ++i)
        writeFile(cached.folder / ("in/" + std::to_string(i) + ".glb"), cardWith(i));
    const auto path = [&](const std::string &name) { return (cached.folder / name).string(); };
    ASSERT_EQ(runVellum({"bake", path("in"), "-o", path("plain")}).exitCode, 0);
    {
        std::vector<std::jthread> processes;
        for (const char *out : {"out0", "out1", "out2", "out3"})
            processes.emplace_back([&, out] {
                const Outcome outcome = runVellum({"bake", path("in"), "-o", path(out), "--cache", cached.cache});
                EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
                EXPECT_EQ(outcome.errors, "");
            });
    }
    for (const fs::directory_entry &file : fs::directory_iterator(cached.folder / "plain"))
        for (const char *out : {"out0/", "out1/", "out2/", "out3/"})
            EXPECT_EQ(readFile(cached.folder / (out + file.path().filename().string())), readFile(file.path()));
    EXPECT_EQ(cached.entries().size(), 20u);
}

// The least size: 4 entries in each of 64 folders.
TEST(BakeCache, TakesNoMoreThanItsSize)
{
    Cached cached;
    fs::create_directories(cached.folder / "in");
    for (int i = 0; i < 320; ++i)
        writeFile(cached.folder / ("in/" + std::to_string(i) + ".glb"), cardWith(i));
    const Outcome outcome = runVellum({"bake", (cached.folder / "in").string(), "-o", (cached.folder / "out").string(),
                                       "--cache", cached.cache, "--cache-size", "1M", "--quiet"});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_EQ(outcome.errors, "");
    EXPECT_GT(cached.entries().size(), 150u);
    EXPECT_LE(cached.entries().size(), 256u);
}

TEST(BakeCache, AFolderThatCannotBeUsedIsOneWarning)
{
    Cached cached;
    writeFile(cached.folder / "file", {1});
    cached.cache = (cached.folder / "file").string();
    const Outcome outcome = cached.bake("card.glb");
    EXPECT_EQ(outcome.exitCode, 0);
    EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
    EXPECT_NE(outcome.errors.find("vellum: warning: the cache"), std::string::npos) << outcome.errors;
    EXPECT_EQ(readFile(cached.folder / "out.glb"), cached.plain("card.glb"));
}

#ifndef _WIN32
TEST(BakeCache, AFullOrReadOnlyDiskIsOneWarning)
{
    for (const int error : {ENOSPC, EROFS}) {
        Cached cached;
        fs::create_directories(cached.folder / "in");
        // To stdout, so that the cache is what cannot be written.
        const Outcome outcome =
            runVellum({"bake", (cached.folder / "card.glb").string(), "-", "--level", "8", "--cache", cached.cache},
                      {{"LD_PRELOAD", VELLUM_STOPPED_CALL},
                       {"VELLUM_STOPPED_CALL", "-1"},
                       {"VELLUM_WRITE_ERROR", std::to_string(error)}});
        EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
        EXPECT_NE(outcome.errors.find("warning: the cache cannot be used"), std::string::npos) << outcome.errors;
        const Bytes plain = cached.plain("card.glb", {"--level", "8"});
        EXPECT_EQ(outcome.output, std::string(plain.begin(), plain.end()));
        EXPECT_TRUE(cached.entries().empty());
    }
}

// A file server may report that only when all bytes are sent.
TEST(BakeCache, ADiskThatIsFullInTheEndIsOneWarning)
{
    Cached cached;
    const Outcome outcome = runVellum({"bake", (cached.folder / "card.glb").string(), "-", "--cache", cached.cache},
                                      {{"LD_PRELOAD", VELLUM_STOPPED_CALL},
                                       {"VELLUM_STOPPED_CALL", "-1"},
                                       {"VELLUM_SYNC_ERROR", std::to_string(ENOSPC)}});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_NE(outcome.errors.find("warning: the cache cannot be used"), std::string::npos) << outcome.errors;
    EXPECT_TRUE(cached.entries().empty());
}

// Such as those of other users. What can be removed makes up for them.
TEST(BakeCache, EntriesThatCannotBeRemovedAreOneWarning)
{
    Cached cached;
    for (const char first : {'0', '1', '2', '3'})
        for (const char second : std::string_view("0123456789abcdef")) {
            const fs::path part = fs::path(cached.cache) / "micromaps" / (std::string{first} + second);
            fs::create_directories(part);
            for (const char *name : {"1", "2", "3", "4"})
                writeFile(part / name, {1});
        }
    const Outcome outcome =
        runVellum({"bake", (cached.folder / "card.glb").string(), "-", "--cache", cached.cache, "--cache-size", "1M"},
                  {{"LD_PRELOAD", VELLUM_STOPPED_CALL},
                   {"VELLUM_STOPPED_CALL", "-1"},
                   {"VELLUM_REMOVE_ERROR", std::to_string(EPERM)}});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_NE(outcome.errors.find("cannot be removed: "), std::string::npos) << outcome.errors;
}

// Killed at each call that changes a file.
TEST(BakeCache, AKilledProcessLeavesNothingDamaged)
{
    Cached cached;
    const std::vector<std::string> bake = {"bake", (cached.folder / "card.glb").string(),
                                           (cached.folder / "out.glb").string(), "--cache", cached.cache};
    const Bytes plain = cached.plain("card.glb");
    int call = 0;
    for (; interruptVellumAtCall(bake, SIGKILL, call, VELLUM_STOPPED_CALL); ++call) {
        const bool kept = fs::exists(cached.cache) && !cached.entries().empty();
        cached.expect(kept ? "1 hit, 0 misses" : "0 hits, 1 miss");
        fs::remove_all(cached.cache);
        fs::remove(cached.folder / "out.glb");
    }
    EXPECT_GT(call, 2);
}
#endif
