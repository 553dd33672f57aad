// SPDX-License-Identifier: Apache-2.0
// `vellum render` of files that have micromaps.
#include "rendering.h"

using namespace vellum::test;

namespace
{

class StoredMicromaps : public Rendering
{
protected:
    // Bakes the card into card.omm.glb.
    void bake(const Replacements &replacements = {}, const std::vector<std::string> &options = {})
    {
        writeFile(folder / "card.glb", cardGlb(replacements));
        std::vector<std::string> arguments = {"bake", (folder / "card.glb").string(), "--level", "4"};
        arguments.insert(arguments.end(), options.begin(), options.end());
        const Outcome outcome = runVellum(arguments);
        ASSERT_EQ(outcome.exitCode, 0) << outcome.errors;
    }
    Outcome compare(std::vector<std::string> options = {})
    {
        options.insert(options.end(), {(folder / "card.omm.glb").string(), "--mode", "compare", "--frames", "1",
                                       "--output", (folder / "a.png").string()});
        return render(std::move(options));
    }
};

const char *const kNone = "| differing pixels               |              |            0 |  0.0000 % |";

} // namespace

TEST_F(StoredMicromaps, UsedUnlessABakeIsRequested)
{
    bake();
    const Outcome stored = compare();
    EXPECT_NE(lineOf(stored, "in the file").find("1 geometry by EXT_mesh_opacity_micromap"), std::string::npos)
        << stored.output;
    EXPECT_EQ(lineOf(stored, "baked"), "");
    EXPECT_EQ(lineOf(stored, "| differing"), kNone);
    for (const std::vector<std::string> &options :
         {std::vector<std::string>{"--bake"}, {"--level", "2"}, {"--states", "4"}}) {
        const Outcome baked = compare(options);
        EXPECT_NE(lineOf(baked, "baked"), "") << baked.output;
        EXPECT_EQ(lineOf(baked, "in the file"), "");
        EXPECT_EQ(lineOf(baked, "| differing"), kNone);
    }
}

TEST_F(StoredMicromaps, AFileWithoutThemIsNotBakedSilently)
{
    bake();
    writeFile(folder / "card.omm.glb", readFile(folder / "card.glb"));
    EXPECT_NE(lineOf(compare(), "baked").find("for this picture, as the file has no micromaps: level auto"),
              std::string::npos);
    EXPECT_EQ(lineOf(compare({"--bake"}), "baked").find("as the file has no micromaps"), std::string::npos);
    EXPECT_NE(compare({"--json"}).output.find("\"baked\": true"), std::string::npos);
    bake();
    EXPECT_NE(compare({"--json"}).output.find("\"baked\": false"), std::string::npos);
}

// As by vellum bake: only with --blend.
TEST_F(StoredMicromaps, BlendOnRequest)
{
    const Replacements blend = {{"\"alphaMode\": \"MASK\", \"alphaCutoff\": 0.25", "\"alphaMode\": \"BLEND\""}};
    bake(blend, {"--blend", "--blend-cutoff", "0.25"});
    const auto cutoff = [](const std::string &text) {
        return "blending    none: 1 geometry with alphaMode BLEND is masked with the cutoff " + text;
    };
    const Outcome stored = compare();
    EXPECT_EQ(lineOf(stored, "blending"), cutoff("0.25"));
    EXPECT_EQ(lineOf(stored, "alpha test"), "");
    EXPECT_EQ(lineOf(stored, "| differing"), kNone);
    // In every mode, the cutoff is that of the file.
    const Outcome skipped = compare({"--bake"});
    EXPECT_EQ(lineOf(skipped, "blending"), cutoff("0.25"));
    const Outcome alpha = render({(folder / "card.omm.glb").string(), "--mode", "alpha", "--frames", "1", "--output",
                                  (folder / "a.png").string()});
    EXPECT_EQ(lineOf(alpha, "blending"), cutoff("0.25"));
    EXPECT_EQ(lineOf(skipped, "alpha test"), "alpha test  alone for 1 geometry with alphaMode BLEND; --blend bakes it");
    const auto known = [&](const std::vector<std::string> &options) {
        const Outcome outcome = compare(options);
        EXPECT_EQ(lineOf(outcome, "alpha test"), "");
        EXPECT_EQ(lineOf(outcome, "| differing"), kNone);
        return lineOf(outcome, "surface");
    };
    // The largest alpha, 0.75, is unknown without a cutoff.
    EXPECT_NE(known({"--blend"}), known({"--blend", "--blend-cutoff", "0.5"}));
    EXPECT_EQ(known({"--blend", "--blend-cutoff", "0.25", "--level", "4"}), lineOf(stored, "surface"));
}

