// SPDX-License-Identifier: Apache-2.0
// `vellum render --mode states`: which colours its pictures have.
#include <algorithm>
#include <cmath>

#include "png_file.h"
#include "rendering.h"

using namespace vellum::test;

namespace
{

constexpr Rgb kTransparent = {0x56, 0xb4, 0xe9};
constexpr Rgb kOpaque = {0x00, 0x72, 0xb2};
constexpr Rgb kUnknownTransparent = {0xf0, 0xe4, 0x42};
constexpr Rgb kUnknownOpaque = {0xd5, 0x5e, 0x00};

bool near(double a, double b)
{
    return std::abs(a - b) <= 1.5;
}

// A state's colour, as light as the light makes it.
bool isShadeOf(const Rgb &pixel, const Rgb &color)
{
    const double light = static_cast<double>(std::max({pixel.red, pixel.green, pixel.blue})) /
                         std::max({color.red, color.green, color.blue});
    return light > 0.2 && near(pixel.red, light * color.red) && near(pixel.green, light * color.green) &&
           near(pixel.blue, light * color.blue);
}

bool isGrey(const Rgb &pixel)
{
    return near(pixel.red, pixel.green) && near(pixel.green, pixel.blue);
}

// Grey behind a veil: what is apart in the pixel's channels comes from the veil alone.
bool isVeiledGrey(const Rgb &pixel)
{
    constexpr double kVeil = 0.35;
    return near(pixel.blue - pixel.red, kVeil * (kTransparent.blue - kTransparent.red)) &&
           near(pixel.green - pixel.red, kVeil * (kTransparent.green - kTransparent.red));
}

class States : public Rendering
{
protected:
    Png draw(std::vector<std::string> options)
    {
        options.insert(options.end(), {"--mode", "states", "--zoom", "2", "--output", (folder / "a.png").string()});
        outcome = render(std::move(options));
        return readPng(folder / "a.png");
    }

    Outcome outcome;
};

long countShades(const Png &png, const Rgb &color)
{
    return std::count_if(png.pixels.begin(), png.pixels.end(), [&](const Rgb &p) { return isShadeOf(p, color); });
}

long countVeils(const Png &png)
{
    return std::count_if(png.pixels.begin(), png.pixels.end(), isVeiledGrey);
}

} // namespace

TEST_F(States, AllAreThereAtLevel7)
{
    const Png png = draw({"--level", "7"});
    EXPECT_EQ(png.width, 96u);
    EXPECT_EQ(png.height, 64u);
    EXPECT_GT(countShades(png, kOpaque), 100);
    EXPECT_GT(countShades(png, kUnknownOpaque), 0);
    EXPECT_GT(countShades(png, kUnknownTransparent), 0);
    EXPECT_GT(countVeils(png), 20);
    EXPECT_GT(std::count_if(png.pixels.begin(), png.pixels.end(), isGrey), 500); // sky, ground and wood
    EXPECT_EQ(lineOf(outcome, "states"), "states      opaque #0072b2, transparent #56b4e9 (a veil), unknown: opaque "
                                         "#d55e00, transparent #f0e442");
}

// A whole card is one micro-triangle, of which nothing is known.
TEST_F(States, OnlyUnknownOnesAtLevel0)
{
    const Png png = draw({"--level", "0"});
    EXPECT_EQ(countShades(png, kOpaque), 0);
    EXPECT_EQ(countVeils(png), 0);
    EXPECT_GT(countShades(png, kUnknownOpaque) + countShades(png, kUnknownTransparent), 500);
}

TEST_F(States, NoneIsUnknownInTheTwoStateFormat)
{
    const Png png = draw({"--level", "6", "--states", "2"});
    EXPECT_GT(countShades(png, kOpaque), 100);
    EXPECT_EQ(countShades(png, kUnknownOpaque), 0);
    EXPECT_EQ(countShades(png, kUnknownTransparent), 0);
    EXPECT_GT(countVeils(png), 20);
}

TEST_F(States, NeedNoMicromapsOfTheDevice)
{
    const Png png = draw({"--level", "5", "--no-layer"});
    EXPECT_GT(countShades(png, kOpaque), 100);
    EXPECT_NE(lineOf(outcome, "micromaps").find("drawn, not used by the rays"), std::string::npos) << outcome.output;
}

TEST_F(States, SideBySideWithThePictureByMicromaps)
{
    const Png states = draw({"--level", "5"});
    const Png both = draw({"--level", "5", "--side-by-side"});
    EXPECT_NE(lineOf(outcome, "micromaps").find("VK_KHR_opacity_micromap"), std::string::npos) << outcome.output;
    (void)render("query", {"--level", "5", "--zoom", "2", "--output", (folder / "b.png").string()});
    const Png drawn = readPng(folder / "b.png");
    ASSERT_EQ(both.width, 192u);
    ASSERT_EQ(both.height, 64u);
    ASSERT_EQ(drawn.pixels.size(), 96u * 64u);
    EXPECT_FALSE(drawn.pixels == states.pixels);
    for (size_t y = 0; y < 64; ++y) {
        for (size_t x = 0; x < 96; ++x) {
            ASSERT_TRUE(both.pixels[y * 192 + x] == drawn.pixels[y * 96 + x]) << x << ", " << y;
            ASSERT_TRUE(both.pixels[y * 192 + 96 + x] == states.pixels[y * 96 + x]) << x << ", " << y;
        }
    }
}

// What has no micromap is grey, and as large as in the picture: its alpha is tested.
TEST_F(States, WithoutAMicromapAlphaIsTested)
{
    writeFile(folder / "card.glb",
              cardGlb({{"\"alphaMode\": \"MASK\", \"alphaCutoff\": 0.25", "\"alphaMode\": \"BLEND\""}}));
    const Png both = draw({(folder / "card.glb").string(), "--side-by-side"});
    EXPECT_NE(lineOf(outcome, "alpha test"), "") << outcome.output;
    ASSERT_EQ(both.width, 192u);
    for (size_t y = 0; y < 64; ++y) {
        for (size_t x = 0; x < 96; ++x) {
            const Rgb &lit = both.pixels[y * 192 + x];
            const double grey = 0.35 * 255 + 0.6 * (0.30 * lit.red + 0.59 * lit.green + 0.11 * lit.blue);
            ASSERT_NEAR(both.pixels[y * 192 + 96 + x].green, grey, 2) << x << ", " << y;
        }
    }
}
