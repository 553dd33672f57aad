// SPDX-License-Identifier: Apache-2.0
// `vellum bake` as its user runs it.
#include <algorithm>
#include <csignal>
#include <cstring>
#include <gtest/gtest.h>
#include <map>
#include <sys/stat.h>

#include "command.h"
#include "glb_file.h"
#include "gltf/file/container.h"
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
        names.push_back(entry.path().lexically_relative(folder).generic_string());
    std::sort(names.begin(), names.end());
    return names;
}

size_t bakedPrimitives(const fs::path &path)
{
    return readMicromaps(Document(path)).primitives.size();
}

// A GLB whose JSON has the mark of an output without micromaps, as it was before. Fails for one without the mark.
Bytes withoutMark(const Bytes &glb)
{
    const Container container = findContainer(glb);
    std::string json(container.json());
    const std::string mark = R"("extras":{"vellum":"bake"})";
    const size_t at = json.find(mark);
    EXPECT_NE(at, std::string::npos);
    if (at == std::string::npos)
        return glb;
    const size_t comma = json.rfind(',', at);
    json.erase(comma, at - comma + mark.size());
    json.resize(json.find_last_not_of(' ') + 1);
    const size_t rest = container.jsonOffset + container.jsonSize + 8;
    return packGlb(json, Bytes(glb.begin() + static_cast<ptrdiff_t>(rest), glb.end()));
}

} // namespace

TEST(BakeCommand, WritesNextToTheInput)
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

TEST(BakeCommand, ReportsExclusionsThatMatchNothing)
{
    const TemporaryFolder folder;
    const std::string tree = (folder / "tree.glb").string();
    writeFile(tree, cardGlb());
    writeFile(folder / "other.glb", cardGlb({{R"("name": "leaf")", R"("name": "glass")"}}));
    const auto bake = [&](std::vector<std::string> arguments) {
        arguments.insert(arguments.begin(), {"bake", "--force", "-o", (folder / "out").string()});
        return runVellum(arguments);
    };
    const Outcome outcome = bake({tree, (folder / "other.glb").string(), "--exclude-material", "gl*",
                                  "--exclude-material", "laef", "--exclude-mesh", "nothing[0-9]"});
    EXPECT_EQ(outcome.exitCode, 0);
    EXPECT_EQ(outcome.errors, "vellum: --exclude-material laef matches no material\n"
                              "vellum: --exclude-mesh nothing[0-9] matches no mesh\n");
    // A material without a name is matched by its number.
    writeFile(folder / "unnamed.glb", cardGlb({{R"("name": "leaf", )", ""}}));
    EXPECT_EQ(bake({(folder / "unnamed.glb").string(), "--exclude-material", "0"}).errors, "");
    // A file that is not read may have a match.
    const Outcome unread = bake({tree, (folder / "missing.glb").string(), "--exclude-material", "laef"});
    EXPECT_EQ(unread.exitCode, 1);
    EXPECT_EQ(unread.errorLines(), 1) << unread.errors;
    const Outcome inspected = runVellum({"inspect", tree, "--bake", "--exclude-material", "laef", "--json"});
    EXPECT_EQ(inspected.exitCode, 0);
    EXPECT_EQ(inspected.errors, "vellum: --exclude-material laef matches no material\n");
}

// A budget of 0 leaves one state for each triangle, in the smallest micromap that the extension has.
TEST(BakeCommand, ABudgetOfNothing)
{
    const TemporaryFolder folder;
    const std::string tree = (folder / "tree.glb").string();
    writeFile(tree, cardGlb());
    const Outcome outcome = runVellum({"bake", tree, "--budget", "0", "--json"});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    const StoredMicromaps stored = readMicromaps(Document(folder / "tree.omm.glb"));
    ASSERT_EQ(stored.micromaps.size(), 1u);
    EXPECT_EQ(stored.micromaps[0].data.size() + stored.micromaps[0].triangles.size() * sizeof(MicromapTriangle), 9u);
    for (const auto &[place, primitive] : stored.primitives)
        for (const int32_t index : primitive.indices)
            EXPECT_LT(index, 0);
}

