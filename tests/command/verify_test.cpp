// SPDX-License-Identifier: Apache-2.0
// `vellum verify`: its exit codes, and what it prints.
#include <gtest/gtest.h>

#include "card_file.h"
#include "command.h"
#include "gltf/file/json_tree.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

struct VerifyCommand : testing::Test {
    CardFile card = baked({});
    TemporaryFolder folder;

    static CardFile baked(BakeOptions options)
    {
        CardFile card;
        if (!options.level)
            options.level = 3;
        card.bake(options);
        return card;
    }
    Outcome verify(const CardFile &file, std::vector<std::string> arguments = {})
    {
        writeFile(folder / "card.glb", file.bytes());
        arguments.insert(arguments.begin(), {"verify", (folder / "card.glb").string()});
        return runVellum(arguments);
    }
    // Gives the first micro-triangle of a state another one.
    static uint32_t change(CardFile &file, State from, State to)
    {
        const MicromapTriangle &t = file.micromap.triangles.at(static_cast<size_t>(file.micromap.indices.at(0)));
        uint8_t *data = file.micromap.data.data() + t.dataOffset;
        uint32_t micro = 0;
        while (readState(data, micro, t.format) != from)
            ++micro;
        writeState(data, micro, t.format, to);
        return micro;
    }
};

} // namespace

TEST_F(VerifyCommand, AcceptsOutputOfTheBaker)
{
    for (const std::vector<std::string> &arguments : {std::vector<std::string>{}, {"--strict"}}) {
        const Outcome outcome = verify(card, arguments);
        EXPECT_EQ(outcome.exitCode, 0) << outcome.output;
        EXPECT_EQ(outcome.errors, "");
        EXPECT_TRUE(has(outcome.output, "valid structure")) << outcome.output;
        EXPECT_TRUE(has(outcome.output, "mesh 0 \"leaves\" primitive 0")) << outcome.output;
        EXPECT_FALSE(has(outcome.output, "wrong:")) << outcome.output;
    }
}

TEST_F(VerifyCommand, ReportsErrorsWithLocation)
{
    const uint32_t micro = change(card, State::Opaque, State::Transparent);
    const Outcome outcome = verify(card);
    EXPECT_EQ(outcome.exitCode, 4);
    EXPECT_TRUE(has(outcome.output, "wrong: mesh 0 \"leaves\" primitive 0, triangle 0, micro-triangle " +
                                        std::to_string(micro) + " of level 3: transparent, alpha "))
        << outcome.output;
    EXPECT_TRUE(has(outcome.output, "cutoff 0.5")) << outcome.output;
}

TEST_F(VerifyCommand, ListsTheRequestedNumber)
{
    card.cards = 3;
    change(card, State::Opaque, State::Transparent);
    change(card, State::Opaque, State::Transparent);
    const auto lines = [](const std::string &text) {
        size_t count = 0;
        for (size_t at = text.find("wrong: "); at != std::string::npos; at = text.find("wrong: ", at + 1))
            ++count;
        return count;
    };
    EXPECT_EQ(lines(verify(card).output), 6u);
    const Outcome one = verify(card, {"--max-findings", "1"});
    EXPECT_EQ(lines(one.output), 3u);
    EXPECT_TRUE(has(one.output, "and 3 more")) << one.output;
    EXPECT_EQ(lines(verify(card, {"--max-findings", "0"}).output), 0u);
}

TEST_F(VerifyCommand, StrictReportsPossibleImprovements)
{
    // Baked without tolerances: true, but not with them.
    const CardFile bold = baked(BakeOptions{}.exactly());
    EXPECT_EQ(verify(bold).exitCode, 0);
    EXPECT_TRUE(has(verify(bold).output, "outside the margins:"));
    EXPECT_TRUE(has(verify(bold).output, "with the same options, such as --exact"));
    EXPECT_EQ(verify(bold, {"--strict"}).exitCode, 5);
    EXPECT_EQ(verify(bold, {"--strict", "--exact"}).exitCode, 0);
    // The strict margins are needlessly unknown under --exact.
    EXPECT_EQ(verify(card, {"--exact"}).exitCode, 0);
    EXPECT_TRUE(has(verify(card, {"--exact"}).output, "needlessly unknown:"));
    EXPECT_EQ(verify(card, {"--strict", "--exact"}).exitCode, 6);
    EXPECT_EQ(verify(bold, {"--strict", "--value-tolerance", "0", "--subtexel-tolerance", "0",
                            "--barycentric-tolerance", "0", "--interpolation-tolerance", "0"})
                  .exitCode,
              0);
    CardFile plain = card;
    plain.extension = false;
    EXPECT_EQ(verify(plain).exitCode, 0);
    EXPECT_TRUE(has(verify(plain).output, "no micromaps"));
    EXPECT_EQ(verify(plain, {"--strict"}).exitCode, 7);
}

