// `vellum bake` as its user runs it.
#include <algorithm>
#include <csignal>
#include <cstring>
#include <gtest/gtest.h>

#include "command.h"
#include "glb_file.h"
#include "gltf/file/json_tree.h"
#include "gltf/micromaps/stored_micromaps.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

namespace fs = std::filesystem;

std::vector<std::string> entries(const fs::path &folder)
{
    std::vector<std::string> names;
    for (const fs::directory_entry &entry : fs::recursive_directory_iterator(folder))
        names.push_back(entry.path().lexically_relative(folder).string());
    std::sort(names.begin(), names.end());
    return names;
}

std::size_t bakedPrimitives(const fs::path &path)
{
    return readMicromaps(Document(path)).primitives.size();
}

// At level 12 the work of seconds: the disc is repeated until every micro-triangle has an edge of it.
Bytes slowGlb()
{
    return cardGlb(
        {{R"("baseColorTexture": {"index": 0})",
          R"("baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [900, 900]}}})"},
         {R"("magFilter": 9728, "wrapS": 33071, "wrapT": 33648)", R"("magFilter": 9729)"}});
}

} // namespace

TEST(BakeCommand, WritesBesideTheInput)
{
    const TemporaryFolder folder;
    writeFile(folder / "tree.glb", cardGlb());
    const Outcome outcome = runVellum({"bake", (folder / "tree.glb").string()});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_EQ(outcome.errors, "");
    EXPECT_EQ(entries(folder.path()), (std::vector<std::string>{"tree.glb", "tree.omm.glb"}));
    EXPECT_EQ(readFile(folder / "tree.glb"), cardGlb());
    EXPECT_EQ(bakedPrimitives(folder / "tree.omm.glb"), 1u);
}

TEST(BakeCommand, TakesFoldersWithAllThatIsInThem)
{
    const TemporaryFolder folder;
    fs::create_directories(folder / "in/deep/deeper");
    writeFile(folder / "in/a.glb", cardGlb());
    writeFile(folder / "in/deep/deeper/b.GLB", cardGlb());
    writeFile(folder / "in/deep/notes.txt", {'x'});
    writeFile(folder / "c.glb", cardGlb());
    const Outcome outcome = runVellum(
        {"bake", (folder / "in").string(), (folder / "c.glb").string(), "-o", (folder / "out").string(), "-j", "3"});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_EQ(entries(folder / "out"),
              (std::vector<std::string>{"a.glb", "c.glb", "deep", "deep/deeper", "deep/deeper/b.GLB"}));
    EXPECT_EQ(bakedPrimitives(folder / "out/deep/deeper/b.GLB"), 1u);
}

TEST(BakeCommand, OneBadFileDoesNotHoldUpTheOthers)
{
    const TemporaryFolder folder;
    fs::create_directories(folder / "in");
    writeFile(folder / "in/a.glb", cardGlb());
    Bytes cut = cardGlb();
    cut.resize(cut.size() / 2);
    writeFile(folder / "in/b.glb", cut);
    writeFile(folder / "in/c.glb", cardGlb());
    const Outcome outcome = runVellum({"bake", (folder / "in").string(), "-o", (folder / "out").string(), "--json"});
    EXPECT_EQ(outcome.exitCode, 1);
    EXPECT_EQ(outcome.errorLines(), 1);
    EXPECT_NE(outcome.errors.find("b.glb: truncated"), std::string::npos) << outcome.errors;
    EXPECT_EQ(entries(folder / "out"), (std::vector<std::string>{"a.glb", "c.glb"}));
    const JsonTree json(outcome.output);
    const std::vector<JsonValue> files = json.root()["files"].children();
    ASSERT_EQ(files.size(), 3u);
    EXPECT_EQ(files[0]["primitives"].children().at(0)["triangles"].integer(), 2);
    EXPECT_TRUE(files[1]["error"].exists());
    EXPECT_FALSE(files[2]["error"].exists());
}

TEST(BakeCommand, ReportsWhatEachPrimitiveGot)
{
    const TemporaryFolder folder;
    writeFile(folder / "tree.glb", cardGlb({{R"({"attributes": {"POSITION": 3}, "material": 1})",
                                             R"({"attributes": {"POSITION": 3}, "material": 0})"}}));
    const Outcome outcome = runVellum({"bake", (folder / "tree.glb").string(), "--report", "--level", "3"});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_NE(outcome.output.find("mesh 0 primitive 0"), std::string::npos) << outcome.output;
    EXPECT_NE(outcome.output.find("mesh 0 primitive 1 (leaf): it has no texture coordinates (TEXCOORD_0)"),
              std::string::npos)
        << outcome.output;
}

TEST(BakeCommand, TheInputIsNeverWritten)
{
    const TemporaryFolder folder;
    writeFile(folder / "tree.glb", cardGlb());
    fs::create_hard_link(folder / "tree.glb", folder / "same.glb");
    const std::string tree = (folder / "tree.glb").string();
    for (const std::string &output : {tree, (folder / "same.glb").string(), folder.path().string()}) {
        const Outcome outcome = runVellum({"bake", tree, "-o", output});
        EXPECT_EQ(outcome.exitCode, 1);
        EXPECT_EQ(outcome.errorLines(), 1);
        EXPECT_EQ(readFile(tree), cardGlb());
    }
}

