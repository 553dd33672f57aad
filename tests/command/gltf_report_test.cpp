// SPDX-License-Identifier: Apache-2.0
// Reports of the command about glTF files beyond the usual ones: excluded primitives, unreadable parts, shares of the
// surface.
#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <sstream>

#include "command.h"
#include "compressed.h"
#include "gltf/data/image.h"
#include "gltf/file/json_tree.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

class GltfReport : public testing::Test
{
protected:
    [[nodiscard]] std::string in(const std::string &name) const { return (folder / name).string(); }
    void write(const std::string &name, const Replacements &replacements = {}) const
    {
        writeFile(folder / name, cardGlb(replacements));
    }
    static Outcome run(const std::vector<std::string> &arguments, int exitCode = 0)
    {
        Outcome outcome = runVellum(arguments);
        EXPECT_EQ(outcome.exitCode, exitCode) << outcome.output << outcome.errors;
        return outcome;
    }

    TemporaryFolder folder;
};

size_t occurrences(const std::string &text, const std::string &part)
{
    size_t count = 0;
    for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1))
        ++count;
    return count;
}

const std::string kMask = R"("alphaMode": "MASK", "alphaCutoff": 0.25)";
const std::string kBlend = R"("alphaMode": "BLEND")";
const std::string kFactor = "[1, 0.5, 0.25, 0.75]";
const std::string kWood = R"({"name": "wood"})";

// The card's texture is blended: its triangle of wood, too, and without a texture.
const Replacements kGlass = {
    {kMask, kBlend}, {kFactor, "[1, 1, 1, 1]"}, {kWood, R"({"name": "wood", "alphaMode": "BLEND",
                                         "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.6]}})"}};

Bytes png16(uint16_t alpha)
{
    Bytes rows;
    for (int i = 0; i < 16 * 16; ++i)
        rows.insert(rows.end(),
                    {255, 255, 255, 255, 255, 255, static_cast<uint8_t>(alpha >> 8), static_cast<uint8_t>(alpha)});
    return pngImage(16, 16, 16, 6, false, rows);
}

double number(const JsonValue &value)
{
    return value.exists() ? std::stod(std::string(value.text())) : std::nan("");
}

} // namespace

TEST_F(GltfReport, InfoOfSeparateImages)
{
    writeCardGltf(folder / "card.gltf");
    const std::string bytes = std::to_string(discPng().size());
    EXPECT_EQ(lineOf(run({"info", in("card.gltf")}), "image 0"), "image 0     16 x 16, PNG, " + bytes + " bytes");
    const Outcome json = run({"info", in("card.gltf"), "--json"});
    const JsonTree tree(json.output);
    const JsonValue image = tree.root()["files"].children().at(0)["images"].children().at(0);
    EXPECT_EQ(image["type"].string(), "PNG");
    EXPECT_EQ(image["bytes"].integer(), discPng().size());
}

TEST_F(GltfReport, InfoDoesNotCallBakedPrimitivesSkipped)
{
    write("card.glb", kGlass);
    EXPECT_EQ(occurrences(run({"info", in("card.glb")}).output, "skipped"), 2u);
    run({"bake", in("card.glb"), "--blend"});
    EXPECT_FALSE(has(run({"info", in("card.omm.glb")}).output, "skipped"));
    EXPECT_FALSE(has(run({"info", "--json", in("card.omm.glb")}).output, "its alphaMode is BLEND"));
}

TEST_F(GltfReport, OneOfSomethingIsSingular)
{
    write("card.glb");
    const Outcome info = run({"info", in("card.glb")});
    EXPECT_EQ(lineOf(info, "scene"), "scene       1 node, 1 mesh with 2 primitives of triangles");
    run({"bake", in("card.glb")});
    EXPECT_EQ(lineOf(run({"info", in("card.omm.glb")}), "micromaps"),
              "micromaps   1 by EXT_mesh_opacity_micromap, on 1 primitive");
    for (const std::vector<std::string> &arguments :
         {std::vector<std::string>{"info"}, {"verify"}, {"inspect", "-o", in("a.html")}, {"bake", "--report"}}) {
        std::vector<std::string> all = arguments;
        all.push_back(in("card.omm.glb"));
        const std::string output = run(all).output;
        for (const char *wrong : {" 1 primitives", " 1 triangles", " 1 meshes", " 1 nodes", " 1 micromaps"})
            EXPECT_FALSE(has(output, wrong)) << output;
    }
}

