// SPDX-License-Identifier: Apache-2.0
// `vellum inspect` as its user runs it.
#include <algorithm>
#include <fstream>
#include <iterator>

#include <gtest/gtest.h>

#include "command.h"
#include "glb_file.h"

using namespace vellum::test;

namespace
{

class InspectCommand : public testing::Test
{
protected:
    [[nodiscard]] std::filesystem::path write(const Bytes &bytes) const
    {
        writeFile(folder / "card.glb", bytes);
        return folder / "card.glb";
    }
    // Inspects it, and expects one line about what is wrong and nothing written.
    void expectRejection(const Bytes &bytes, const std::string &words, std::vector<std::string> more = {}) const
    {
        std::vector<std::string> arguments = {"inspect", write(bytes).string(), "--html", page().string()};
        arguments.insert(arguments.end(), more.begin(), more.end());
        const Outcome outcome = runVellum(arguments);
        EXPECT_GT(outcome.exitCode, 0);
        EXPECT_EQ(outcome.errorLines(), 1) << outcome.errors;
        EXPECT_NE(outcome.errors.find(words), std::string::npos) << outcome.errors;
        EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
    }
    [[nodiscard]] std::filesystem::path page() const { return folder / "card.html"; }
    static std::string text(const std::filesystem::path &path)
    {
        std::ifstream file(path, std::ios::binary);
        return {std::istreambuf_iterator<char>(file), {}};
    }

    TemporaryFolder folder;
};

} // namespace

TEST_F(InspectCommand, RejectsFilesWithoutMicromaps)
{
    expectRejection(cardGlb(), "no primitive has a micromap");
}

TEST_F(InspectCommand, RejectsOtherFiles)
{
    expectRejection({'n', 'o'}, "card.glb: ");
    Bytes damaged = cardGlb();
    damaged.resize(damaged.size() / 2);
    expectRejection(damaged, "card.glb: ");
    expectRejection(damaged, "card.glb: ", {"--bake"});
}

TEST_F(InspectCommand, RejectsWrongChoices)
{
    expectRejection(cardGlb(), "--triangle must be a number, a range like 3-9, or several with commas, got 3-",
                    {"--bake", "--triangle", "3-"});
    expectRejection(cardGlb(), "no triangle with a micromap", {"--bake", "--triangle", "77"});
    // Also if other meshes or materials of that list exist.
    expectRejection(cardGlb(), "there is no mesh 77", {"--bake", "--mesh", "0,77"});
    expectRejection(cardGlb(), "there is no material laef", {"--bake", "--material", "leaf", "--material", "laef"});
    expectRejection(cardGlb(), "--size", {"--bake", "--size", "7"});
    expectRejection(cardGlb(), "is not a directory", {"--bake", "--picture", (folder / "a" / "b.png").string()});
}

TEST_F(InspectCommand, WritesToStdout)
{
    const std::string card = write(cardGlb()).string();
    const std::string picture = (folder / "card.png").string();
    const std::vector<std::string> options = {"--bake", "--level", "3", "--size", "128"};
    const auto inspect = [&](std::vector<std::string> arguments) {
        arguments.insert(arguments.begin(), {"inspect", card});
        arguments.insert(arguments.end(), options.begin(), options.end());
        return runVellum(arguments);
    };
    EXPECT_EQ(inspect({"--html", page().string(), "--picture", picture}).exitCode, 0);
    const Outcome html = inspect({"-o", "-"});
    EXPECT_EQ(html.exitCode, 0) << html.errors;
    EXPECT_TRUE(html.output == text(page()));
    EXPECT_NE(html.errors.find("1 of 2 primitives"), std::string::npos) << html.errors;
    const Outcome png = inspect({"--picture", "-", "-q"});
    EXPECT_EQ(png.exitCode, 0) << png.errors;
    EXPECT_TRUE(png.output == text(picture));
    EXPECT_EQ(png.errors, "");
    EXPECT_FALSE(std::filesystem::exists("-"));
}

