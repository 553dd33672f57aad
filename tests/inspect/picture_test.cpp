// SPDX-License-Identifier: Apache-2.0
// Pixels and labels of pictures in UV space, and files of them.
#include <algorithm>
#include <array>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/picture.h"
#include "inspect/uv_picture.h"
#include "made_up_file.h"

using namespace vellum;
using namespace vellum::inspect;
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
    uint64_t rows = kMostRows;
    const UvWindow window{0, 0, 400, 400, 400};
    const Picture picture = drawUvWindow(file, 0, window, true, rows);
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

TEST(UvPicture, EmptyOutsideTriangles)
{
    const InspectedFile file = madeUpFile();
    uint64_t rows = kMostRows;
    const UvWindow window{-1, 0, 50, 100, 50}; // from u = -1 to 1
    const Picture picture = drawUvWindow(file, 0, window, false, rows);
    EXPECT_EQ(warmth(picture, -0.5, 0.5, window), 0);
    EXPECT_NE(warmth(picture, 0.3, 0.3, window), 0);
}

TEST(UvPicture, OutlinesAreDark)
{
    const InspectedFile file = madeUpFile();
    uint64_t rows = kMostRows;
    const UvWindow window{0, 0, 400, 400, 400};
    const Picture with = drawUvWindow(file, 0, window, true, rows);
    const Picture without = drawUvWindow(file, 0, window, false, rows);
    EXPECT_LT(brightness(with, 100, 0), brightness(without, 100, 0) - 100);
}

TEST(UvPicture, TheFirstOfSeveralTrianglesKeepsItsPixels)
{
    uint64_t rows = kMostRows;
    UvRaster raster({0, 0, 10, 10, 10}, rows);
    const TriangleUvs half = {{{0, 0}, {1, 0}, {0, 1}}};
    const TriangleUvs everything = {{{-1, -1}, {3, -1}, {-1, 3}}};
    raster.add(half, 4);
    EXPECT_FALSE(raster.full());
    raster.add(everything, 5);
    EXPECT_TRUE(raster.full());
    EXPECT_EQ(raster.at(1, 1), 4);
    EXPECT_EQ(raster.at(8, 8), 5);
}

// Slivers between the centres of pixels never fill a picture.
TEST(UvPicture, RowsOfAllTrianglesAreLimited)
{
    const TriangleUvs sliver = {{{0.01f, 0}, {0.02f, 0}, {0.02f, 1}}};
    uint64_t rows = 25;
    for (int panel = 0; panel < 2; ++panel) {
        UvRaster raster({0, 0, 10, 10, 10}, rows);
        raster.add(sliver, 0);
        EXPECT_FALSE(raster.full());
    }
    UvRaster raster({0, 0, 10, 10, 10}, rows);
    raster.add({{{0, 0}, {2, 0}, {0, 2}}}, 7);
    EXPECT_TRUE(raster.full());
    EXPECT_EQ(raster.at(0, 4), 7);
    EXPECT_EQ(raster.at(0, 5), -1);
}

TEST(UvPicture, PanelsWithScalesAndALegend)
{
    InspectedFile file = madeUpFile();
    const LabelledPicture drawing = drawUvSpace(file, {.edge = 200, .outlines = true, .whole = true});
    const Picture &picture = drawing.picture;
    const auto labels = [&](const std::string &text) {
        return std::ranges::count_if(drawing.labels, [&](const Label &label) { return label.text.starts_with(text); });
    };
    EXPECT_EQ(labels("0"), 2) << "the origins of u and v";
    for (const char *state : {"opaque  ", "transparent  ", "unknown, opaque  ", "unknown, transparent  "})
        EXPECT_EQ(labels(state), 1) << state;
    EXPECT_EQ(labels(file.materials[0].material.name.empty() ? "default material" : file.materials[0].material.name),
              1);
    for (const Label &label : drawing.labels) {
        EXPECT_LT(label.x, picture.width) << label.text;
        EXPECT_LT(label.y, picture.height) << label.text;
    }
    EXPECT_GT(picture.width, 200u);
    EXPECT_GT(picture.height, 200u);
    EXPECT_EQ(picture.pixels.size(), size_t{picture.width} * picture.height);
    // Coordinates from here to the ends of what a float can be are drawn, too.
    file.primitives[0].uvs[0] = {{{-3e38f, 3e38f}, {3e38f, 0}, {1e-38f, -3e38f}}};
    EXPECT_GT(drawUvSpace(file, {.edge = 200, .outlines = true, .whole = false}).picture.width, 200u);
}

TEST(UvPicture, TooManyMaterials)
{
    InspectedFile file = madeUpFile();
    file.materials.resize(3000, file.materials[0]);
    try {
        drawUvSpace(file, {.edge = 64, .outlines = false, .whole = true});
        ADD_FAILURE() << "drawn";
    } catch (const Error &error) {
        EXPECT_STREQ(error.what(), "3,000 materials are too many for a picture; --material chooses some");
    }
}

TEST(PictureFile, TooLargeForPng)
{
    const Picture picture{40000, 36000, {}}; // more bytes than 32 bits count
    EXPECT_THROW(encodePng(picture), Error);
}

TEST(PictureText, FitsANameOfAnyLength)
{
    EXPECT_EQ(textWidth("", 14), 0);
    EXPECT_EQ(textWidth("\xc3\xa9", 14), textWidth("e", 14));
    EXPECT_EQ(fitText("leaf", 14, 1000), "leaf");
    const std::string fitting = fitText(std::string(3000000, 'm'), 19, 200);
    EXPECT_LE(textWidth(fitting, 19), 200);
    EXPECT_GT(textWidth("m" + fitting, 19), 200);
    EXPECT_TRUE(fitting.ends_with("m...")) << fitting;
    const double width = textWidth("a name", 12);
    EXPECT_EQ(fitText("a name", 12, width + 0.1), "a name");
    EXPECT_NE(fitText("a name", 12, width - 1), "a name");
    EXPECT_EQ(fitText("a name", 12, 0), "...");
    EXPECT_EQ(fitText("\xc3\xa9\xc3\xa9\xc3\xa9\xc3\xa9\xc3\xa9", 10, 25), "\xc3\xa9..."); // whole characters
}

TEST(PictureText, IsMarkupInAnSvg)
{
    LabelledPicture drawing{{2, 1, {0xff0000ffu, 0xff00ff00u}}, {}};
    drawing.labels.push_back({1, 2, "<b> & \"leaf\"", 12, 0x123456, Label::Anchor::Middle, true});
    const std::string svg = encodeSvg(drawing);
    EXPECT_TRUE(svg.starts_with(kSvgMark));
    EXPECT_NE(svg.find("width=\"2\" height=\"1\""), std::string::npos) << svg;
    EXPECT_NE(svg.find("href=\"data:image/png;base64,iVBOR"), std::string::npos) << svg;
    EXPECT_NE(svg.find("<text x=\"1\" y=\"2\" font-size=\"12\" fill=\"#123456\" text-anchor=\"middle\" "
                       "font-weight=\"bold\">&#60;b&#62; &#38; &#34;leaf&#34;</text>"),
              std::string::npos)
        << svg;
}
