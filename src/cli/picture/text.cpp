// SPDX-License-Identifier: Apache-2.0
#include "cli/picture/text.h"

#include <cmath>
#include <span>

#include "cli/picture/font.h"

namespace vellum::cli
{
namespace
{

struct Face {
    std::span<const Glyph> glyphs;
    std::span<const uint8_t> coverage;
};

Face faceOf(Font font)
{
    switch (font) {
    case Font::Small: return {kSmallGlyphs, kSmallCoverage};
    case Font::Normal: return {kNormalGlyphs, kNormalCoverage};
    default: return {kTitleGlyphs, kTitleCoverage};
    }
}

// Calls function(glyph) for each code point.
template <typename Function>
void forEachGlyph(std::string_view text, const Face &face, Function &&function)
{
    for (const char c : text) {
        const auto byte = static_cast<uint8_t>(c);
        if ((byte & 0xc0) == 0x80) // belongs to the code point before it
            continue;
        function(face.glyphs[byte >= 32 && byte < 127 ? byte - 32u : '?' - 32u]);
    }
}

} // namespace

int textWidth(std::string_view text, Font font)
{
    int pen = 0;
    forEachGlyph(text, faceOf(font), [&](const Glyph &glyph) { pen += glyph.advance; });
    return (pen + 63) / 64;
}

void drawText(Picture &picture, int x, int y, std::string_view text, Font font, uint32_t color)
{
    const Face face = faceOf(font);
    int pen = x * 64;
    forEachGlyph(text, face, [&](const Glyph &glyph) {
        for (int row = 0; row < glyph.height; ++row)
            for (int column = 0; column < glyph.width; ++column) {
                const int px = (pen + 32) / 64 + glyph.left + column;
                const int py = y + glyph.top + row;
                if (px < 0 || py < 0 || px >= static_cast<int>(picture.width) || py >= static_cast<int>(picture.height))
                    continue;
                const size_t at = glyph.first + static_cast<size_t>(row * glyph.width + column);
                blendPixel(picture, px, py, color, face.coverage[at] / 255.0);
            }
        pen += glyph.advance;
    });
}

std::string fitText(std::string_view text, Font font, int width)
{
    const Face face = faceOf(font);
    const int most = width * 64;
    const auto advanceOf = [&](char c) {
        int advance = 0;
        forEachGlyph({&c, 1}, face, [&](const Glyph &glyph) { advance = glyph.advance; });
        return advance;
    };
    const int dots = 3 * advanceOf('.');
    size_t fitting = 0; // bytes that fit together with the dots
    int pen = 0;
    for (size_t i = 0; i < text.size(); ++i) {
        pen += advanceOf(text[i]);
        if (pen > most)
            return std::string(text.substr(0, fitting)) + "...";
        if (pen + dots <= most)
            fitting = i + 1;
    }
    return std::string(text);
}

void blendPixel(Picture &picture, int x, int y, uint32_t color, double coverage)
{
    uint32_t &pixel = picture.pixels[static_cast<size_t>(y) * picture.width + static_cast<size_t>(x)];
    uint32_t mixed = 0xff000000u;
    for (unsigned shift = 0; shift < 24; shift += 8) {
        const double below = (pixel >> shift) & 255;
        const double above = (color >> shift) & 255;
        mixed |= static_cast<uint32_t>(std::lround(below + (above - below) * coverage)) << shift;
    }
    pixel = mixed;
}

} // namespace vellum::cli
