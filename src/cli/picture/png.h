// SPDX-License-Identifier: Apache-2.0
// PNG files of pictures.
#pragma once

#include <cstdint>
#include <vector>

#include "cli/picture/picture.h"

namespace vellum::cli
{

enum class Alpha {
    Ignored, // the file is opaque
    Kept,
};

// The bytes of a PNG file. Throws Error.
std::vector<uint8_t> encodePng(const Picture &picture, Alpha alpha = Alpha::Ignored);

} // namespace vellum::cli
