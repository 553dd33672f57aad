// SPDX-License-Identifier: Apache-2.0
// Decoding of images: PNG, JPEG, WebP and AVIF.
#pragma once

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
    // Alpha of more than 8 bits, width * height values; empty where it has 8 or fewer. A value of 10 or 12 bits is
    // scaled to the nearest of 16: v of n bits becomes v * 65535 / (2^n - 1), rounded.
    std::vector<uint16_t> alpha16{};
};

// A small file can be a large image: 16384 x 16384 texels of one colour are 22 bytes of WebP. Images of real textures
// have more than 1 byte for this many texels.
constexpr uint64_t kMostTexelsPerByte = 1024;

// Decodes to RGBA. Of colours of 16 bits the upper 8 are taken. Throws GltfError, its message beginning with `what`,
// for anything but a whole image of at most 16,384 texels in each direction and not far more of them than its bytes can
// be worth, and GltfUnsupported for KTX2, DDS, animations, those kinds of JPEG that nothing here decodes, and AVIF that
// is to be rotated, mirrored or cropped. Also for WebP and AVIF where this build has no decoders of them.
Image decodeImage(std::span<const uint8_t> encoded, const std::string &what);

// Returns whether these bytes begin as an AVIF file: an ISO media file that names one of its brands.
bool isAvif(std::span<const uint8_t> encoded);

// True if this build reads WebP and AVIF.
extern const bool kDecodesWebpAndAvif;

} // namespace vellum