TEST_F(GltfReport, InspectCountsSeparateFiles)
{
    writeCardGltf(folder / "card.gltf");
    run({"bake", in("card.gltf"), "-o", in("baked.gltf")});
    uintmax_t bytes = 0;
    for (const auto &entry : std::filesystem::directory_iterator(folder.path()))
        bytes += entry.path().filename() == "card.gltf" ? 0 : std::filesystem::file_size(entry.path());
    const Outcome outcome = run({"inspect", in("baked.gltf"), "-o", in("page.html")});
    std::string digits = lineOf(outcome, "file").substr(12);
    digits = digits.substr(digits.find(": ") + 2);
    digits = digits.substr(0, digits.find(" bytes"));
    std::erase(digits, ',');
    std::erase(digits, ' ');
    EXPECT_EQ(digits, std::to_string(bytes)) << outcome.output;
    EXPECT_TRUE(has(readText(folder / "page.html"), "\"bytes\":" + std::to_string(bytes) + ","));
}

TEST_F(GltfReport, InspectWritesToTheOutputOption)
{
    write("card.glb");
    run({"inspect", in("card.glb"), "--bake", "-o", in("a.html")});
    EXPECT_TRUE(has(readText(folder / "a.html"), "<!DOCTYPE html>"));
    run({"inspect", in("card.glb"), "--bake", "--output", in("b.png")});
    EXPECT_EQ(readText(folder / "b.png").substr(1, 3), "PNG");
    EXPECT_FALSE(std::filesystem::exists(folder / "b.html"));
    std::filesystem::create_directory(folder / "baked-v1.2");
    run({"inspect", in("card.glb"), "--bake", "-o", in("baked-v1.2")});
    EXPECT_TRUE(has(readText(folder / "baked-v1.2/card.html"), "<!DOCTYPE html>"));
    EXPECT_EQ(run({"inspect", in("card.glb"), "--bake", "-o", in("c.html"), "--html", in("d.html")}, 2).errorLines(),
              1);
}

TEST_F(GltfReport, InspectBakesWithTheOptionsOfBake)
{
    write("card.glb", kGlass);
    const auto inspect = [&](std::vector<std::string> more, int code = 0) {
        more.insert(more.begin(), {"inspect", in("card.glb"), "-o", in("a.html")});
        return run(more, code);
    };
    EXPECT_TRUE(has(inspect({"--bake"}, 1).errors, "its alphaMode is BLEND"));
    const Outcome blended = inspect({"--bake", "--blend", "--level", "2"});
    EXPECT_EQ(lineOf(blended, "levels"), "levels      2: 2");
    EXPECT_EQ(inspect({"--level", "2"}, 2).errorLines(), 1);
    write("card.glb", {{kWood, R"({"name": "wood", "alphaMode": "BLEND"})"}});
    EXPECT_EQ(lineOf(inspect({"--bake"}), "skipped"),
              "skipped     mesh 0 primitive 1 (wood): its alphaMode is BLEND; --blend bakes it");
}