// The two opaque micromap triangles of other indices make a picture that differs: what the file says is what is traced.
TEST_F(StoredMicromaps, WrongClaimsAreSeen)
{
    bake();
    Bytes file = readFile(folder / "card.omm.glb");
    std::string text(file.begin(), file.end());
    // Replaces the baked texture by one that is transparent where it was opaque.
    const size_t at = text.find("\"alphaCutoff\": 0.25");
    ASSERT_NE(at, std::string::npos);
    text.replace(at, 19, "\"alphaCutoff\": 0.95");
    writeFile(folder / "card.omm.glb", Bytes(text.begin(), text.end()));
    EXPECT_NE(lineOf(compare(), "| differing"), kNone);
}

TEST_F(StoredMicromaps, InstancesMirroredAndFlattened)
{
    bake({{"\"scenes\": [{\"nodes\": [0]}]", "\"scenes\": [{\"nodes\": [0, 1, 2, 3]}]"},
          {"\"nodes\": [{\"mesh\": 0, \"translation\": [0, 2, 0]}]",
           "\"nodes\": [{\"mesh\": 0, \"translation\": [0, 2, 0]}, {\"mesh\": 0, \"scale\": [-1, 1, 1]}, "
           "{\"mesh\": 0, \"translation\": [3, 0, 1], \"scale\": [1, 3, 0.5]}, {\"mesh\": 0, \"scale\": [0, 0, 0]}]"}});
    const Outcome outcome = compare();
    EXPECT_NE(lineOf(outcome, "scene").find("6 masked and 3 solid triangles, 3 instances of 1 mesh"), std::string::npos)
        << outcome.output;
    EXPECT_EQ(lineOf(outcome, "| differing"), kNone);
}

TEST_F(StoredMicromaps, DamagedOnesNeverReachTheDevice)
{
    bake();
    Bytes file = readFile(folder / "card.omm.glb");
    std::string text(file.begin(), file.end());
    const std::string levels = "\"usageLevels\":[4]";
    const size_t at = text.find(levels);
    ASSERT_NE(at, std::string::npos);
    text.replace(at, levels.size(), "\"usageLevels\":[9]");
    writeFile(folder / "card.omm.glb", Bytes(text.begin(), text.end()));
    const Outcome outcome =
        runVellum({"render", (folder / "card.omm.glb").string(), "--output", (folder / "a.png").string()});
    EXPECT_EQ(outcome.exitCode, 1) << outcome.output;
    EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
    EXPECT_NE(outcome.errors.find("micromaps[0]"), std::string::npos) << outcome.errors;
    EXPECT_FALSE(std::filesystem::exists(folder / "a.png"));
}

// The alpha of vertices counts, and geometries with it are tested by the shader alone.
TEST_F(StoredMicromaps, VertexAlphas)
{
    // The texture's coordinates as colours: red and green, blue from the next, alpha below 1 for some.
    bake({{"\"TEXCOORD_0\": 1}", "\"TEXCOORD_0\": 1, \"COLOR_0\": 4}"},
          {"{\"bufferView\": 0, \"byteOffset\": 12, \"componentType\": 5126, \"count\": 3, \"type\": \"VEC3\"}]",
           "{\"bufferView\": 0, \"byteOffset\": 12, \"componentType\": 5126, \"count\": 3, \"type\": \"VEC3\"}, "
           "{\"bufferView\": 3, \"componentType\": 5121, \"normalized\": true, \"count\": 4, \"type\": \"VEC4\"}]"}});
    EXPECT_EQ(lineOf(compare(), "| differing"), kNone);
    const Outcome baked = compare({"--bake"});
    EXPECT_EQ(lineOf(baked, "alpha test"),
              "alpha test  alone for 1 masked geometry without micromaps, whose vertices have alphas");
    EXPECT_EQ(lineOf(baked, "| differing"), kNone);
}