TEST(BakeCommand, NamesOutsideAscii)
{
    const TemporaryFolder folder;
    const fs::path in = folder.path() / u8"\u00e4\u6a39";
    fs::create_directory(in);
    const std::u8string text = in.u8string();
    const std::string name(text.begin(), text.end());
    writeFile(in / u8"\u00f6.glb", cardGlb());
    const Outcome single = runVellum({"bake", name + "/\u00f6.glb", name + "/\u00fc-out.glb"});
    EXPECT_EQ(single.exitCode, 0) << single.errors;
    EXPECT_NE(single.output.find("\u00fc-out.glb"), std::string::npos) << single.output;
    EXPECT_TRUE(fs::exists(in / u8"\u00fc-out.glb"));
    EXPECT_EQ(runVellum({"bake", name + "/\u00f6.glb"}).exitCode, 0);
    EXPECT_TRUE(fs::exists(in / u8"\u00f6.omm.glb"));
    writeCardGltf(in / u8"\u00df.gltf");
    const Outcome all = runVellum({"bake", name, "-o", name + "/\u0436", "--json"});
    EXPECT_EQ(all.exitCode, 0) << all.errors;
    EXPECT_TRUE(fs::exists(in / u8"\u0436/\u00f6.glb"));
    EXPECT_EQ(bakedPrimitives(in / u8"\u0436/\u00df.gltf"), 1u);
    EXPECT_NE(all.output.find("\u0436"), std::string::npos) << all.output; // a separator of the platform is between
    EXPECT_NE(all.output.find("\u00df.gltf"), std::string::npos) << all.output;
    const Outcome verified = runVellum({"verify", name + "/\u0436", name + "/\u00fc-out.glb"});
    EXPECT_EQ(verified.exitCode, 0) << verified.errors;
    EXPECT_NE(verified.output.find("\u00df.gltf"), std::string::npos) << verified.output;
    const Outcome inspected = runVellum({"inspect", name + "/\u00fc-out.glb", "-o", name + "/\u00e9.html"});
    EXPECT_EQ(inspected.exitCode, 0) << inspected.errors;
    EXPECT_TRUE(fs::exists(in / u8"\u00e9.html"));
    const Outcome missing = runVellum({"info", name + "/\u2192.glb"});
    EXPECT_EQ(missing.exitCode, 1);
    EXPECT_NE(missing.errors.find("\u2192.glb"), std::string::npos) << missing.errors;
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

TEST(BakeCommand, RejectsUnclearOperandsAndOptions)
{
    const TemporaryFolder folder;
    fs::create_directories(folder / "a");
    fs::create_directories(folder / "b");
    fs::create_directories(folder / "none");
    for (const char *name : {"a/x.glb", "b/x.glb"})
        writeFile(folder / name, cardGlb());
    const std::string a = (folder / "a/x.glb").string();
    const std::string b = (folder / "b/x.glb").string();
    const std::string out = (folder / "out.glb").string();
    const std::string outFolder = (folder / "out").string();
    const std::vector<std::vector<std::string>> cases = {
        {"bake"},
        {"bake", a, b, out},
        {"bake", (folder / "a").string()},
        {"bake", a, b, "-o", a},
        {"bake", a, b, "-o", outFolder},
        {"bake", a, "-o", "-", "--json"},
        {"bake", a, "-", "-o", out},
        {"bake", "-", "-o", (folder / "a").string()},
        {"bake", a, "--files", a},
        {"bake", a, "-o", out, "--shard", "0/2"},
        {"bake", a, "-o", out, "--shard", "3/2"},
        {"bake", a, "-o", out, "--shard", "1/"},
        {"bake", a, "-o", out, "--shard", "1/2/3"},
        {"bake", a, "-o", out, "--shard", "1/99999999999"},
        {"bake", a, "-o", out, "--log", a},
        {"bake", a, "-o", out, "--log", "-"},
        {"bake", a, "-o", out, "--log", out, "--dry-run"},
        {"bake", a, "-o", out, "--level", "13"},
        {"bake", a, "-o", out, "--budget", "2T"},
        {"bake", a, "-o", out, "--min-known", "7"},
        {"bake", a, "-o", out, "--report", "--json"},
        {"bake", a, "-o", out, "--exact", "--value-tolerance", "0.1"},
        {"verify", a, "--exact", "--subtexel-tolerance", "0.1"},
    };
    for (const std::vector<std::string> &arguments : cases) {
        const Outcome outcome = runVellum(arguments);
        EXPECT_EQ(outcome.exitCode, 2) << arguments.back();
        EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
        EXPECT_FALSE(fs::exists(out) || fs::exists(outFolder)) << arguments.back();
    }
    for (const std::vector<std::string> &arguments :
         {std::vector<std::string>{"bake", (folder / "none").string(), "-o", outFolder},
          {"bake", (folder / "no.glb").string(), "-o", out},
          {"bake", a, "-o", (folder / "x.gltf").string()}}) {
        const Outcome outcome = runVellum(arguments);
        EXPECT_EQ(outcome.exitCode, 1) << arguments.back();
        EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
        EXPECT_FALSE(fs::exists(out) || fs::exists(outFolder)) << arguments.back();
    }
}

TEST(BakeCommand, TakesTheFilesOfAGltfAlong)
{
    const TemporaryFolder folder;
    fs::create_directories(folder / "in/textures");
    fs::create_directories(folder / "out");
    std::string json = writeCardGltf(folder / "in/tree.gltf");
    json.replace(json.find("disc.png"), 8, "textures/a%20disc.png");
    fs::rename(folder / "in/disc.png", folder / "in/textures/a disc.png");
    writeFile(folder / "in/tree.gltf", {json.begin(), json.end()});
    const std::vector<std::string> bake = {"bake", (folder / "in/tree.gltf").string(), "-o", (folder / "out").string()};
    const Outcome outcome = runVellum(bake);
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    const std::vector<std::string> out = entries(folder / "out");
    EXPECT_EQ(std::vector<std::string>(out.begin(), out.end() - 1),
              (std::vector<std::string>{"data.bin", "textures", "textures/a disc.png", "tree.gltf"}));
    EXPECT_TRUE(out.back().starts_with("tree.omm-")) << out.back();
    EXPECT_EQ(readFile(folder / "out/textures/a disc.png"), discPng());
    EXPECT_EQ(bakedPrimitives(folder / "out/tree.gltf"), 1u);
    EXPECT_EQ(runVellum(bake).exitCode, 0); // again
    EXPECT_EQ(entries(folder / "out"), out);
    // What programs keep in extras is theirs, whatever they call it.
    std::string noted = json;
    noted.replace(noted.find("\"2.0\""), 5, R"("2.0", "extras": {"source": [{"uri": "../notes.txt"}]})");
    writeFile(folder / "notes.txt", {'n'});
    writeFile(folder / "in/noted.gltf", {noted.begin(), noted.end()});
    const Outcome extras =
        runVellum({"bake", (folder / "in/noted.gltf").string(), "-o", (folder / "out/noted/").string()});
    EXPECT_EQ(extras.exitCode, 0) << extras.errors;
    EXPECT_FALSE(fs::exists(folder / "out/notes.txt"));
    fs::remove_all(folder / "out/noted");
    // A file with the name of a copy and other content is replaced only with --force.
    writeFile(folder / "out/data.bin", {'x'});
    const Outcome rejected = runVellum(bake);
    EXPECT_EQ(rejected.exitCode, 1);
    EXPECT_EQ(rejected.errorLines(), 1);
    EXPECT_EQ(readFile(folder / "out/data.bin"), Bytes{'x'});
    std::vector<std::string> forced = bake;
    forced.emplace_back("--force");
    EXPECT_EQ(runVellum(forced).exitCode, 0);
    EXPECT_EQ(readFile(folder / "out/data.bin"), readFile(folder / "in/data.bin"));
    // Nor is the input of another file, even with it.
    fs::create_directories(folder / "two");
    writeCardGltf(folder / "two/other.gltf");
    writeFile(folder / "two/data.bin", readFile(folder / "in/data.bin"));
    fs::resize_file(folder / "two/data.bin", fs::file_size(folder / "two/data.bin") + 4);
    const Outcome read = runVellum({"bake", (folder / "in/tree.gltf").string(), (folder / "two/other.gltf").string(),
                                    "-o", (folder / "two").string(), "--force"});
    EXPECT_EQ(read.exitCode, 1);
    EXPECT_NE(read.errors.find("is read for"), std::string::npos) << read.errors;
    EXPECT_NE(readFile(folder / "two/data.bin"), readFile(folder / "in/data.bin"));
    EXPECT_EQ(runVellum({"bake", (folder / "in/tree.gltf").string(), (folder / "two/other.gltf").string(), "-o", "-"})
                  .exitCode,
              2);
    // Nothing is written outside the output folder.
    json.replace(json.find("\"data.bin\""), 10, "\"../data.bin\"");
    writeFile(folder / "data.bin", readFile(folder / "in/data.bin"));
    writeFile(folder / "in/tree.gltf", {json.begin(), json.end()});
    fs::create_directories(folder / "other");
    const Outcome outside =
        runVellum({"bake", (folder / "in/tree.gltf").string(), "-o", (folder / "other/deep/").string()});
    EXPECT_EQ(outside.exitCode, 1);
    EXPECT_TRUE(entries(folder / "other").empty());
}

#ifndef _WIN32 // where links need rights that tests do not have
TEST(BakeCommand, CopiesNothingThatALinkLeadsOutTo)
{
    const TemporaryFolder folder;
    writeFile(folder / "secret.txt", {'s'});
    std::string json = writeCardGltf(folder / "in/tree.gltf");
    // Vellum does not read it, but would copy it.
    json.insert(json.rfind('}'), R"(, "extensions": {"ACME_sound": {"uri": "sound.ogg"}})");
    writeFile(folder / "in/tree.gltf", {json.begin(), json.end()});
    const std::vector<std::string> bake = {"bake", (folder / "in/tree.gltf").string(), "-o",
                                           (folder / "out").string() + "/"};
    for (const fs::path &target : {fs::path("../secret.txt"), folder / "secret.txt"}) {
        fs::create_symlink(target, folder / "in/sound.ogg");
        const Outcome outcome = runVellum(bake);
        EXPECT_EQ(outcome.exitCode, 1);
        EXPECT_NE(outcome.errors.find("a link leads out of the file's folder"), std::string::npos) << outcome.errors;
        EXPECT_FALSE(fs::exists(folder / "out"));
        fs::remove(folder / "in/sound.ogg");
    }
    // Links that stay inside are copied as what they lead to.
    writeFile(folder / "in/inside.ogg", {'i'});
    fs::create_symlink("inside.ogg", folder / "in/sound.ogg");
    EXPECT_EQ(runVellum(bake).exitCode, 0);
    EXPECT_EQ(readFile(folder / "out/sound.ogg"), Bytes{'i'});
    EXPECT_FALSE(fs::is_symlink(folder / "out/sound.ogg"));
}
#endif

TEST(BakeCommand, InputsAreNeverOverwritten)
{
    const TemporaryFolder folder;
    fs::create_directories(folder / "a/sub");
    fs::create_directories(folder / "b/sub");
    const Bytes other = cardGlb({{"\"leaf\"", "\"oak\""}});
    writeFile(folder / "a/sub/x.glb", cardGlb());
    writeFile(folder / "b/sub/x.glb", other);
    fs::create_symlink("b", folder / "link");
    for (const char *output : {"b", "link"}) {
        const Outcome outcome =
            runVellum({"bake", (folder / "a").string(), (folder / "b/sub").string(), "-o", (folder / output).string()});
        EXPECT_EQ(outcome.exitCode, 1);
        EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
        EXPECT_NE(outcome.errors.find("a/sub/x.glb: the output"), std::string::npos) << outcome.errors;
        EXPECT_EQ(readFile(folder / "b/sub/x.glb"), other);
        EXPECT_EQ(bakedPrimitives(folder / "b/x.glb"), 1u); // the other one is baked
    }
    // A file that another input refers to is an input, too, and is not overwritten.
    std::string json = writeCardGltf(folder / "c/tree.gltf");
    json.replace(json.find("disc.png"), 8, "disc.glb");
    fs::rename(folder / "c/disc.png", folder / "c/disc.glb");
    writeFile(folder / "c/tree.gltf", {json.begin(), json.end()});
    writeFile(folder / "a/disc.glb", cardGlb());
    const Outcome named = runVellum(
        {"bake", (folder / "c/tree.gltf").string(), (folder / "a/disc.glb").string(), "-o", (folder / "c").string()});
    EXPECT_EQ(named.exitCode, 1);
    EXPECT_EQ(named.errorLines(), 2) << named.errors;
    EXPECT_EQ(readFile(folder / "c/disc.glb"), discPng());
}

TEST(BakeCommand, TheFirstOfTwoDifferentFilesWins)
{
    const Bytes png = discPng();
    Bytes longer = png;
    longer.push_back(0);
    for (const char *threads : {"1", "4"}) {
        const TemporaryFolder folder;
        writeCardGltf(folder / "a/a.gltf", longer);
        writeCardGltf(folder / "b/b.gltf", png);
        writeCardGltf(folder / "c/c.gltf", longer);
        const Outcome outcome = runVellum({"bake", (folder / "a").string(), (folder / "b").string(),
                                           (folder / "c").string(), "-o", (folder / "out").string(), "-j", threads});
        EXPECT_EQ(outcome.exitCode, 1);
        EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
        EXPECT_NE(outcome.errors.find(fs::path("b/b.gltf: ").make_preferred().string()), std::string::npos)
            << outcome.errors;
        EXPECT_EQ(readFile(folder / "out/disc.png"), longer);
        EXPECT_EQ(bakedPrimitives(folder / "out/a.gltf"), 1u);
        EXPECT_EQ(bakedPrimitives(folder / "out/c.gltf"), 1u);
        EXPECT_FALSE(fs::exists(folder / "out/b.gltf"));
    }
}

TEST(BakeCommand, OutputsNextToTheInputAreNotInputs)
{
    const TemporaryFolder folder;
    writeCardGltf(folder / "in/tree.gltf");
    EXPECT_EQ(runVellum({"bake", (folder / "in/tree.gltf").string(), "--level", "2"}).exitCode, 0);
    const Outcome outcome = runVellum({"bake", (folder / "in").string(), "-o", (folder / "out").string()});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_EQ(bakedPrimitives(folder / "out/tree.gltf"), 1u);
    EXPECT_EQ(bakedPrimitives(folder / "out/tree.omm.gltf"), 1u);
}

TEST(BakeCommand, AFolderBelowTheOutputIsSearched)
{
    const TemporaryFolder folder;
    fs::create_directories(folder / "b/sub");
    writeFile(folder / "b/sub/x.glb", cardGlb());
    for (int i = 0; i < 2; ++i) {
        const Outcome outcome = runVellum({"bake", (folder / "b/sub").string(), "-o", (folder / "b").string()});
        EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
        EXPECT_EQ(entries(folder / "b"), (std::vector<std::string>{"sub", "sub/x.glb", "x.glb"}));
    }
    // An output folder inside the input folder is not searched for inputs.
    for (int i = 0; i < 2; ++i)
        EXPECT_EQ(runVellum({"bake", (folder / "b/sub").string(), "-o", (folder / "b/sub/out").string()}).exitCode, 0);
    EXPECT_EQ(entries(folder / "b/sub"), (std::vector<std::string>{"out", "out/x.glb", "x.glb"}));
}

#ifndef _WIN32 // has no /dev/full, and all its names are Unicode
TEST(BakeCommand, SaysThatStdoutCannotBeWritten)
{
    const TemporaryFolder folder;
    writeFile(folder / "tree.glb", cardGlb());
    const std::string tree = (folder / "tree.glb").string();
    std::vector<std::string> many(100, tree); // more than a buffer
    many.front() = "verify";
    const std::vector<std::vector<std::string>> cases = {
        {"bake", tree}, {"bake", tree, "--json"}, {"verify", tree}, {"bake", "--help"}, {"--version"}, many};
    for (const std::vector<std::string> &arguments : cases) {
        const Outcome outcome = runVellumToFullDevice(arguments);
        EXPECT_EQ(outcome.exitCode, 1) << arguments.back();
        EXPECT_EQ(outcome.errors, "vellum: stdout cannot be written\n") << arguments.back();
    }
}

TEST(BakeCommand, OutputsThatAreNotFilesCannotBeReplaced)
{
    const TemporaryFolder folder;
    writeFile(folder / "tree.glb", cardGlb());
    const std::string output = (folder / "pipe.glb").string();
    ASSERT_EQ(mkfifo(output.c_str(), 0600), 0);
    for (const char *force : {"--threads=1", "--force"}) {
        const Outcome outcome = runVellum({"bake", (folder / "tree.glb").string(), "-o", output, force});
        EXPECT_EQ(outcome.exitCode, 1);
        EXPECT_NE(outcome.errors.find("it is there already and is not a file\n"), std::string::npos) << outcome.errors;
    }
}

TEST(BakeCommand, NamesThatAreNotUtf8AreReplacedInJson)
{
    const TemporaryFolder folder;
    writeFile(folder / "caf\xe9 \xc3\xa9.glb", cardGlb());
    const Outcome outcome = runVellum({"bake", (folder / "caf\xe9 \xc3\xa9.glb").string(), "--json"});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_NE(outcome.output.find("/caf\xef\xbf\xbd \xc3\xa9.glb\""), std::string::npos) << outcome.output;
    EXPECT_EQ(outcome.output.find('\xe9'), std::string::npos);
}
#endif

TEST(BakeCommand, SaysWhatLosesItsMicromap)
{
    const TemporaryFolder folder;
    writeFile(folder / "tree.glb", cardGlb());
    EXPECT_EQ(runVellum({"bake", (folder / "tree.glb").string()}).exitCode, 0);
    const std::vector<std::string> bake = {
        "bake",   (folder / "tree.omm.glb").string(), "-o", (folder / "out.glb").string(), "--exclude-material", "leaf",
        "--force"};
    for (const auto &[option, text] : {std::pair{"", "skipped (1 lost its micromap)"},
                                       {"--report", "it is excluded; its micromap was removed"},
                                       {"--json", "\"hadMicromap\": true"}}) {
        std::vector<std::string> arguments = bake;
        if (*option != 0)
            arguments.emplace_back(option);
        const Outcome outcome = runVellum(arguments);
        EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
        EXPECT_NE(outcome.output.find(text), std::string::npos) << outcome.output;
    }
}

#ifndef _WIN32 // has no signals and no limit of file sizes
namespace
{

// A file that takes seconds to bake at level 12: the disc is repeated until every micro-triangle has an edge of it.
Bytes slowGlb()
{
    return cardGlb(
        {{R"("baseColorTexture": {"index": 0})",
          R"("baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [900, 900]}}})"},
         {R"("magFilter": 9728, "wrapS": 33071, "wrapT": 33648)", R"("magFilter": 9729)"}});
}

} // namespace