TEST_F(GltfReport, SharesHaveOneOrderAndAreLabelled)
{
    write("card.glb", {{kWood, R"({"name": "wood", "alphaMode": "BLEND"})"}});
    const auto inOrder = [](const Outcome &outcome) {
        const std::string header = lineOf(outcome, "  primitive");
        return header.find(" transparent ") < header.find(" opaque ") &&
               header.find(" opaque ") < header.find(" unknown");
    };
    const Outcome bake = run({"bake", in("card.glb"), "--level", "3", "--report"});
    EXPECT_TRUE(inOrder(bake)) << bake.output;
    EXPECT_TRUE(has(bake.output, "shares are of triangles, each counted alike")) << bake.output;
    const Outcome verify = run({"verify", in("card.omm.glb")});
    EXPECT_TRUE(inOrder(verify)) << verify.output;
    EXPECT_TRUE(has(verify.output, "shares are of micro-triangles")) << verify.output;
    EXPECT_TRUE(has(lineOf(run({"inspect", in("card.omm.glb"), "-o", in("a.html")}), "states"),
                    "of triangles, each counted alike"));
}

// The card has an area of 4, the excluded triangle one of 2; the node scales both.
TEST_F(GltfReport, SharesOfTheSurfaceIncludeSkippedPrimitives)
{
    write("card.glb", {{kWood, R"({"name": "wood", "alphaMode": "BLEND"})"},
                       {R"("translation": [0, 2, 0])", R"("scale": [3, 2, 1])"}});
    const Outcome bake = run({"bake", in("card.glb"), "--level", "3", "--json"});
    const JsonTree tree(bake.output);
    const JsonValue file = tree.root()["files"].children().at(0);
    const JsonValue states = file["primitives"].children().at(0)["states"];
    const double known = (number(states["transparent"]) + number(states["opaque"])) * 4 / 6;
    EXPECT_NEAR(number(file["surface"]["known"]), known, 1e-6) << bake.output;
    EXPECT_NEAR(number(file["surface"]["withoutMicromap"]), 2.0 / 6, 1e-6);
    const Outcome verify = run({"verify", in("card.omm.glb"), "--json"});
    const JsonTree verified(verify.output);
    EXPECT_NEAR(number(verified.root()["files"].children().at(0)["surface"]["known"]), known, 1e-6) << verify.output;
    char text[64];
    std::snprintf(text, sizeof text, "%.1f %% of the alpha-tested surface is known", 100 * known);
    EXPECT_TRUE(has(run({"bake", in("card.glb"), "--level", "3"}).output, text)) << text;
    EXPECT_TRUE(has(run({"bake", in("card.glb"), "--level", "3", "--report"}).output, text)) << text;
    EXPECT_TRUE(has(run({"verify", in("card.omm.glb")}).output, text)) << text;
    EXPECT_TRUE(has(run({"inspect", in("card.omm.glb"), "-o", in("a.html")}).output, text)) << text;
}

// They leave nothing unknown, and a part of that is a guess.
TEST_F(GltfReport, TwoStatesAreNotSaidToBeKnown)
{
    write("card.glb", {});
    const std::string text = "100.0 % of the alpha-tested surface is opaque or transparent, ";
    const std::string why = " of it is in triangles with 2 states: approximate, as outlines follow the micro-triangles "
                            "and no shader refines them";
    for (const std::string &output : {run({"bake", in("card.glb"), "--level", "3", "--states", "2"}).output,
                                      run({"inspect", in("card.omm.glb"), "-o", in("a.html")}).output,
                                      run({"verify", in("card.omm.glb")}).output}) {
        EXPECT_TRUE(has(output, text)) << output;
        EXPECT_TRUE(has(output, why)) << output;
    }
    const Outcome json = run({"inspect", in("card.omm.glb"), "-o", in("a.html"), "--force", "--json"});
    EXPECT_GT(number(JsonTree(json.output).root()["files"].children().at(0)["surface"]["twoStates"]), 0);
    run({"bake", in("card.glb"), "-o", in("four.glb"), "--level", "3"});
    EXPECT_TRUE(has(run({"inspect", in("four.glb"), in("card.omm.glb")}).output, "100.0 % in 2 states"));
}

