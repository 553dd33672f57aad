// SPDX-License-Identifier: Apache-2.0
// Decoding of images: PNG, JPEG and WebP.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace vellum
{

struct Image {
    uint32_t width = 0;
    uint32_t height = 0;
    std::vector<uint8_t> rgba; // 4 * width * height bytes, as stored (colour is sRGB)
    // All bits of an alpha of 16, width * height values; empty where it has 8 or fewer.
    std::vector<uint16_t> alpha16{};
};

// A small file can be a large image: 16384 x 16384 texels of one colour are 22 bytes of WebP. Images of real textures
// have more than 1 byte for this many texels.
constexpr uint64_t kMostTexelsPerByte = 1024;

// Decodes to RGBA. Of colours of 16 bits the upper 8 are taken. Throws GltfError, its message beginning with `what`,
// for anything but a whole image of at most 16,384 texels in each direction and not far more of them than its bytes can
// be worth, and GltfUnsupported for KTX2, AVIF, DDS and those kinds of JPEG that nothing here decodes.
// Also for WebP where this build has no decoder of it.
Image decodeImage(std::span<const uint8_t> encoded, const std::string &what);

extern const bool kDecodesWebp;

} // namespace vellum