TEST_F(VerifyCommand, RequiresMicromapsOnRequest)
{
    EXPECT_EQ(verify(card, {"--require-micromaps"}).exitCode, 0);
    CardFile plain = card;
    plain.extension = false;
    for (const char *quiet : {"-q", "-v", "--strict"})
        EXPECT_EQ(verify(plain, {"--require-micromaps", quiet}).exitCode, 7);
    const Outcome json = verify(plain, {"--require-micromaps", "--json"});
    EXPECT_EQ(json.exitCode, 7);
    EXPECT_TRUE(has(json.output, "\"exitCode\": 7")) << json.output;
    // The extension of the root alone is none.
    const Bytes used = card.bytes();
    std::string text(used.begin(), used.end());
    const size_t at = text.rfind("EXT_mesh_opacity_micromap", text.find("\"micromapIndices\""));
    ASSERT_NE(at, std::string::npos);
    text.replace(at, 3, "NOT");
    writeFile(folder / "unused.glb", Bytes(text.begin(), text.end()));
    for (const char *option : {"--require-micromaps", "--strict"}) {
        const Outcome none = runVellum({"verify", (folder / "unused.glb").string(), option});
        EXPECT_EQ(none.exitCode, 7) << none.output << none.errors;
        EXPECT_TRUE(has(none.output, "no primitive has a micromap")) << none.output;
    }
    EXPECT_EQ(runVellum({"verify", (folder / "unused.glb").string()}).exitCode, 0);
    // A claim that is wrong comes first.
    change(card, State::Opaque, State::Transparent);
    EXPECT_EQ(verify(card, {"--require-micromaps"}).exitCode, 4);
}

TEST_F(VerifyCommand, SeveralFilesEndWithTheirSum)
{
    writeFile(folder / "fine.glb", card.bytes());
    CardFile plain = card;
    plain.extension = false;
    writeFile(folder / "plain.glb", plain.bytes());
    CardFile wrong = card;
    change(wrong, State::Opaque, State::Transparent);
    writeFile(folder / "wrong.glb", wrong.bytes());
    const Outcome outcome = runVellum({"verify", "--require-micromaps", folder.path().string()});
    EXPECT_EQ(outcome.exitCode, 4);
    EXPECT_TRUE(
        outcome.output.ends_with("\n3 files: 1 fine, 1 with wrong claims, 1 without micromaps; exit status 4\n"))
        << outcome.output;
    const Outcome quiet = runVellum({"verify", "--require-micromaps", "-q", folder.path().string()});
    EXPECT_EQ(quiet.output, "");
    EXPECT_EQ(quiet.errors, "vellum: " + (folder / "plain.glb").string() +
                                ": no micromaps\nvellum: " + (folder / "wrong.glb").string() + ": 1 wrong claim\n");
    EXPECT_FALSE(has(runVellum({"verify", (folder / "fine.glb").string()}).output, "1 file")) << "of one file";
}

TEST_F(VerifyCommand, ReportsABrokenStructure)
{
    card.usageCounts = "[9]";
    const Outcome outcome = verify(card);
    EXPECT_EQ(outcome.exitCode, 3);
    EXPECT_TRUE(has(outcome.output, "structure: micromaps[0]: ")) << outcome.output;
}

TEST_F(VerifyCommand, TwoStateDataIsAnApproximation)
{
    BakeOptions options;
    options.format = Format::TwoState;
    const CardFile two = baked(options);
    const Outcome loose = verify(two);
    EXPECT_EQ(loose.exitCode, 0);
    EXPECT_TRUE(has(loose.output, "an approximation: 128 micro-triangles")) << loose.output;
    EXPECT_EQ(verify(two, {"--strict-2-state"}).exitCode, 4);
}