TEST_F(GltfReport, UnreadableFilesFail)
{
    writeCardGltf(folder / "card.gltf", {0xab, 'K', 'T', 'X', ' ', '2', '0', 0xbb, '\r', '\n', 0x1a, '\n'});
    const Outcome bake = run({"bake", in("card.gltf"), "-o", in("out.gltf"), "--report"}, 1);
    EXPECT_EQ(bake.errorLines(), 1) << bake.errors;
    EXPECT_TRUE(has(bake.errors, "card.gltf: none of its alpha-tested primitives could be baked: mesh 0 primitive 0: "))
        << bake.errors;
    EXPECT_TRUE(has(bake.errors, "KTX2")) << bake.errors;
    EXPECT_FALSE(has(bake.errors, "--fallback-images")) << "there is no other image: " << bake.errors;
    EXPECT_TRUE(has(bake.output, "nothing could be baked, not written; 1 alpha-tested primitive skipped"))
        << bake.output;
    EXPECT_FALSE(has(bake.output, "--copy")) << "it has failed: " << bake.output;
    // An excluded material is not an error.
    write("card.glb", {{kMask, kBlend}});
    EXPECT_EQ(run({"bake", in("card.glb")}).errors, "");
}

// As an image or a buffer does: what is elsewhere is not read.
TEST_F(GltfReport, FilesThatExtensionsNameCountWhereTheyAreBesideTheModel)
{
    writeCardGltf(folder / "in/card.gltf");
    writeFile(folder / "elsewhere", Bytes(100));
    writeFile(folder / "in/a b", Bytes(1000));
    const std::string card = (folder / "in/card.gltf").string();
    const Bytes file = readFile(card);
    const std::string json(file.begin(), file.end());
    const auto bytesWith = [&](const std::string &uri) {
        std::string changed = json;
        changed.insert(changed.rfind('}'), R"(, "extensions": {"ACME_sound": {"uri": ")" + uri + "\"}}");
        writeFile(card, {changed.begin(), changed.end()});
        const Outcome inspect = run({"inspect", card, "--bake", "-o", in("a.html"), "--force", "--json"});
        return number(JsonTree(inspect.output).root()["files"].children().at(0)["bytes"]) -
               static_cast<double>(changed.size());
    };
    const double none = bytesWith("nothing");
    for (const std::string &uri :
         {std::string("../elsewhere"), std::string("%2e%2e/elsewhere"), (folder / "elsewhere").generic_string(),
          std::string("x/../../elsewhere"), std::string("DATA:,xy"), std::string("a:b")})
        EXPECT_EQ(bytesWith(uri), none) << uri;
    for (const char *uri : {"a b", "a%20b", "x/../a%20b", "./a b"})
        EXPECT_EQ(bytesWith(uri), none + 1000) << uri;
}

TEST_F(GltfReport, AvifTextures)
{
    const Bytes disc = avifImage(8, 8, std::vector<uint16_t>(size_t{4} * 8 * 8, 255));
    writeFile(folder / "disc.avif", disc);
    write("card.glb", {{R"({"source": 0, "sampler": 0})", R"({"extensions": {"EXT_texture_avif": {"source": 1}}})"},
                       {R"("bufferView": 3}])", R"("bufferView": 3}, {"uri": "disc.avif"}])"},
                       {R"("asset": {"version": "2.0"},)",
                        R"("asset": {"version": "2.0"}, "extensionsUsed": ["EXT_texture_avif"],)"}});
    const Outcome info = run({"info", in("card.glb")});
    EXPECT_TRUE(has(info.output, "EXT_texture_avif: AVIF images\n")) << info.output;
    const std::string bytes = std::to_string(disc.size()) + " bytes";
    EXPECT_EQ(lineOf(info, "image 1"), kDecodesWebpAndAvif ? "image 1     8 x 8, AVIF, " + bytes
                                                           : "image 1     image 1 (disc.avif) is an AVIF image, which "
                                                             "this build cannot decode");
    const Outcome json = run({"info", in("card.glb"), "--json"});
    const JsonTree tree(json.output);
    const JsonValue file = tree.root()["files"].children().at(0);
    EXPECT_EQ(file["images"].children().at(1)["type"].string(), "AVIF");
    run({"bake", in("card.glb")}, kDecodesWebpAndAvif ? 0 : 1);
}