TEST_F(InspectCommand, LabelsASvg)
{
    const std::filesystem::path picture = folder / "card.svg";
    const std::vector<std::string> words = {"inspect", write(cardGlb()).string(), picture.string(), "--bake", "--size",
                                            "128"};
    const Outcome outcome = runVellum(words);
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    const std::string svg = text(picture);
    EXPECT_NE(svg.find("<image "), std::string::npos);
    EXPECT_NE(svg.find("unknown, opaque"), std::string::npos) << "the legend";
    EXPECT_EQ(runVellum(words).exitCode, 0) << "its own file is replaced";
    writeFile(picture, {'<', 's', 'v', 'g', '/', '>'});
    EXPECT_EQ(runVellum(words).exitCode, 1) << "another program's is not";
}

// A cutoff is that of a mask, or the one by which alphaMode BLEND was baked as one.
TEST_F(InspectCommand, NamesTheCutoffThatApplies)
{
    const std::string picture = (folder / "card.svg").string();
    const std::string blended =
        write(cardGlb({{R"("alphaMode": "MASK", "alphaCutoff": 0.25)", R"("alphaMode": "BLEND")"}})).string();
    const auto svgWith = [&](const std::vector<std::string> &cutoff) {
        std::vector<std::string> bake = {"bake", blended, (folder / "card.omm.glb").string(), "--blend"};
        bake.insert(bake.end(), cutoff.begin(), cutoff.end());
        EXPECT_EQ(runVellum(bake).exitCode, 0);
        EXPECT_EQ(runVellum({"inspect", bake[2], picture, "--size", "512"}).exitCode, 0);
        EXPECT_EQ(runVellum({"inspect", bake[2], "--html", page().string()}).exitCode, 0);
        return text(picture);
    };
    EXPECT_NE(svgWith({}).find("alphaMode BLEND"), std::string::npos);
    EXPECT_NE(svgWith({"--blend-cutoff", "0.3"}).find("cutoff 0.3"), std::string::npos);
}

TEST_F(InspectCommand, WritesPageAndPicture)
{
    const Outcome outcome = runVellum({"inspect", write(cardGlb()).string(), "--bake", "--html", page().string(),
                                       "--picture", (folder / "card.png").string(), "--size", "128"});
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_EQ(text(folder / "card.png").substr(1, 3), "PNG");
    const std::string html = text(page());
    EXPECT_EQ(html.rfind("<!DOCTYPE html>", 0), 0u);
    EXPECT_NE(html.find("</html>"), std::string::npos);
    EXPECT_EQ(html.find("<!--@"), std::string::npos) << "a part of the page is missing";
    EXPECT_EQ(html.find("http://"), std::string::npos);
    EXPECT_EQ(html.find("https://"), std::string::npos);
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 3) << "something was left behind";
}

TEST_F(InspectCommand, ShowsWhatTheFileHas)
{
    const std::filesystem::path baked = folder / "baked.glb";
    ASSERT_EQ(runVellum({"bake", write(cardGlb()).string(), "-o", baked.string()}).exitCode, 0);
    const Outcome stored = runVellum({"inspect", baked.string(), "--html", page().string()});
    EXPECT_EQ(stored.exitCode, 0) << stored.errors;
    EXPECT_NE(stored.output.find("EXT_mesh_opacity_micromap"), std::string::npos) << stored.output;
    // Except for the line about the file, the page equals that of baking in memory.
    const Outcome made = runVellum({"inspect", write(cardGlb()).string(), "--bake", "--html", page().string()});
    const auto afterFile = [](const std::string &output) { return output.substr(output.find("micromaps ")); };
    EXPECT_EQ(afterFile(stored.output), afterFile(made.output));
}

// The card's material is named so that the page would run a script of the file's author.
TEST_F(InspectCommand, NamesOfTheFileStayText)
{
    const Bytes file = cardGlb({{R"("name": "leaf")", R"("name": "</script><script>alert(1)</script>")"}});
    const Outcome outcome = runVellum({"inspect", write(file).string(), "--bake", "--html", page().string()});
    ASSERT_EQ(outcome.exitCode, 0) << outcome.errors;
    const std::string html = text(page());
    EXPECT_EQ(html.find("<script>alert"), std::string::npos);
    EXPECT_NE(html.find(R"(\u003cscript\u003ealert(1))"), std::string::npos);
}
