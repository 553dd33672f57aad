// SPDX-License-Identifier: Apache-2.0
#include "cli/picture/picture.h"

#include <algorithm>
#include <cstddef>

namespace vellum::cli
{

Picture sideBySide(const Picture &left, const Picture &right)
{
    Picture both{left.width + right.width, left.height, {}};
    for (size_t row = 0; row < both.height; ++row) {
        for (const Picture *part : {&left, &right}) {
            const auto first = part->pixels.begin() + static_cast<ptrdiff_t>(row * part->width);
            both.pixels.insert(both.pixels.end(), first, first + part->width);
        }
    }
    return both;
}

Difference compare(const Picture &a, const Picture &b)
{
    Difference difference;
    difference.amplified = {a.width, a.height, std::vector<uint32_t>(a.pixels.size(), 0xff000000u)};
    for (size_t i = 0; i < a.pixels.size(); ++i) {
        if (a.pixels[i] == b.pixels[i])
            continue;
        ++difference.pixels;
        uint32_t shown = 0xff000000u;
        for (unsigned shift = 0; shift < 24; shift += 8) {
            const uint32_t x = (a.pixels[i] >> shift) & 255;
            const uint32_t y = (b.pixels[i] >> shift) & 255;
            const uint32_t apart = x > y ? x - y : y - x;
            difference.largest = std::max(difference.largest, apart);
            shown |= std::clamp(8 * apart, 32u, 255u) << shift;
        }
        difference.amplified.pixels[i] = shown;
    }
    return difference;
}

} // namespace vellum::cli