TEST_F(GltfReport, AReasonDoesNotNameThePrimitiveAgain)
{
    // Indices in a compression that is not known, without others.
    const std::string bytes = std::to_string(92 + discPng().size());
    write("card.glb",
          {{R"({"buffer": 0, "byteOffset": 80, "byteLength": 12})",
            R"({"buffer": 1, "byteLength": 12, "extensions": {"EXT_meshopt_compression":
                           {"buffer": 0, "byteLength": 12, "byteStride": 2, "count": 6, "mode": "NEW"}}})"},
           {R"({"byteLength": )" + bytes + "}]}", R"({"byteLength": )" + bytes + R"(}, {"byteLength": 12}]})"}});
    for (const std::vector<std::string> &arguments :
         {std::vector<std::string>{"info", in("card.glb")}, {"bake", in("card.glb"), "--report"}}) {
        const Outcome outcome = runVellum(arguments);
        EXPECT_TRUE(has(outcome.output, "mesh 0 primitive 0")) << outcome.output;
        std::istringstream lines(outcome.output + outcome.errors);
        for (std::string line; std::getline(lines, line);)
            EXPECT_LE(occurrences(line, "mesh 0 primitive 0"), 1u) << line;
    }
    write("card.glb", {{"\"indices\": 2", "\"indices\": 20"}});
    EXPECT_EQ(occurrences(run({"info", in("card.glb")}, 1).output, "mesh 0 primitive 0: mesh 0 primitive 0"), 0u);
}

TEST_F(GltfReport, ExactUsesAll16Bits)
{
    // 0x80ff / 65535 is 0.5039, its upper 8 bits alone are 0.5020.
    const Replacements cutoff = {{kMask, R"("alphaMode": "MASK", "alphaCutoff": 0.503)"}, {kFactor, "[1, 1, 1, 1]"}};
    writeCardGltf(folder / "card.gltf", png16(0x80ff), cutoff);
    const auto bake = [&] {
        const Outcome outcome = run({"bake", in("card.gltf"), "-o", in("out.gltf"), "--exact", "--json"});
        const JsonTree tree(outcome.output);
        return number(tree.root()["files"].children().at(0)["primitives"].children().at(0)["states"]["opaque"]);
    };
    EXPECT_EQ(bake(), 1);
    run({"verify", "--exact", "--strict", in("out.gltf")});
    // Micromaps of the first texture are wrong for this one.
    writeFile(folder / "disc.png", png16(0x80c4));
    run({"verify", "--exact", in("out.gltf")}, 4);
    EXPECT_EQ(bake(), 0);
    run({"verify", "--exact", "--strict", in("out.gltf")});
    // Interlaced and grey with alpha, the same.
    Bytes rows;
    for (int i = 0; i < 16 * 16; ++i)
        rows.insert(rows.end(), {0, 0, 0x80, 0xff});
    writeFile(folder / "disc.png", pngImage(16, 16, 16, 4, false, rows));
    EXPECT_EQ(bake(), 1);
}

TEST_F(GltfReport, NoUnknownsIfAllOrNoAlphasPass)
{
    const auto unknown = [&](const std::string &cutoff) {
        write("card.glb", {{"0.25,\n", cutoff + ",\n"}});
        const Outcome outcome = run({"bake", in("card.glb"), "--json"});
        run({"verify", in("card.omm.glb"), "--strict"});
        const JsonTree tree(outcome.output);
        const JsonValue states = tree.root()["files"].children().at(0)["primitives"].children().at(0)["states"];
        return std::array{number(states["transparent"]), number(states["opaque"])};
    };
    EXPECT_EQ(unknown("0"), (std::array{0.0, 1.0}));
    EXPECT_EQ(unknown("-1"), (std::array{0.0, 1.0}));
    EXPECT_EQ(unknown("0.751"), (std::array{1.0, 0.0})); // the factor is 0.75
    EXPECT_EQ(unknown("2"), (std::array{1.0, 0.0}));
    EXPECT_LT(unknown("0.75")[0] + unknown("0.75")[1], 1);
}

