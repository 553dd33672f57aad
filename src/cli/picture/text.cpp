#include "cli/picture/text.h"

#include <array>
#include <cctype>

namespace vellum::cli
{
namespace
{

struct Glyph {
    char letter;
    std::array<const char *, kGlyphHeight> rows;
};

constexpr Glyph kGlyphs[] = {
    {'0', {"###", "# #", "# #", "# #", "###"}}, {'1', {" # ", "## ", " # ", " # ", "###"}},
    {'2', {"###", "  #", "###", "#  ", "###"}}, {'3', {"###", "  #", " ##", "  #", "###"}},
    {'4', {"# #", "# #", "###", "  #", "  #"}}, {'5', {"###", "#  ", "###", "  #", "###"}},
    {'6', {"###", "#  ", "###", "# #", "###"}}, {'7', {"###", "  #", " # ", " # ", " # "}},
    {'8', {"###", "# #", "###", "# #", "###"}}, {'9', {"###", "# #", "###", "  #", "###"}},
    {'A', {" # ", "# #", "###", "# #", "# #"}}, {'B', {"## ", "# #", "## ", "# #", "## "}},
    {'C', {" ##", "#  ", "#  ", "#  ", " ##"}}, {'D', {"## ", "# #", "# #", "# #", "## "}},
    {'E', {"###", "#  ", "## ", "#  ", "###"}}, {'F', {"###", "#  ", "## ", "#  ", "#  "}},
    {'G', {" ##", "#  ", "# #", "# #", " ##"}}, {'H', {"# #", "# #", "###", "# #", "# #"}},
    {'I', {"###", " # ", " # ", " # ", "###"}}, {'J', {"  #", "  #", "  #", "# #", " # "}},
    {'K', {"# #", "# #", "## ", "# #", "# #"}}, {'L', {"#  ", "#  ", "#  ", "#  ", "###"}},
    {'M', {"# #", "###", "###", "# #", "# #"}}, {'N', {"## ", "# #", "# #", "# #", "# #"}},
    {'O', {" # ", "# #", "# #", "# #", " # "}}, {'P', {"## ", "# #", "## ", "#  ", "#  "}},
    {'Q', {" # ", "# #", "# #", " # ", "  #"}}, {'R', {"## ", "# #", "## ", "# #", "# #"}},
    {'S', {" ##", "#  ", " # ", "  #", "## "}}, {'T', {"###", " # ", " # ", " # ", " # "}},
    {'U', {"# #", "# #", "# #", "# #", "###"}}, {'V', {"# #", "# #", "# #", "# #", " # "}},
    {'W', {"# #", "# #", "###", "###", "# #"}}, {'X', {"# #", "# #", " # ", "# #", "# #"}},
    {'Y', {"# #", "# #", " # ", " # ", " # "}}, {'Z', {"###", "  #", " # ", "#  ", "###"}},
    {'.', {"   ", "   ", "   ", "   ", " # "}}, {',', {"   ", "   ", "   ", " # ", "#  "}},
    {'-', {"   ", "   ", "###", "   ", "   "}}, {':', {"   ", " # ", "   ", " # ", "   "}},
    {'/', {"  #", "  #", " # ", "#  ", "#  "}},
};

const Glyph *glyphOf(char letter)
{
    const int capital = std::toupper(static_cast<unsigned char>(letter));
    for (const Glyph &glyph : kGlyphs)
        if (glyph.letter == capital)
            return &glyph;
    return nullptr;
}

} // namespace

void drawText(Picture &picture, std::int64_t x, std::int64_t y, std::uint32_t scale, std::string_view text,
              std::uint32_t color)
{
    for (const char letter : text) {
        const Glyph *glyph = glyphOf(letter);
        for (std::int64_t row = 0; glyph != nullptr && row < kGlyphHeight * scale; ++row) {
            for (std::int64_t column = 0; column < (kGlyphWidth - 1) * scale; ++column) {
                const std::int64_t px = x + column;
                const std::int64_t py = y + row;
                if (glyph->rows[static_cast<std::size_t>(row / scale)][column / scale] == '#' && px >= 0 && py >= 0 &&
                    px < picture.width && py < picture.height)
                    picture.pixels[static_cast<std::size_t>(py * picture.width + px)] = color;
            }
        }
        x += kGlyphWidth * scale;
    }
}

} // namespace vellum::cli
