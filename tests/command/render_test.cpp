// What `vellum render` draws and counts, by ray queries and by a ray tracing pipeline.
#include <fstream>
#include <iterator>

#include <gtest/gtest.h>

#include "command.h"
#include "glb_file.h"

using namespace vellum::test;

namespace
{

Bytes readFile(const std::filesystem::path &path)
{
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

// The line of the output that begins so.
std::string lineOf(const Outcome &outcome, const std::string &beginning)
{
    const std::size_t at = outcome.output.find("\n" + beginning);
    if (at == std::string::npos)
        return {};
    return outcome.output.substr(at + 1, outcome.output.find('\n', at + 1) - at - 1);
}

class Rendering : public testing::Test
{
protected:
    // A small picture of the grove: leaves, solid wood, ground and sky.
    [[nodiscard]] Outcome render(const std::string &trace, std::vector<std::string> more) const
    {
        std::vector<std::string> arguments = {"render", "--trace", trace, "--size", "96x64", "--frames", "1"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        Outcome outcome = runVellum(arguments);
        EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
        EXPECT_EQ(outcome.errors, "");
        return outcome;
    }

    TemporaryFolder folder;
};

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

INSTANTIATE_TEST_SUITE_P(Traces, RenderingBy, testing::Values("query", "pipeline"),
                         [](const auto &test) { return test.param; });

TEST_F(Rendering, IsTheSameByQueriesAndByPipelines)
{
    for (const bool heavy : {false, true}) {
        SCOPED_TRACE(heavy ? "heavy" : "plain");
        Bytes pictures[2];
        std::string candidates[2];
        for (const std::size_t i : {std::size_t{0}, std::size_t{1}}) {
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