namespace
{

using Contents = std::map<std::string, Bytes>;

Contents filesIn(const fs::path &folder)
{
    Contents files;
    for (const std::string &name : entries(folder))
        if (fs::is_regular_file(folder / name))
            files[name] = readFile(folder / name);
    return files;
}

bool isTemporary(const std::string &name)
{
    return fs::path(name).filename().string().starts_with(".");
}

struct Interrupted {
    int calls = 0;             // calls that change files
    size_t temporaryFiles = 0; // files left each time the process was killed
};

// Bakes `in` to `out`, in a folder that `prepare` fills, and interrupts that by each signal at each call that changes
// files.
template <typename Prepare>
Interrupted interruptAtEachCall(const std::string &in, const std::string &out, Prepare &&prepare)
{
    const auto argumentsFor = [&](const TemporaryFolder &folder) {
        prepare(folder.path());
        return std::vector<std::string>{"bake", (folder / in).string(), "-o", (folder / out).string(), "--force"};
    };
    const TemporaryFolder whole;
    const std::vector<std::string> bake = argumentsFor(whole);
    const Contents before = filesIn(whole.path());
    EXPECT_EQ(runVellum(bake).exitCode, 0);
    const Contents after = filesIn(whole.path());
    const auto isIn = [](const Contents &files, const Contents::value_type &file) {
        return files.contains(file.first) && files.at(file.first) == file.second;
    };
    Interrupted result;
    for (const int signal : {SIGINT, SIGTERM, SIGKILL}) {
        for (int call = 0;; ++call) {
            SCOPED_TRACE("signal " + std::to_string(signal) + " at call " + std::to_string(call));
            const TemporaryFolder folder;
            const auto outcome = interruptVellumAtCall(argumentsFor(folder), signal, call, VELLUM_STOPPED_CALL);
            Contents found = filesIn(folder.path());
            if (!outcome) {
                EXPECT_EQ(found, after);
                result.calls = call;
                break;
            }
            EXPECT_EQ(outcome->signal, signal) << outcome->output << outcome->errors;
            if (found == before || found == after)
                continue;
            // Nobody was left to remove anything. Each file is whole, and the one that needs the others comes last.
            EXPECT_EQ(signal, SIGKILL);
            result.temporaryFiles += std::erase_if(found, [](const auto &file) { return isTemporary(file.first); });
            for (const auto &file : found)
                EXPECT_TRUE(isIn(before, file) || (isIn(after, file) && file.first != out)) << file.first;
        }
    }
    return result;
}

} // namespace

