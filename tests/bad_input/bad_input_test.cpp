// SPDX-License-Identifier: Apache-2.0
// Whatever the command is given: one clear line on stderr, exit code not 0, and no file left behind.
#include <algorithm>

#include <gtest/gtest.h>

#include "command.h"
#include "glb_file.h"

using namespace vellum::test;

namespace
{

class BadInput : public testing::Test
{
protected:
    // Renders `file` and checks the manners of the failure. `words` must be in the message.
    void expectRejection(const std::filesystem::path &file, const std::string &words)
    {
        const size_t before = files();
        const Outcome outcome =
            runVellum({"render", file.string(), "--mode", "alpha", "--size", "64x64", "--output", output().string()});
        expectManners(outcome, words);
        EXPECT_EQ(files(), before) << "something was left behind";
    }

    static void expectManners(const Outcome &outcome, const std::string &words)
    {
        EXPECT_GT(outcome.exitCode, 0);
        EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
        EXPECT_EQ(outcome.errors.rfind("vellum: ", 0), 0u) << outcome.errors;
        EXPECT_NE(outcome.errors.find(words), std::string::npos) << outcome.errors;
    }

    [[nodiscard]] std::filesystem::path write(const Bytes &bytes) const
    {
        writeFile(folder / "test.glb", bytes);
        return folder / "test.glb";
    }
    [[nodiscard]] std::filesystem::path output() const { return folder / "picture.png"; }
    [[nodiscard]] size_t files() const
    {
        return static_cast<size_t>(std::distance(std::filesystem::directory_iterator(folder.path()), {}));
    }

    TemporaryFolder folder;
};

} // namespace

TEST_F(BadInput, MissingFile)
{
    expectRejection(folder / "missing.glb", "no such file");
    expectRejection(folder.path(), "not a file");
}

TEST_F(BadInput, TruncatedFile)
{
    const Bytes whole = cardGlb();
    for (const size_t length :
         {size_t{0}, size_t{3}, size_t{11}, size_t{19}, size_t{500}, whole.size() / 2, whole.size() - 1}) {
        SCOPED_TRACE(length);
        const std::string words = length == 0 ? "empty" : length == 3 ? "neither" : "truncated";
        expectRejection(write(Bytes(whole.begin(), whole.begin() + static_cast<ptrdiff_t>(length))), words);
    }
}

TEST_F(BadInput, Garbage)
{
    Bytes noise;
    for (uint32_t i = 0; i < 5000; ++i)
        noise.push_back(static_cast<uint8_t>((i * 2654435761u) >> 24));
    expectRejection(write(noise), "neither a GLB nor a glTF file");
    Bytes behindMagic = cardGlb();
    std::copy_n(noise.begin(), behindMagic.size() - 20, behindMagic.begin() + 20);
    expectRejection(write(behindMagic), "test.glb: ");
    expectRejection(write({'{', '"', 'a'}), "test.glb: ");
}

TEST_F(BadInput, MaskedWithoutTextureCoordinates)
{
    expectRejection(write(cardGlb({{", \"TEXCOORD_0\": 1", ""}})), "no texture coordinates");
}

TEST_F(BadInput, RejectsFilesThatAreNoImages)
{
    expectRejection(write(cardGlb({{"\"byteOffset\": 92, ", "\"byteOffset\": 60, "}})), "cannot be decoded");
}

TEST_F(BadInput, IndicesOutOfRange)
{
    expectRejection(write(cardGlb({{"{\"bufferView\": 0, \"componentType\": 5126, \"count\": 4",
                                    "{\"bufferView\": 0, \"componentType\": 5126, \"count\": 3"}})),
                    "index 3 of 3 vertices");
}

TEST_F(BadInput, UnwritableOutput)
{
    for (const std::filesystem::path &path : {folder / "no/such/folder/picture.png", folder / "no/such/"}) {
        const Outcome outcome = runVellum({"render", "--mode", "alpha", "--size", "16x16", "--output", path.string()});
        expectManners(outcome, "cannot be written");
    }
    EXPECT_EQ(files(), 0u);
}

