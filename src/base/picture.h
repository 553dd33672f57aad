// SPDX-License-Identifier: Apache-2.0
// Pictures: their pixels, PNG files of them, and SVG files of them with labels.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vellum
{

struct Picture {
    uint32_t width = 0;
    uint32_t height = 0;
    std::vector<uint32_t> pixels; // RGBA, red in the lowest byte, top row first
};

// The colours of states: red, green and blue of sRGB. By State, from Wong's palette for all kinds of colour vision:
// what is known is blue, what is unknown is yellow or red.
constexpr std::array<uint32_t, 4> kStateColors = {0x56b4e9, 0x0072b2, 0xf0e442, 0xd55e00};

// Both pictures must have the same height.
Picture sideBySide(const Picture &left, const Picture &right);

struct Difference {
    uint64_t pixels = 0;  // pixels that differ in any channel
    uint32_t largest = 0; // of any channel, 1..255
    Picture amplified;    // eight times the absolute difference on black, any difference visible
};

// Both pictures must have the same size.
Difference compare(const Picture &a, const Picture &b);

// These marks are in the first bytes of every file that these functions return.
inline constexpr std::string_view kPngMark("tEXtSoftware\0vellum", 19);
inline constexpr std::string_view kSvgMark = "<!--vellum-->";

enum class Alpha {
    Ignored, // the file is opaque
    Kept,
};

// The bytes of a PNG file. Throws Error.
std::vector<uint8_t> encodePng(const Picture &picture, Alpha alpha = Alpha::Ignored);
// "data:image/png;base64,...": the same as a URI.
std::string pngUri(const Picture &picture, Alpha alpha = Alpha::Ignored);

// A zlib stream (RFC 1950), which PNG files have and DecompressionStream("deflate") of browsers reads. At most 1 GiB.
// Throws Error.
std::vector<uint8_t> deflated(std::span<const uint8_t> bytes);

// Fills the part of a rectangle that is in the picture.
void fillRectangle(Picture &picture, int64_t x, int64_t y, int64_t width, int64_t height, uint32_t color);

// The least of 1, 2 and 5 times powers of ten that is not below `step`: between the marks of a scale.
double roundStep(double step);

// A line of text over a picture.
struct Label {
    enum class Anchor { Start, Middle, End };
    double x = 0; // of the anchor
    double y = 0; // of the baseline
    std::string text;
    uint32_t size = 12; // pixels
    uint32_t color = 0; // 0xrrggbb
    Anchor anchor = Anchor::Start;
    bool bold = false;
};

struct LabelledPicture {
    Picture picture;
    std::vector<Label> labels;
};

// The beginning of `text` that is about `width` pixels wide at most, with "..." if it is not all: fonts differ.
std::string fitText(std::string_view text, uint32_t size, double width);
// Its width, at most, as far as can be said without a font.
double textWidth(std::string_view text, uint32_t size);

// The text of an SVG file with the picture as a PNG in it. Throws Error.
std::string encodeSvg(const LabelledPicture &picture);

} // namespace vellum