TEST(BakeCommand, AnInterruptedBakeLeavesNothing)
{
    const Interrupted result = interruptAtEachCall("in/a.gltf", "out/a.gltf",
                                                   [](const fs::path &folder) { writeCardGltf(folder / "in/a.gltf"); });
    EXPECT_GE(result.calls, 8); // writes and links of four files
    EXPECT_EQ(result.temporaryFiles, 0U);
}

TEST(BakeCommand, AnInterruptedBakeLeavesTheFileThatItWouldReplace)
{
    const Interrupted result = interruptAtEachCall("tree.glb", "old.glb", [](const fs::path &folder) {
        writeFile(folder / "tree.glb", cardGlb());
        writeFile(folder / "old.glb", cardGlb({{"\"alphaMode\": \"MASK\"", "\"alphaMode\": \"OPAQUE\""}}));
    });
    EXPECT_GE(result.calls, 4);           // a write, a link that fails, one to a temporary name, a rename
    EXPECT_EQ(result.temporaryFiles, 1U); // before the rename
}

TEST(BakeCommand, InterruptedWriteReportsRemainingInputs)
{
    for (const int signal : {SIGINT, SIGTERM}) {
        const TemporaryFolder folder;
        fs::create_directories(folder / "in");
        for (const char *name : {"in/a.gltf", "in/b.gltf"})
            writeCardGltf(folder / name);
        const std::vector<std::string> before = entries(folder.path());
        const auto outcome =
            interruptVellumAtCall({"bake", (folder / "in").string(), "-o", (folder / "out").string(), "-j", "1"},
                                  signal, 0, VELLUM_STOPPED_CALL);
        ASSERT_TRUE(outcome);
        EXPECT_EQ(outcome->signal, signal) << outcome->exitCode;
        EXPECT_EQ(entries(folder.path()), before);
        EXPECT_EQ(outcome->output, "");
        for (const char *name : {"a.gltf", "b.gltf"})
            EXPECT_NE(outcome->errors.find(std::string(name) + ": not baked: interrupted\n"), std::string::npos)
                << outcome->errors;
        EXPECT_NE(outcome->errors.find("interrupted: 0 of 2 files were baked\n"), std::string::npos) << outcome->errors;
    }
}

