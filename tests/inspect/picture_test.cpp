// SPDX-License-Identifier: Apache-2.0
// Pixels of pictures in UV space, and what text in them takes.
#include <array>

#include <gtest/gtest.h>

#include "cli/inspect/drawing/uv_panel.h"
#include "cli/inspect/drawing/uv_picture.h"
#include "cli/picture/text.h"
#include "made_up_file.h"

using namespace vellum;
using namespace vellum::cli;
using namespace vellum::test;

namespace
{

// Red less blue of a pixel: above 0 for unknown states, below 0 for known ones, 0 for what is grey.
int warmth(const Picture &picture, double u, double v, const UvWindow &window)
{
    const auto x = static_cast<size_t>((u - window.left) * window.scale);
    const auto y = static_cast<size_t>((v - window.top) * window.scale);
    const uint32_t pixel = picture.pixels[y * picture.width + x];
    return static_cast<int>(pixel & 255) - static_cast<int>((pixel >> 16) & 255);
}

int brightness(const Picture &picture, size_t x, size_t y)
{
    const uint32_t pixel = picture.pixels[y * picture.width + x];
    return static_cast<int>((pixel & 255) + ((pixel >> 8) & 255) + ((pixel >> 16) & 255));
}

} // namespace

TEST(UvPicture, EachMicroTriangleHasItsState)
{
    const InspectedFile file = madeUpFile();
    const UvWindow window{0, 0, 400, 400, 400};
    const Picture picture = drawUvWindow(file, 0, window, true);
    for (uint32_t i = 0; i < 16; ++i) { // of the lower triangle, whose UVs are its barycentrics
        const auto corners = microTriangleCorners(i, 2);
        const double u = (corners[0].u + corners[1].u + corners[2].u) / 3;
        const double v = (corners[0].v + corners[1].v + corners[2].v) / 3;
        if (i % 4 >= 2)
            EXPECT_GT(warmth(picture, u, v, window), 30) << i;
        else
            EXPECT_LT(warmth(picture, u, v, window), -30) << i;
    }
}

TEST(UvPicture, NothingWhereNoTriangleIs)
{
    const InspectedFile file = madeUpFile();
    const UvWindow window{-1, 0, 50, 100, 50}; // from u = -1 to 1
    const Picture picture = drawUvWindow(file, 0, window, false);
    EXPECT_EQ(warmth(picture, -0.5, 0.5, window), 0);
    EXPECT_NE(warmth(picture, 0.3, 0.3, window), 0);
}

TEST(UvPicture, OutlinesAreDark)
{
    const InspectedFile file = madeUpFile();
    const UvWindow window{0, 0, 400, 400, 400};
    const Picture with = drawUvWindow(file, 0, window, true);
    const Picture without = drawUvWindow(file, 0, window, false);
    EXPECT_LT(brightness(with, 100, 0), brightness(without, 100, 0) - 100);
}

TEST(UvPicture, TheFirstOfSeveralTrianglesKeepsItsPixels)
{
    UvRaster raster({0, 0, 10, 10, 10});
    const TriangleUvs half = {{{0, 0}, {1, 0}, {0, 1}}};
    const TriangleUvs everything = {{{-1, -1}, {3, -1}, {-1, 3}}};
    raster.add(half, 4);
    EXPECT_FALSE(raster.full());
    raster.add(everything, 5);
    EXPECT_TRUE(raster.full());
    EXPECT_EQ(raster.at(1, 1), 4);
    EXPECT_EQ(raster.at(8, 8), 5);
}

TEST(UvPicture, PanelsWithScalesAndALegend)
{
    InspectedFile file = madeUpFile();
    const Picture picture = drawUvSpace(file, {.edge = 200, .outlines = true, .whole = true});
    EXPECT_GT(picture.width, 200u);
    EXPECT_GT(picture.height, 200u);
    EXPECT_EQ(picture.pixels.size(), size_t{picture.width} * picture.height);
    // Coordinates from here to the ends of what a float can be are drawn, too.
    file.primitives[0].uvs[0] = {{{-3e38f, 3e38f}, {3e38f, 0}, {1e-38f, -3e38f}}};
    EXPECT_GT(drawUvSpace(file, {.edge = 200, .outlines = true, .whole = false}).width, 200u);
}

TEST(PictureText, WidthsAndFitting)
{
    EXPECT_EQ(textWidth("", Font::Normal), 0);
    EXPECT_GT(textWidth("WW", Font::Normal), textWidth("ii", Font::Normal));
    EXPECT_EQ(textWidth("\xc3\xa9", Font::Normal), textWidth("?", Font::Normal));
    EXPECT_EQ(fitText("leaf", Font::Normal, 1000), "leaf");
    const std::string fitting = fitText("a long name of a material", Font::Normal, 80);
    EXPECT_LE(textWidth(fitting, Font::Normal), 80);
    EXPECT_EQ(fitting.substr(fitting.size() - 3), "...");
    Picture picture{20, 20, std::vector<uint32_t>(400, 0xffffffffu)};
    drawText(picture, -5, 18, "Vellum", Font::Title, 0xff000000u); // reaches over both sides
    EXPECT_NE(picture.pixels, std::vector<uint32_t>(400, 0xffffffffu));
}

// By a walk over the text: this one would take hours by taking off a letter at a time.
TEST(Text, FitsALongName)
{
    const std::string longName(3000000, 'm');
    const std::string fitting = fitText(longName, Font::Title, 200);
    EXPECT_LE(textWidth(fitting, Font::Title), 200);
    EXPECT_GT(textWidth("m" + fitting, Font::Title), 200);
    EXPECT_TRUE(fitting.ends_with("m...")) << fitting;
    EXPECT_EQ(fitText("short", Font::Title, 200), "short");
    // The dots are there only where they are needed.
    const int width = textWidth("a name", Font::Small);
    EXPECT_EQ(fitText("a name", Font::Small, width), "a name");
    EXPECT_NE(fitText("a name", Font::Small, width - 1), "a name");
    EXPECT_EQ(fitText("a name", Font::Small, 0), "...");
}
