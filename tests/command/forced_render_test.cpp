// SPDX-License-Identifier: Apache-2.0
// `vellum render` without micromaps, through the forcing layer (tests/layer/forcing/forcing.h): the same pictures, by
// as many calls of the shader.
#include <tuple>

#include "rendering.h"

using namespace vellum::test;

namespace
{

using Variables = std::vector<std::pair<std::string, std::string>>;

struct Drawn {
    Bytes picture;
    std::string candidates;
    std::string errors; // on stderr, where the forcing layer says what it did
};

class ForcedRendering : public Rendering, public testing::WithParamInterface<std::tuple<const char *, const char *>>
{
protected:
    Drawn draw(const Variables &environment) const
    {
        const std::filesystem::path output = folder / "picture.png";
        const Outcome outcome = runVellum({"render", "--size", "96x64", "--frames", "1", "--mode", "alpha", "--trace",
                                           std::get<0>(GetParam()), "--output", output.string()},
                                          environment);
        EXPECT_EQ(outcome.exitCode, 0) << outcome.errors;
        return {readFile(output), lineOf(outcome, "candidates"), outcome.errors};
    }
    Drawn drawForced(const std::string &content) const
    {
        return draw({{"VK_ADD_LAYER_PATH", VELLUM_TEST_LAYER_PATH},
                     {"VK_INSTANCE_LAYERS", "VK_LAYER_VELLUM_test_forcing"},
                     {"VELLUM_FORCING", content},
                     {"VELLUM_FORCING_API", std::get<1>(GetParam())}});
    }
};

} // namespace

TEST_P(ForcedRendering, ChangesNothingUnlessItSaysTransparent)
{
    const Drawn bare = draw({});
    EXPECT_FALSE(bare.picture.empty());
    EXPECT_NE(bare.candidates, "");
    for (const char *content : {"mixed", "special"}) {
        SCOPED_TRACE(content);
        const Drawn forced = drawForced(content);
        EXPECT_TRUE(bare.picture == forced.picture);
        EXPECT_EQ(bare.candidates, forced.candidates);
        EXPECT_NE(forced.errors.find("forcing: 1 devices, 8 geometries"), std::string::npos) << forced.errors;
    }
    const Drawn nothing = drawForced("transparent");
    EXPECT_FALSE(bare.picture == nothing.picture);
    EXPECT_NE(bare.candidates, nothing.candidates);
}

INSTANTIATE_TEST_SUITE_P(Each, ForcedRendering,
                         testing::Combine(testing::Values("query", "pipeline"), testing::Values("ext", "khr")),
                         [](const auto &test) {
                             return std::string(std::get<0>(test.param)) + "_" + std::get<1>(test.param);
                         });
