// Letters in pictures.
#pragma once

#include <string_view>

#include "cli/picture/picture.h"

namespace vellum::cli
{

constexpr std::uint32_t kGlyphWidth = 4; // with the space behind it, as all sizes before `scale`
constexpr std::uint32_t kGlyphHeight = 5;

// Draws a line of text, its upper left corner at (x, y); each dot is scale * scale pixels. Capitals, small letters
// drawn as capitals, digits and ". , - : /"; others leave a space. What is outside of the picture is left out.
void drawText(Picture &picture, std::int64_t x, std::int64_t y, std::uint32_t scale, std::string_view text,
              std::uint32_t color);

} // namespace vellum::cli