// A renderer that blends or dithers sees an alpha of 0.6, and so do one of 0 and one of 1 that are not filtered.
TEST_F(GltfReport, BlendIsKnownAtZeroAndOneOnly)
{
    write("card.glb", kGlass);
    const Outcome bake = run({"bake", in("card.glb"), "--blend", "--level", "5", "--json"});
    const JsonTree tree(bake.output);
    const std::vector<JsonValue> primitives = tree.root()["files"].children().at(0)["primitives"].children();
    ASSERT_EQ(primitives.size(), 2u);
    const JsonValue disc = primitives[0]["states"];
    EXPECT_GT(number(disc["opaque"]), 0.1);
    EXPECT_GT(number(disc["transparent"]), 0.1);
    const JsonValue glass = primitives[1]["states"];
    EXPECT_EQ(number(glass["opaque"]) + number(glass["transparent"]), 0) << bake.output;
    EXPECT_FALSE(primitives[1]["caution"].exists());
    run({"verify", "--strict", in("card.omm.glb")});
    run({"bake", in("card.glb"), "--blend", "--exact"});
    run({"verify", "--exact", in("card.omm.glb")});
}

TEST_F(GltfReport, ReportsNameTheOptionForBlend)
{
    write("card.glb", {{kMask, kBlend}});
    for (const std::vector<std::string> &command : {std::vector<std::string>{"info"}, {"inspect", "--bake"}}) {
        std::vector<std::string> words = command;
        words.push_back(in("card.glb"));
        const Outcome outcome = runVellum(words);
        EXPECT_TRUE(has(outcome.output + outcome.errors, "its alphaMode is BLEND; --blend bakes it"))
            << command.front() << outcome.output << outcome.errors;
    }
}

TEST_F(GltfReport, ACutoffThatNoAlphaReachesIsACaution)
{
    // As an 8-bit value, by mistake.
    write("card.glb", {{kMask, R"("alphaMode": "MASK", "alphaCutoff": 128)"}});
    const Outcome bake = run({"bake", in("card.glb")});
    EXPECT_TRUE(
        has(bake.output, "; caution: leaf: no alpha of it reaches its alphaCutoff, 128: all of it is transparent\n"))
        << bake.output;
    run({"verify", "--strict", in("card.omm.glb")});
    write("card.glb", {{kMask, R"("alphaMode": "MASK", "alphaCutoff": 0)"}});
    EXPECT_TRUE(has(run({"bake", in("card.glb")}).output,
                    "; caution: leaf: every alpha of it reaches its alphaCutoff, 0: all of it is opaque\n"));
    write("card.glb");
    EXPECT_FALSE(has(run({"bake", in("card.glb")}).output, "caution"));
    // Nothing is seen of it on purpose.
    write("card.glb", {{kFactor, "[1, 1, 1, 0]"}});
    EXPECT_FALSE(has(run({"bake", in("card.glb")}).output, "caution"));
}

TEST_F(GltfReport, BytesOfIndicesAreNamed)
{
    write("card.glb");
    EXPECT_TRUE(
        has(run({"bake", in("card.glb")}).output, " bytes of micromaps + 2 of indices, 1 primitive, 2 triangles"))
        << run({"bake", in("card.glb")}).output;
    EXPECT_TRUE(has(run({"sweep", in("card.glb")}).output, "\nBytes: those of micromaps, without the indices"));
    EXPECT_TRUE(has(run({"bake", "--help"}).output, "without the indices of"));
}