// Finished outputs stay; finished and unfinished inputs are reported.
TEST(BakeCommand, InterruptedBakeReportsFinishedInputs)
{
    const TemporaryFolder folder;
    fs::create_directories(folder / "in");
    writeFile(folder / "in/small.glb", cardGlb({{"\"alphaMode\": \"MASK\"", "\"alphaMode\": \"OPAQUE\""}}));
    // The larger file comes first, and does not end; the other is done meanwhile.
    writeFile(folder / "in/large.glb", slowGlb());
    const Outcome outcome = interruptVellum({"bake", (folder / "in").string(), "-o", (folder / "out").string(),
                                             "--level", "12", "-j", "2", "--json", "--copy"},
                                            SIGINT, folder / "out/small.glb");
    EXPECT_EQ(outcome.signal, SIGINT);
    EXPECT_EQ(entries(folder / "out"), (std::vector<std::string>{"small.glb"}));
    EXPECT_NE(outcome.errors.find("interrupted: 1 of 2 files were baked\n"), std::string::npos) << outcome.errors;
    const JsonTree json(outcome.output);
    const std::vector<JsonValue> files = json.root()["files"].children();
    ASSERT_EQ(files.size(), 2u);
    EXPECT_EQ(files[0]["error"].string(), (folder / "in/large.glb").string() + ": not baked: interrupted");
    EXPECT_FALSE(files[1]["error"].exists());
}

