// SPDX-License-Identifier: Apache-2.0
// Pictures and counts of `vellum render`, by ray queries and by a ray tracing pipeline.
#include <tuple>

#include "rendering.h"

using namespace vellum::test;

namespace
{

class RenderingBy : public Rendering, public testing::WithParamInterface<std::string>
{
};

} // namespace

TEST_P(RenderingBy, MicromapsChangeNoPixel)
{
    const std::vector<std::vector<std::string>> variants = {{"--level", "2"}, {"--level", "5", "--heavy"}};
    for (std::vector<std::string> more : variants) {
        SCOPED_TRACE("level " + more[1]);
        more.insert(more.end(), {"--mode", "compare", "--output", (folder / "picture.png").string()});
        const Outcome outcome = render(GetParam(), more);
        EXPECT_NE(lineOf(outcome, "| differing pixels").find(" 0 |"), std::string::npos) << outcome.output;
    }
}

// Both extensions give the same pictures with equally many shader calls. Ignored micromaps change no pixel either.
TEST_P(RenderingBy, EitherExtensionIsTheSame)
{
    const std::filesystem::path output = folder / "picture.png";
    const auto drawn = [&](std::vector<std::string> more) {
        more.insert(more.end(), {"--level", "4", "--output", output.string()});
        const Outcome outcome = render(GetParam(), more);
        return std::tuple(outcome, readFile(output), lineOf(outcome, "candidates"));
    };
    const auto [alpha, alphaPicture, alphaCandidates] = drawn({"--mode", "alpha"});
    const auto [khr, khrPicture, khrCandidates] = drawn({"--api", "khr"});
    const auto [ext, extPicture, extCandidates] = drawn({"--api", "ext"});
    EXPECT_NE(lineOf(khr, "micromaps").find("VK_KHR_opacity_micromap"), std::string::npos) << khr.output;
    EXPECT_NE(lineOf(ext, "micromaps").find("VK_EXT_opacity_micromap"), std::string::npos) << ext.output;
    EXPECT_FALSE(khrPicture.empty());
    EXPECT_TRUE(khrPicture == extPicture);
    EXPECT_TRUE(khrPicture == alphaPicture);
    EXPECT_NE(khrCandidates, "");
    EXPECT_EQ(khrCandidates, extCandidates);
    EXPECT_NE(khrCandidates, alphaCandidates);
}

INSTANTIATE_TEST_SUITE_P(Traces, RenderingBy, testing::Values("query", "pipeline"),
                         [](const auto &test) { return test.param; });

TEST_F(Rendering, UsesKhrByDefault)
{
    const Outcome outcome = render("query", {"--level", "2", "--output", (folder / "picture.png").string()});
    EXPECT_NE(lineOf(outcome, "micromaps").find("VK_KHR_opacity_micromap"), std::string::npos) << outcome.output;
    const std::string help = runVellum({"render", "--help"}).output;
    const size_t option = help.find("--api");
    ASSERT_NE(option, std::string::npos) << help;
    EXPECT_LT(help.find("[khr]", option), help.find("  -", option)) << help;
}

TEST_F(Rendering, ToStdout)
{
    const std::filesystem::path output = folder / "picture.png";
    const std::vector<std::string> options = {"--level", "2", "--frames", "1", "-o"};
    const auto with = [&](std::vector<std::string> all, const std::string &file) {
        all.insert(all.end(), options.begin(), options.end());
        all.push_back(file);
        return all;
    };
    const Outcome toFile = render(with({}, output.string()));
    const Outcome outcome = runVellum(with({"render", "--size", "96x64"}, "-"));
    EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
    EXPECT_TRUE(Bytes(outcome.output.begin(), outcome.output.end()) == readFile(output));
    EXPECT_EQ(lineOf({0, 0, outcome.errors, ""}, "micromaps"), lineOf(toFile, "micromaps"));
    EXPECT_FALSE(std::filesystem::exists("-"));
}

TEST_F(Rendering, IsTheSameByQueriesAndByPipelines)
{
    for (const bool heavy : {false, true}) {
        SCOPED_TRACE(heavy ? "heavy" : "plain");
        Bytes pictures[2];
        std::string candidates[2];
        for (const size_t i : {size_t{0}, size_t{1}}) {
            const std::filesystem::path output = folder / "picture.png";
            std::vector<std::string> more = {"--mode", "alpha", "--samples", "2", "--output", output.string()};
            if (heavy)
                more.push_back("--heavy");
            candidates[i] = lineOf(render(i == 0 ? "query" : "pipeline", more), "candidates");
            pictures[i] = readFile(output);
        }
        EXPECT_FALSE(pictures[0].empty());
        EXPECT_TRUE(pictures[0] == pictures[1]);
        EXPECT_NE(candidates[0], "");
        EXPECT_EQ(candidates[0], candidates[1]);
    }
}