TEST_F(GltfReport, ACutoffForBlendIsACaution)
{
    write("card.glb", kGlass);
    const std::vector<std::string> arguments = {"bake", in("card.glb"), "--blend", "--blend-cutoff", "0.5"};
    const std::string words = "its alphaMode is BLEND, and was baked as a mask with the cutoff 0.5";
    const auto with = [&](const char *option) {
        std::vector<std::string> all = arguments;
        all.emplace_back(option);
        return run(all);
    };
    EXPECT_EQ(occurrences(with("--report").output, "caution: mesh 0 primitive"), 2u);
    EXPECT_TRUE(has(with("--report").output, words));
    const Outcome json = with("--json");
    const JsonTree tree(json.output);
    const JsonValue glass = tree.root()["files"].children().at(0)["primitives"].children().at(1);
    EXPECT_EQ(number(glass["states"]["opaque"]), 1);
    EXPECT_TRUE(has(glass["caution"].string().value_or(""), words)) << json.output;
    EXPECT_TRUE(has(run(arguments).output, "caution")) << "without a report";
    // The file has the cutoff.
    const Outcome verified = run({"verify", in("card.omm.glb")});
    EXPECT_TRUE(has(verified.output, "verified as a mask with the cutoff 0.5"));
    EXPECT_FALSE(has(verified.output, "verified without it")) << verified.output;
    run({"verify", "--strict", in("card.omm.glb")}, 5);
    run({"verify", "--blend-cutoff", "0.9", in("card.omm.glb")}, 4);
}

// The cutoff is a number in single precision for all who read it.
TEST_F(GltfReport, ACutoffForBlendIsOneNumber)
{
    write("card.glb", {{kMask, kBlend}, {kFactor, "[1, 1, 1, 0.7]"}}); // as the cutoff, rounded
    run({"bake", in("card.glb"), "--blend", "--blend-cutoff", "0.7", "--exact"});
    run({"verify", "--exact", in("card.omm.glb")});
    run({"verify", "--exact", "--blend-cutoff", "0.7", in("card.omm.glb")});
    EXPECT_TRUE(has(readText(in("card.omm.glb")), "\"blendCutoff\":0.7}"));
    for (const std::vector<std::string> &command :
         {std::vector<std::string>{"bake", "--blend"}, {"render", "--blend"}, {"verify"}}) {
        std::vector<std::string> large = command;
        large.insert(large.end(), {in("card.glb"), "--blend-cutoff", "1e39"});
        EXPECT_TRUE(has(run(large, 2).errors, "must be a number")) << command.front();
    }
}

TEST_F(GltfReport, ACutoffForBlendThatTheFileLacks)
{
    write("card.glb", kGlass);
    // A number that single precision rounds, and with as many digits as what is written in its place.
    run({"bake", in("card.glb"), "--blend", "--blend-cutoff", "0.3000003"});
    EXPECT_TRUE(has(readText(in("card.omm.glb")), "\"blendCutoff\":0.3000003"));
    run({"verify", in("card.omm.glb")});
    const Bytes baked = readFile(in("card.omm.glb"));
    // With another value, or without one.
    const auto writeCutoff = [&](std::string value) {
        std::string text(baked.begin(), baked.end());
        const std::string name = "\"blendCutoff\":";
        const size_t at = text.find(name);
        ASSERT_NE(at, std::string::npos);
        const size_t begin = at + name.size();
        const std::string old = text.substr(begin, text.find('}', begin) - begin);
        if (value.empty())
            text[at + 1] = 'B';
        value.resize(old.size(), ' ');
        text.replace(begin, old.size(), text[at + 1] == 'B' ? old : value);
        writeFile(folder / "card.omm.glb", Bytes(text.begin(), text.end()));
    };
    // The default rule applies then, under which it is wrong, and the option is named.
    for (const char *value : {"", "[3]", "null", "\"0.3\"", "1e99"}) {
        writeCutoff(value);
        const Outcome outcome = run({"verify", in("card.omm.glb")}, 4);
        EXPECT_TRUE(has(outcome.output, "wrong: mesh 0 primitive 1")) << value;
        EXPECT_TRUE(has(outcome.output, "the same --blend-cutoff")) << value;
        run({"verify", "--blend-cutoff", "0.3000003", in("card.omm.glb")});
    }
    writeCutoff("2");
    EXPECT_TRUE(has(run({"verify", in("card.omm.glb")}, 4).output, "cutoff 2"));
}