TEST_F(VerifyCommand, UnreadableFilesGiveOneLine)
{
    const Outcome none = runVellum({"verify", (folder / "none.glb").string()});
    EXPECT_EQ(none.exitCode, 1);
    EXPECT_EQ(none.errorLines(), 1);
    EXPECT_TRUE(has(none.errors, "none.glb")) << none.errors;
    // The other files are verified nevertheless, and the exit code is that of the worst result.
    change(card, State::Opaque, State::Transparent);
    const Outcome both = verify(card, {(folder / "none.glb").string()});
    EXPECT_EQ(both.exitCode, 1);
    EXPECT_TRUE(has(both.output, "wrong: ")) << both.output;
    EXPECT_EQ(verify(card, {"--value-tolerance", "nan"}).exitCode, 2);
    EXPECT_EQ(verify(card, {"--subtexel-tolerance", "-1"}).exitCode, 2);
}

TEST_F(VerifyCommand, PrintsJsonForMachines)
{
    const uint32_t micro = change(card, State::Opaque, State::Transparent);
    const Outcome outcome = verify(card, {"--json", (folder / "none \"quoted\".glb").string()});
    EXPECT_EQ(outcome.exitCode, 1);
    const JsonTree tree(outcome.output);
    const std::vector<JsonValue> files = tree.root()["files"].children();
    ASSERT_EQ(files.size(), 2u);
    EXPECT_EQ(files[0]["exitCode"].integer(), 4);
    EXPECT_EQ(files[0]["extension"].string(), "EXT_mesh_opacity_micromap");
    EXPECT_EQ(files[0]["counts"]["wrong"].integer(), 1);
    EXPECT_EQ(files[0]["counts"]["microTriangles"].integer(), 128);
    EXPECT_EQ(files[0]["level4State"].integer(), 3);
    const std::vector<JsonValue> primitives = files[0]["primitives"].children();
    ASSERT_EQ(primitives.size(), 1u);
    EXPECT_EQ(primitives[0]["primitive"].string(), "mesh 0 \"leaves\" primitive 0");
    const std::vector<JsonValue> findings = primitives[0]["findings"].children();
    ASSERT_EQ(findings.size(), 1u);
    EXPECT_EQ(findings[0]["kind"].string(), "wrong");
    EXPECT_EQ(findings[0]["microTriangle"].integer(), micro);
    EXPECT_EQ(findings[0]["state"].string(), "transparent");
    EXPECT_EQ(findings[0]["uv"].children().size(), 2u);
    EXPECT_EQ(files[1]["exitCode"].integer(), 1);
    EXPECT_EQ(files[1]["file"].string(), (folder / "none \"quoted\".glb").string());
    EXPECT_TRUE(files[1]["error"].exists());
    card.usageCounts = "[9]";
    const std::string text = verify(card, {"--json"}).output;
    const JsonTree broken(text);
    EXPECT_EQ(broken.root()["files"].children().at(0)["exitCode"].integer(), 3);
}

// Micromaps are verified against one material; other materials may be drawn.
TEST_F(VerifyCommand, StrictTakesCautionsForOpenClaims)
{
    card.material += R"(, "extensions": {"KHR_materials_pbrSpecularGlossiness": {"glossinessFactor": 1}})";
    EXPECT_EQ(verify(card).exitCode, 0);
    const Outcome strict = verify(card, {"--strict"});
    EXPECT_EQ(strict.exitCode, 5);
    EXPECT_TRUE(has(strict.output, "caution: mesh 0 \"leaves\" primitive 0")) << strict.output;
    EXPECT_TRUE(has(strict.output, "KHR_materials_pbrSpecularGlossiness: verified without it\n")) << strict.output;
}

TEST_F(VerifyCommand, AFileThatCannotBeReadIsReportedOnce)
{
    const Outcome outcome = runVellum({"verify", (folder / "none.glb").string()});
    EXPECT_EQ(outcome.exitCode, 1);
    EXPECT_EQ(outcome.output, "");
    EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
}
