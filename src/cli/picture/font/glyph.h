// SPDX-License-Identifier: Apache-2.0
// A drawn character in the header that make_font writes.
#pragma once

#include <cstdint>

namespace vellum::cli
{

struct Glyph {
    uint32_t first; // into the font's coverage, which has width * height bytes from there
    int16_t left;   // from the pen to the left edge
    int16_t top;    // from the baseline down to the top edge
    uint16_t width;
    uint16_t height;
    int16_t advance; // of the pen, in 64ths of a pixel
};

} // namespace vellum::cli