TEST_F(BadInput, BadOptions)
{
    const std::vector<std::vector<std::string>> commands = {
        {"paint"},
        {"render", "--mode", "both"},
        {"render", "--mode", ""},
        {"render", "--mode", "0"},
        {"render", "--trace", "both"},
        {"render", "--trace", ""},
        {"render", "--trace", "1"},
        {"render", "--api", "vk"},
        {"render", "--api", "KHR"},
        {"render", "--api", ""},
        {"render", "--api", "0"},
        {"render", "--api"},
        {"render", "--level", "13"},
        {"render", "--level", "-1"},
        {"render", "--level", "seven"},
        {"render", "--states", "3"},
        {"render", "--size", "1280"},
        {"render", "--size", "0x720"},
        {"render", "--size", "-5x720"},
        {"render", "--size", "99999x99999"},
        {"render", "--instances", "0"},
        {"render", "--frames", "0"},
        {"render", "--mode", "states", "--trace", "pipeline"},
        {"render", "--mode", "states", "--frames", "3"},
        {"render", "--side-by-side"},
        {"render", "--mode", "compare", "--side-by-side"},
        {"render", "--samples", "1000"},
        {"render", "--zoom", "nan"},
        {"render", "--yaw", "inf"},
        {"render", "--nonsense"},
        {"render", "a.glb", "b.glb"},
    };
    for (std::vector<std::string> arguments : commands) {
        SCOPED_TRACE(arguments.back());
        if (arguments[0] == "render")
            arguments.insert(arguments.end(), {"--output", output().string()});
        const Outcome outcome = runVellum(arguments);
        expectManners(outcome, "");
        EXPECT_EQ(outcome.exitCode, 2);
    }
    EXPECT_EQ(files(), 0u);
}

TEST_F(BadInput, NoVulkanDevice)
{
    const std::vector<std::pair<std::string, std::string>> none = {{"VK_DRIVER_FILES", "/nonexistent"},
                                                                   {"VK_ICD_FILENAMES", "/nonexistent"}};
    for (const char *mode : {"alpha", "omm", "compare", "states"})
        expectManners(runVellum({"render", "--mode", mode, "--output", output().string()}, none), "Vulkan");
    EXPECT_EQ(files(), 0u);
}

TEST_F(BadInput, UnknownDevice)
{
    expectManners(runVellum({"render", "--device", "Voodoo 2", "--output", output().string()}), "Voodoo 2");
}

TEST_F(BadInput, MicromapsWithoutTheLayer)
{
    for (const std::string api : {"khr", "ext"}) {
        SCOPED_TRACE(api);
        const Outcome outcome = runVellum(
            {"render", "--no-layer", "--mode", "omm", "--api", api, "--size", "16x16", "--output", output().string()});
        const std::string name = api == "khr" ? "VK_KHR_opacity_micromap" : "VK_EXT_opacity_micromap";
        // A driver that has the extension itself accepts it.
        if (outcome.exitCode == 0)
            GTEST_SKIP() << "the driver has " << name;
        expectManners(outcome, "has no " + name);
    }
    EXPECT_EQ(files(), 0u);
}

TEST_F(BadInput, GoodInputWritesOnlyAPicture)
{
    const Outcome outcome = runVellum({"render", write(cardGlb()).string(), "--mode", "alpha", "--size", "48x32",
                                       "--frames", "1", "--output", output().string()});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_EQ(outcome.errors, "");
    EXPECT_EQ(files(), 2u);
    EXPECT_NE(outcome.output.find("device"), std::string::npos);
}

TEST_F(BadInput, HelpAndVersion)
{
    for (const auto &arguments : {std::vector<std::string>{"--version"}, {"--help"}, {"render", "--help"}}) {
        const Outcome outcome = runVellum(arguments);
        EXPECT_EQ(outcome.exitCode, 0);
        EXPECT_EQ(outcome.errors, "");
        EXPECT_FALSE(outcome.output.empty());
    }
}