TEST(BakeCommand, BakesWhereNoThreadCanBeStarted)
{
    const TemporaryFolder folder;
    for (const char *name : {"in/a.glb", "in/b.glb", "in/c.glb"}) {
        fs::create_directories(folder / "in");
        writeFile(folder / name, cardGlb());
    }
    const Outcome outcome =
        runVellumWithoutThreads({"bake", (folder / "in").string(), "-o", (folder / "out").string(), "-j", "4"});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.signal << outcome.errors;
    EXPECT_EQ(entries(folder / "out"), (std::vector<std::string>{"a.glb", "b.glb", "c.glb"}));
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
#endif

TEST(BakeCommand, TheOutputDoesNotDependOnTheNumberOfThreads)
{
    const TemporaryFolder folder;
    writeFile(folder / "tree.glb", cardGlb());
    for (const char *threads : {"1", "4"})
        runVellum({"bake", (folder / "tree.glb").string(), "-o", (folder / threads).string() + ".glb", "-j", threads});
    EXPECT_EQ(readFile(folder / "1.glb"), readFile(folder / "4.glb"));
}

TEST(BakeCommand, TakesInAndOut)
{
    const TemporaryFolder folder;
    writeFile(folder / "tree.glb", cardGlb());
    fs::create_directories(folder / "out");
    const std::string tree = (folder / "tree.glb").string();
    EXPECT_EQ(runVellum({"bake", tree, (folder / "baked.glb").string()}).exitCode, 0);
    EXPECT_EQ(runVellum({"bake", tree, (folder / "out").string()}).exitCode, 0);
    EXPECT_EQ(runVellum({"bake", (folder / "out").string(), (folder / "all").string()}).exitCode, 0);
    EXPECT_EQ(entries(folder.path()),
              (std::vector<std::string>{"all", "all/tree.glb", "baked.glb", "out", "out/tree.glb", "tree.glb"}));
    EXPECT_EQ(bakedPrimitives(folder / "baked.glb"), 1u);
    EXPECT_EQ(readFile(folder / "baked.glb"), readFile(folder / "out/tree.glb"));
}

TEST(BakeCommand, ReplacesOnlyItsOwnOutputs)
{
    const TemporaryFolder folder;
    writeFile(folder / "tree.glb", cardGlb());
    const Bytes other = cardGlb({{"\"leaf\"", "\"oak\""}});
    writeFile(folder / "other.glb", other);
    const std::vector<std::string> bake = {"bake", (folder / "tree.glb").string(), (folder / "other.glb").string()};
    const Outcome rejected = runVellum(bake);
    EXPECT_EQ(rejected.exitCode, 1);
    EXPECT_EQ(rejected.errorLines(), 1) << rejected.errors;
    EXPECT_NE(rejected.errors.find("--force"), std::string::npos) << rejected.errors;
    EXPECT_EQ(readFile(folder / "other.glb"), other);
    EXPECT_EQ(runVellum({"bake", bake[1], bake[2], "--force"}).exitCode, 0);
    EXPECT_EQ(bakedPrimitives(folder / "other.glb"), 1u);
    // Now it is an output, which another bake replaces.
    EXPECT_EQ(runVellum({"bake", bake[1], bake[2], "--level", "2"}).exitCode, 0);
    // So is one in which nothing is baked, also after its input has changed.
    const std::string plain = (folder / "plain.glb").string();
    for (const char *name : {"\"leaf\"", "\"leaf\"", "\"elm\""}) {
        writeFile(plain, cardGlb({{"\"alphaMode\": \"MASK\"", "\"alphaMode\": \"OPAQUE\""}, {"\"leaf\"", name}}));
        const Outcome copied = runVellum({"bake", plain, "--copy"});
        EXPECT_EQ(copied.exitCode, 0) << copied.errors;
        EXPECT_EQ(withoutMark(readFile(folder / "plain.omm.glb")), readFile(plain));
    }
    // And one whose micromaps were removed.
    for (const char *name : {"1", "1", "2"}) {
        const Outcome removed = runVellum({"bake", (folder / "other.glb").string(), "-o", (folder / "un.glb").string(),
                                           "--exclude-material", "*", "--level", name});
        EXPECT_EQ(removed.exitCode, 0) << removed.errors;
    }
    // vellum replaces its own outputs only, not a copy of the input that another program made.
    fs::copy_file(plain, folder / "twin.glb");
    EXPECT_EQ(runVellum({"bake", plain, (folder / "twin.glb").string(), "--copy"}).exitCode, 0);
    writeFile(folder / "twin.glb", other);
    EXPECT_EQ(runVellum({"bake", plain, (folder / "twin.glb").string(), "--copy"}).exitCode, 1);
    EXPECT_EQ(runVellum({"bake", plain, (folder / "twin.glb").string()}).exitCode, 1);
    EXPECT_EQ(readFile(folder / "twin.glb"), other);
}

// *.omm.glb in a folder with two outputs.
TEST(BakeCommand, TwoEarlierOutputsAreNoInAndOut)
{
    const TemporaryFolder folder;
    const std::string a = (folder / "a.omm.glb").string();
    const std::string b = (folder / "b.omm.glb").string();
    writeFile(folder / "a.glb", cardGlb());
    writeFile(folder / "b.glb", cardGlb({{"\"leaf\"", "\"oak\""}}));
    for (const char *name : {"a.glb", "b.glb"})
        EXPECT_EQ(runVellum({"bake", (folder / name).string()}).exitCode, 0);
    const Bytes before = readFile(b);
    const Outcome rejected = runVellum({"bake", a, b, "--level", "4"});
    EXPECT_EQ(rejected.exitCode, 2) << rejected.output;
    EXPECT_EQ(rejected.errorLines(), 1) << rejected.errors;
    EXPECT_NE(rejected.errors.find("of two operands the second is the output; -o " + b + " replaces it"),
              std::string::npos)
        << rejected.errors;
    EXPECT_EQ(readFile(b), before);
    for (const std::vector<std::string> &given : {std::vector<std::string>{a, "-o", b}, {a, b, "--force"}}) {
        std::vector<std::string> bake = {"bake"};
        bake.insert(bake.end(), given.begin(), given.end());
        const Outcome replaced = runVellum(bake);
        EXPECT_EQ(replaced.exitCode, 0) << replaced.errors;
        EXPECT_TRUE(replaced.output.starts_with(a + " -> " + b + ": ")) << replaced.output;
        EXPECT_NE(replaced.output.find("; the input had micromaps already, which were replaced"), std::string::npos)
            << replaced.output;
    }
    // A model is baked again to the same output.
    const std::string model = (folder / "a.glb").string();
    EXPECT_EQ(runVellum({"bake", model, b}).exitCode, 0);
    EXPECT_EQ(runVellum({"bake", a, (folder / "new.glb").string()}).exitCode, 0);
}

TEST(BakeCommand, AFolderNeedsAFolder)
{
    const TemporaryFolder folder;
    const std::string name = folder.path().string();
    writeFile(folder / "a.glb", cardGlb());
    EXPECT_EQ(runVellum({"bake", name}).errors,
              "vellum: " + name + " is a folder, which needs an output folder: -o FOLDER\n");
    // Not a folder whose name is that of a file, and no file whose name is that of a folder.
    const std::string file = (folder / "new.glb").string();
    EXPECT_EQ(runVellum({"bake", name, "-o", file}).errors,
              "vellum: " + file + " is the name of a file, and several inputs need an output folder\n");
    const std::string bare = (folder / "new").string();
    EXPECT_EQ(runVellum({"bake", (folder / "a.glb").string(), "-o", bare}).errors,
              "vellum: " + bare + " is no folder: the name of a file ends in .glb, that of a new folder in /\n");
    EXPECT_EQ(runVellum({"bake", name, "-o", name}).errors,
              "vellum: " + name + " is also the output folder, and no input is written: name another\n");
    EXPECT_EQ(entries(folder.path()), (std::vector<std::string>{"a.glb"}));
    EXPECT_EQ(runVellum({"bake", (folder / "a.glb").string(), "-o", bare + "/"}).exitCode, 0);
    EXPECT_EQ(bakedPrimitives(folder / "new/a.glb"), 1u);
}

// Not so that the outputs are there and the build fails.
TEST(BakeCommand, ANameThatADepfileCannotHaveIsFoundFirst)
{
    const TemporaryFolder folder;
    writeFile(folder / "a%b.glb", cardGlb());
    const Outcome outcome = runVellum({"bake", (folder / "a%b.glb").string(), "--depfile", (folder / "a.d").string()});
    EXPECT_EQ(outcome.exitCode, 1);
    EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
    EXPECT_EQ(entries(folder.path()), (std::vector<std::string>{"a%b.glb"}));
}

// What was baked from an earlier input does not stay.
TEST(BakeCommand, AnOutputIsThatOfItsInput)
{
    const TemporaryFolder folder;
    const std::string tree = (folder / "tree.glb").string();
    writeFile(tree, cardGlb());
    EXPECT_EQ(runVellum({"bake", tree}).exitCode, 0);
    writeFile(tree, cardGlb({{"\"alphaMode\": \"MASK\"", "\"alphaMode\": \"OPAQUE\""}}));
    for (int i = 0; i < 2; ++i) {
        const Outcome outcome = runVellum({"bake", tree});
        EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
        EXPECT_EQ(withoutMark(readFile(folder / "tree.omm.glb")), readFile(tree));
    }
    fs::remove(folder / "tree.omm.glb");
    EXPECT_EQ(runVellum({"bake", tree}).exitCode, 0);
    EXPECT_FALSE(fs::exists(folder / "tree.omm.glb"));
}

TEST(BakeCommand, ADryRunWritesNothing)
{
    const TemporaryFolder folder;
    writeCardGltf(folder / "tree.gltf");
    const std::vector<std::string> before = entries(folder.path());
    const Outcome outcome =
        runVellum({"bake", (folder / "tree.gltf").string(), (folder / "out").string() + "/", "--dry-run", "--report"});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_NE(outcome.output.find("mesh 0 primitive 0"), std::string::npos) << outcome.output;
    EXPECT_NE(outcome.output.find("nothing was written"), std::string::npos) << outcome.output;
    EXPECT_EQ(entries(folder.path()), before);
    // It fails for what the bake would.
    for (const char *output : {"tree.glb", "tree.gltf"}) {
        const Outcome wrong =
            runVellum({"bake", (folder / "tree.gltf").string(), (folder / output).string(), "--dry-run", "--force"});
        EXPECT_EQ(wrong.exitCode, 1) << output;
    }
}

TEST(BakeCommand, QuietPrintsErrorsOnly)
{
    const TemporaryFolder folder;
    writeFile(folder / "tree.glb", cardGlb());
    const Outcome quiet = runVellum({"bake", "-q", (folder / "tree.glb").string()});
    EXPECT_EQ(quiet.exitCode, 0);
    EXPECT_EQ(quiet.output + quiet.errors, "");
    const Outcome wrong = runVellum({"bake", "-q", (folder / "none.glb").string()});
    EXPECT_EQ(wrong.exitCode, 1);
    EXPECT_EQ(wrong.errorLines(), 1);
}

TEST(BakeCommand, RequiresMicromapsOnRequest)
{
    const TemporaryFolder folder;
    writeFile(folder / "tree.glb", cardGlb({{"\"alphaMode\": \"MASK\"", "\"alphaMode\": \"BLEND\""}}));
    writeFile(folder / "oak.glb", cardGlb());
    const std::string tree = (folder / "tree.glb").string();
    const std::string skipped = "1 alpha-tested primitive skipped (alphaMode BLEND: 1 primitive of 1 material; --blend";
    for (const char *copy : {"-q", "--copy", "--dry-run", "--json"}) {
        const Outcome none = runVellum({"bake", tree, "--require-micromaps", copy});
        EXPECT_EQ(none.exitCode, 7);
        EXPECT_EQ(none.errorLines(), 1) << none.errors;
        EXPECT_NE(none.errors.find(skipped), std::string::npos) << none.errors;
    }
    const Outcome filter = runVellum({"bake", "-", "--require-micromaps"}, {}, tree);
    EXPECT_EQ(filter.exitCode, 7);
    EXPECT_EQ(filter.output, "");
    EXPECT_EQ(entries(folder.path()), (std::vector<std::string>{"oak.glb", "tree.glb"}));
    // The other files are baked, as where one cannot be read.
    EXPECT_EQ(
        runVellum({"bake", folder.path().string(), "-o", (folder / "out").string(), "--require-micromaps"}).exitCode,
        7);
    EXPECT_EQ(entries(folder / "out"), (std::vector<std::string>{"oak.glb"}));
    EXPECT_EQ(runVellum({"bake", tree, "--require-micromaps", "--blend"}).exitCode, 0);
    // Micromaps stay where there would be none after it.
    const std::string baked = (folder / "tree.omm.glb").string();
    EXPECT_EQ(runVellum({"bake", baked, (folder / "none.glb").string(), "--require-micromaps"}).exitCode, 7);
    EXPECT_FALSE(fs::exists(folder / "none.glb"));
}

TEST(BakeCommand, WritesNoFileThatEqualsItsInput)
{
    const TemporaryFolder folder;
    const Bytes blended = cardGlb({{"\"alphaMode\": \"MASK\"", "\"alphaMode\": \"BLEND\""}});
    fs::create_directories(folder / "in");
    writeFile(folder / "in/tree.glb", blended);
    writeFile(folder / "in/oak.glb", cardGlb());
    writeFile(folder / "in/rock.glb", cardGlb({{"\"alphaMode\": \"MASK\"", "\"alphaMode\": \"OPAQUE\""}}));
    const std::string in = (folder / "in").string();
    const std::string out = (folder / "out").string();
    const std::string tree = (folder / "in/tree.glb").string();
    const Outcome one = runVellum({"bake", tree});
    EXPECT_EQ(one.exitCode, 0) << one.errors;
    const std::string line = tree +
                             ": nothing to bake, not written; 1 alpha-tested primitive skipped (alphaMode BLEND: 1 "
                             "primitive of 1 material; --blend bakes it)";
    EXPECT_EQ(one.output.substr(0, line.size()), line);
    EXPECT_NE(one.output.find("\nthe output was not written, as nothing is baked; --copy"), std::string::npos)
        << one.output;
    EXPECT_EQ(entries(folder.path()), (std::vector<std::string>{"in", "in/oak.glb", "in/rock.glb", "in/tree.glb"}));

    const Outcome all = runVellum({"bake", in, "-o", out, "--report"});
    EXPECT_EQ(all.exitCode, 0) << all.errors;
    EXPECT_NE(all.output.find("\n1 file baked, 2 not written (nothing to bake; --copy writes copies)\n"),
              std::string::npos)
        << all.output;
    writeFile(folder / "in/broken.glb", {'x'});
    const Outcome broken = runVellum({"bake", in, "-o", out, "--copy"});
    EXPECT_NE(broken.output.find("\n1 file baked, 2 written with nothing baked, 1 failed\n"), std::string::npos)
        << broken.output;
    fs::remove(folder / "in/broken.glb");
    fs::remove_all(out);
    EXPECT_EQ(runVellum({"bake", in, "-o", out}).exitCode, 0);
    EXPECT_EQ(entries(out), (std::vector<std::string>{"oak.glb"}));
    const Outcome json = runVellum({"bake", in, "-o", out, "--json"});
    EXPECT_NE(json.output.find("\"written\": true"), std::string::npos) << json.output;
    EXPECT_NE(json.output.find("\"written\": false"), std::string::npos) << json.output;
    EXPECT_NE(json.output.find("\"outputBytes\": 0"), std::string::npos) << json.output;

    // A build system gets every output, and a filter passes its input on.
    EXPECT_EQ(runVellum({"bake", in, "-o", out, "--copy"}).exitCode, 0);
    EXPECT_EQ(withoutMark(readFile(folder / "out/tree.glb")), blended);
    EXPECT_EQ(withoutMark(readFile(folder / "out/rock.glb")), readFile(folder / "in/rock.glb"));
    const Outcome filter = runVellum({"bake", "-"}, {}, folder / "in/tree.glb");
    EXPECT_EQ(Bytes(filter.output.begin(), filter.output.end()), blended);
    EXPECT_EQ(runVellum({"bake", in, "-o", out, "--blend"}).exitCode, 0);
    EXPECT_EQ(bakedPrimitives(folder / "out/tree.glb"), 1u);
    EXPECT_EQ(runVellum({"bake", in, "-o", out}).exitCode, 0);
    EXPECT_EQ(withoutMark(readFile(folder / "out/tree.glb")), blended);
    EXPECT_EQ(runVellum({"bake", in, "-o", out, "--blend"}).exitCode, 0);

    // Micromaps that nothing replaces are removed, which changes the file.
    EXPECT_EQ(runVellum({"bake", (folder / "out/tree.glb").string(), (folder / "none.glb").string()}).exitCode, 0);
    EXPECT_EQ(bakedPrimitives(folder / "none.glb"), 0u);
}

TEST(BakeCommand, FilterFromStdinToStdout)
{
    const TemporaryFolder folder;
    writeFile(folder / "tree.glb", cardGlb());
    const std::string tree = (folder / "tree.glb").string();
    EXPECT_EQ(runVellum({"bake", tree}).exitCode, 0);
    const Outcome piped = runVellum({"bake", "-", "-"}, {}, folder / "tree.glb");
    EXPECT_EQ(piped.exitCode, 0) << piped.errors;
    EXPECT_EQ(Bytes(piped.output.begin(), piped.output.end()), readFile(folder / "tree.omm.glb"));
    EXPECT_NE(piped.errors.find("1 primitive"), std::string::npos) << piped.errors;
    const Outcome quiet = runVellum({"bake", "-", "-q"}, {}, folder / "tree.glb");
    EXPECT_EQ(quiet.output, piped.output);
    EXPECT_EQ(quiet.errors, "");
    EXPECT_EQ(runVellum({"verify", "--strict", "-"}, {}, folder / "tree.omm.glb").exitCode, 0);
    EXPECT_EQ(runVellum({"verify", "--strict", "-"}, {}, folder / "tree.glb").exitCode, 7);
    EXPECT_NE(runVellum({"info", "-"}, {}, folder / "tree.omm.glb").output.find("on 1 primitive"), std::string::npos);
    const Outcome broken = runVellum({"info", "-"}, {}, "/dev/null");
    EXPECT_EQ(broken.exitCode, 1);
}
