// SPDX-License-Identifier: Apache-2.0
// PNG files of pictures.
#pragma once

#include <cstdint>
#include <vector>

#include "cli/picture/picture.h"

namespace vellum::cli
{

enum class Colors {
    All,
    Few,       // at most 256, for a small file
    WithAlpha, // the others are opaque, whatever the pixels say
};

// The bytes of a PNG file. Throws Error.
std::vector<uint8_t> encodePng(const Picture &picture, Colors colors = Colors::All);

} // namespace vellum::cli
