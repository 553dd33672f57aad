// SPDX-License-Identifier: Apache-2.0
// `vellum render --mode heat`, and the colours of its maps.
#include <cmath>
#include <fstream>
#include <iterator>

#include "png_file.h"
#include "render/heat.h"
#include "rendering.h"

using namespace vellum;
using namespace vellum::test;

namespace
{

// Lightness by CIE 1976, 0 to 100, which is not how the colours are made.
double lightnessOf(uint32_t pixel)
{
    const double weights[3] = {0.2126, 0.7152, 0.0722};
    double luminance = 0;
    for (unsigned channel = 0; channel < 3; ++channel) {
        const double x = ((pixel >> (8 * channel)) & 255) / 255.0;
        luminance += weights[channel] * (x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4));
    }
    return luminance > 0.008856 ? 116 * std::cbrt(luminance) - 16 : 903.3 * luminance;
}

class Heat : public Rendering
{
protected:
    Png draw(std::vector<std::string> options)
    {
        options.insert(options.end(), {"--mode", "heat", "--level", "5", "--output", (folder / "a.png").string()});
        outcome = render(std::move(options));
        return readPng(folder / "a.png");
    }
    // The mean in a line like "candidates  1.720 per pixel on average, at most 36, without micromaps".
    [[nodiscard]] double meanOf(const char *which) const
    {
        const size_t end = outcome.output.find(which);
        const size_t begin = outcome.output.rfind("candidates  ", end);
        return end == std::string::npos || begin == std::string::npos ? -1
                                                                      : std::stod(outcome.output.substr(begin + 12));
    }

    Outcome outcome;
};

uint32_t pixelOf(const Rgb &color)
{
    return static_cast<uint32_t>(color.red) | static_cast<uint32_t>(color.green) << 8 |
           static_cast<uint32_t>(color.blue) << 16 | 0xff000000u;
}

} // namespace

TEST(HeatColors, GetLighterByEvenSteps)
{
    EXPECT_LT(lightnessOf(render::heatColor(0)), 3);
    EXPECT_GT(lightnessOf(render::heatColor(1)), 90);
    for (int i = 0; i < 20; ++i) {
        const double step = lightnessOf(render::heatColor(static_cast<float>(i + 1) / 20)) -
                            lightnessOf(render::heatColor(static_cast<float>(i) / 20));
        EXPECT_GT(step, 1) << i;
        EXPECT_LT(step, 8) << i;
    }
    EXPECT_EQ(render::heatColor(-1), render::heatColor(0));
    EXPECT_EQ(render::heatColor(2), render::heatColor(1));
}

TEST(HeatColors, TheScaleLeavesOutFewPixels)
{
    std::vector<float> values(10000, 3);
    values[17] = 500;
    EXPECT_EQ(render::heatScale({{100, 100, values, ""}}), 3);
    EXPECT_EQ(render::heatScale({{1, 1, {0}, ""}}), 1);
}

TEST_F(Heat, HasTitlesAndALegendAsAnSvg)
{
    const std::filesystem::path file = folder / "a.svg";
    ASSERT_EQ(render({"--mode", "heat", "--side-by-side", "--level", "3", "--output", file.string()}).exitCode, 0);
    std::ifstream stream(file);
    const std::string svg{std::istreambuf_iterator<char>(stream), {}};
    for (const char *text : {">without m", ">with m", ">candidates per pixel<", ">0<"})
        EXPECT_NE(svg.find(text), std::string::npos) << text;
}

TEST_F(Heat, WithoutAndWithMicromapsInOneScale)
{
    for (const char *trace : {"query", "pipeline"}) {
        const Png png = draw({"--trace", trace, "--side-by-side"});
        EXPECT_EQ(png.width, 192u);
        EXPECT_EQ(png.height, render::kHeatHead + 64 + render::kHeatFoot); // titles and legend
        const double without = meanOf("without micromaps");
        const double with = meanOf(", with micromaps");
        EXPECT_GT(without, 0.2) << outcome.output;
        EXPECT_GT(with, 0) << outcome.output;
        EXPECT_LT(with, 0.5 * without) << outcome.output;

        // The halves of the picture say the same: how many pixels are dark, with no candidate at all.
        size_t dark[2] = {};
        for (size_t y = render::kHeatHead; y < render::kHeatHead + 64; ++y)
            for (size_t x = 0; x < 192; ++x)
                dark[x / 96] += pixelOf(png.pixels[y * 192 + x]) == render::heatColor(0) ? 1u : 0u;
        EXPECT_GT(dark[0], 500u) << trace; // the sky
        EXPECT_GT(dark[1], dark[0] + 200) << trace;
    }
}
