// SPDX-License-Identifier: Apache-2.0
// Pictures.
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