TEST(BakeCommand, AsksForWhatIsClear)
{
    const TemporaryFolder folder;
    fs::create_directories(folder / "a");
    fs::create_directories(folder / "b");
    fs::create_directories(folder / "none");
    for (const char *name : {"a/x.glb", "b/x.glb"})
        writeFile(folder / name, cardGlb());
    const std::string a = (folder / "a/x.glb").string();
    const std::string b = (folder / "b/x.glb").string();
    const std::string out = (folder / "out").string();
    const std::vector<std::vector<std::string>> cases = {
        {"bake"},
        {"bake", a, b},
        {"bake", a, b, "-o", a},
        {"bake", a, b, "-o", out},
        {"bake", (folder / "none").string(), "-o", out},
        {"bake", (folder / "no.glb").string(), "-o", out},
        {"bake", a, "-o", (folder / "x.gltf").string()},
        {"bake", a, "-o", out, "--level", "13"},
        {"bake", a, "-o", out, "--budget", "2T"},
        {"bake", a, "-o", out, "--worthwhile", "7"},
        {"bake", a, "-o", out, "--report", "--json"},
    };
    for (const std::vector<std::string> &arguments : cases) {
        const Outcome outcome = runVellum(arguments);
        EXPECT_EQ(outcome.exitCode, 1) << arguments.back();
        EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
        EXPECT_FALSE(fs::exists(out)) << arguments.back();
    }
}

TEST(BakeCommand, TakesTheFilesOfAGltfAlong)
{
    const TemporaryFolder folder;
    fs::create_directories(folder / "in/textures");
    fs::create_directories(folder / "out");
    const Bytes glb = cardGlb();
    std::uint32_t length = 0;
    std::memcpy(&length, &glb[12], sizeof length);
    std::string json(glb.begin() + 20, glb.begin() + 20 + length);
    const std::size_t view = json.rfind("\"byteLength\": ") + 14;
    const auto bytes = static_cast<std::ptrdiff_t>(std::stoul(json.substr(view)));
    json.replace(json.find(R"("buffers": [{)"), 13, R"("buffers": [{"uri": "data.bin", )");
    json.replace(json.find(R"({"mimeType": "image/png", "bufferView": 3})"), 42, R"({"uri": "textures/a%20disc.png"})");
    writeFile(folder / "in/data.bin", {glb.begin() + 28 + length, glb.begin() + 28 + length + bytes});
    writeFile(folder / "in/textures/a disc.png", discPng());
    writeFile(folder / "in/tree.gltf", {json.begin(), json.end()});
    const std::vector<std::string> bake = {"bake", (folder / "in/tree.gltf").string(), "-o", (folder / "out").string()};
    const Outcome outcome = runVellum(bake);
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_EQ(entries(folder / "out"),
              (std::vector<std::string>{"data.bin", "textures", "textures/a disc.png", "tree.gltf", "tree.omm.bin"}));
    EXPECT_EQ(readFile(folder / "out/textures/a disc.png"), discPng());
    EXPECT_EQ(bakedPrimitives(folder / "out/tree.gltf"), 1u);
    EXPECT_EQ(runVellum(bake).exitCode, 0); // again
    // What is there and different is not replaced.
    writeFile(folder / "out/data.bin", {'x'});
    const Outcome refused = runVellum(bake);
    EXPECT_EQ(refused.exitCode, 1);
    EXPECT_EQ(refused.errorLines(), 1);
    EXPECT_EQ(readFile(folder / "out/data.bin"), Bytes{'x'});
    // Nothing is written outside of the output folder.
    json.replace(json.find("\"data.bin\""), 10, "\"../data.bin\"");
    writeFile(folder / "data.bin", readFile(folder / "in/data.bin"));
    writeFile(folder / "in/tree.gltf", {json.begin(), json.end()});
    fs::create_directories(folder / "other");
    const Outcome outside =
        runVellum({"bake", (folder / "in/tree.gltf").string(), "-o", (folder / "other/deep/").string()});
    EXPECT_EQ(outside.exitCode, 1);
    EXPECT_TRUE(entries(folder / "other").empty());
}

TEST(BakeCommand, AnInterruptedBakeLeavesNothing)
{
    for (const int signal : {SIGINT, SIGTERM, SIGKILL}) {
        const TemporaryFolder folder;
        writeFile(folder / "slow.glb", slowGlb());
        const Outcome outcome = interruptVellum(
            {"bake", (folder / "slow.glb").string(), "-o", (folder / "out/slow.glb").string(), "--level", "12"}, signal,
            300);
        EXPECT_EQ(outcome.signal, signal) << outcome.output;
        EXPECT_EQ(entries(folder.path()), (std::vector<std::string>{"slow.glb"}));
        EXPECT_EQ(readFile(folder / "slow.glb"), slowGlb());
    }
}

TEST(BakeCommand, AFullDiskLeavesNothing)
{
    const TemporaryFolder folder;
    writeFile(folder / "tree.glb", cardGlb());
    const Outcome outcome = runVellumWithFileLimit(
        {"bake", (folder / "tree.glb").string(), "-o", (folder / "out/tree.glb").string(), "--level", "8"}, 4096);
    EXPECT_EQ(outcome.exitCode, 1);
    EXPECT_EQ(outcome.errorLines(), 1);
    EXPECT_NE(outcome.errors.find("File too large"), std::string::npos) << outcome.errors;
    EXPECT_EQ(entries(folder.path()), (std::vector<std::string>{"tree.glb"}));
}

TEST(BakeCommand, TheOutputDoesNotDependOnTheNumberOfThreads)
{
    const TemporaryFolder folder;
    writeFile(folder / "tree.glb", cardGlb());
    for (const char *threads : {"1", "4"})
        runVellum({"bake", (folder / "tree.glb").string(), "-o", (folder / threads).string() + ".glb", "-j", threads});
    EXPECT_EQ(readFile(folder / "1.glb"), readFile(folder / "4.glb"));
}