TEST_F(GltfReport, CountsAndOffsetsHave64Bits)
{
    const std::string accessor = R"({"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"})";
    const auto errorOf = [&](const std::string &members, const std::string &indices) {
        write("card.glb",
              {{accessor, R"({"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "sparse": {)" +
                              members + R"(, "values": {"bufferView": 0}, "indices": {"bufferView": 2, )" + indices +
                              R"("componentType": 5123}}})"}});
        return run({"bake", in("card.glb")}, 1).errors;
    };
    EXPECT_TRUE(has(errorOf(R"("count": 4000000000)", ""), "replaces 4000000000 of 4 elements"));
    EXPECT_TRUE(has(errorOf(R"("count": 1)", R"("byteOffset": 4000000000, )"), "reaches outside of its buffer view"));
    write("card.glb", {{R"({"buffer": 0, "byteOffset": 80, "byteLength": 12})",
                        R"({"buffer": 0, "byteOffset": 80, "byteLength": 12, "extensions": {"EXT_meshopt_compression":
                           {"buffer": 0, "byteLength": 12, "byteStride": 2, "count": 4000000002, "mode": "TRIANGLES"}}})"}});
    EXPECT_TRUE(has(run({"bake", in("card.glb")}, 1).errors, "is decompressed to 8000000004 bytes"));
}

// A file as gltf-pipeline leaves it: it keeps extensions that it does not know, and drops data that only they refer to.
TEST_F(GltfReport, MicromapsThatLostTheirData)
{
    write("card.glb");
    run({"bake", in("card.glb"), "-o", in("baked.glb")});
    const Bytes baked = readFile(folder / "baked.glb");
    const size_t jsonBytes = baked[12] + 256u * baked[13];
    const std::string json(baked.begin() + 20, baked.begin() + 20 + static_cast<ptrdiff_t>(jsonBytes));
    const JsonTree tree(json);
    JsonEdit edit(tree);
    for (const char *name : {"bufferViews", "accessors"}) {
        std::string first4;
        for (size_t i = 0; i < 4; ++i)
            first4.append(i == 0 ? "" : ",").append(tree.root()[name].children().at(i).text());
        edit.replace(tree.root()[name], "[" + first4 + "]");
    }
    const Bytes binary(baked.begin() + 28 + static_cast<ptrdiff_t>(jsonBytes), baked.end());
    writeFile(folder / "lost.glb", packGlb(edit.apply(), binary));
    const std::string words = "lost their data";
    const Outcome verify = run({"verify", in("lost.glb")}, 3);
    EXPECT_EQ(occurrences(verify.output, "structure: "), 1u) << verify.output;
    EXPECT_TRUE(has(verify.output, words) && has(verify.output, "another bake repairs the file")) << verify.output;
    const Outcome info = run({"info", in("lost.glb")}, 3);
    EXPECT_TRUE(has(lineOf(info, "invalid"), words) && has(lineOf(info, "invalid"), "another bake repairs the file"))
        << info.output;
    EXPECT_EQ(occurrences(info.output, "\ninvalid"), 1u) << info.output;
    const Outcome inspect = run({"inspect", in("lost.glb"), "-o", in("a.html")}, 1);
    EXPECT_TRUE(has(inspect.errors, words) && has(inspect.errors, "another bake repairs the file")) << inspect.errors;
    EXPECT_EQ(inspect.errorLines(), 1);
    const Outcome render = run({"render", in("lost.glb"), "-o", in("a.png")}, 1);
    EXPECT_TRUE(has(render.errors, words) && has(render.errors, "another bake repairs the file")) << render.errors;
    EXPECT_EQ(render.errorLines(), 1);
    const Outcome repaired = run({"bake", in("lost.glb"), "-o", in("repaired.glb")});
    EXPECT_TRUE(has(repaired.output, words)) << repaired.output;
    run({"verify", "--strict", in("repaired.glb")});
}
