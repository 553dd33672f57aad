// SPDX-License-Identifier: Apache-2.0
// Text in pictures.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "cli/picture/picture.h"

namespace vellum::cli
{

enum class Font : uint8_t { Small, Normal, Title }; // 13, 15 and 20 pixels

// Widths in pixels. Characters beyond ASCII are drawn as "?", one for each code point.
int textWidth(std::string_view text, Font font);
// `y` is that of the baseline. Clips to the picture.
void drawText(Picture &picture, int x, int y, std::string_view text, Font font, uint32_t color);
// The beginning of `text` that is at most `width` wide, with "..." if it is not all.
std::string fitText(std::string_view text, Font font, int width);

// Puts `color` over a pixel, as far as `coverage` (0..1) says; the pixel must exist.
void blendPixel(Picture &picture, int x, int y, uint32_t color, double coverage);

} // namespace vellum::cli
