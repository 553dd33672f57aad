// SPDX-License-Identifier: Apache-2.0
// Pictures, and PNG files of them.
#pragma once

#include <cstdint>
#include <vector>

namespace vellum::cli
{

struct Picture {
    uint32_t width = 0;
    uint32_t height = 0;
    std::vector<uint32_t> pixels; // RGBA, red in the lowest byte, top row first
};

enum class Colors {
    All,
    Few,       // at most 256, for a small file
    WithAlpha, // the others are opaque, whatever the pixels say
};

// The bytes of a PNG file. Throws Error.
std::vector<uint8_t> encodePng(const Picture &picture, Colors colors = Colors::All);

// Both pictures must have the same height.
Picture sideBySide(const Picture &left, const Picture &right);

struct Difference {
    uint64_t pixels = 0;  // that differ in any channel
    uint32_t largest = 0; // of any channel, 1..255
    Picture amplified;    // eight times the absolute difference on black, any difference visible
};

// Both pictures must have the same size.
Difference compare(const Picture &a, const Picture &b);

} // namespace vellum::cli
