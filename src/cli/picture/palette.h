// SPDX-License-Identifier: Apache-2.0
// Pictures of few colours, for small files.
#pragma once

#include <cstdint>
#include <vector>

#include "cli/picture/picture.h"

namespace vellum::cli
{

struct Palette {
    std::vector<uint32_t> colors; // at most 256, as pixels of a Picture
    std::vector<uint8_t> indices; // one per pixel
};

// Boxes of colours are split at their mean, always the one that errs most, until there are enough; each colour becomes
// the mean of its box.
Palette makePalette(const Picture &picture);

} // namespace vellum::cli
