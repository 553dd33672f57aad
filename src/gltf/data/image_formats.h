// SPDX-License-Identifier: Apache-2.0
// The decoders that decodeImage() chooses from: by libpng, libjpeg and libwebp (image_libraries.cpp) and libavif
// (image_avif.cpp), or by stb_image (image_stb.cpp) in builds without these.
#pragma once

#include "gltf/data/image.h"
#include "gltf/file/gltf_error.h"

namespace vellum
{

using Encoded = std::span<const uint8_t>;

constexpr uint32_t kMostTexels = 16384; // in each direction

Image readPng(Encoded encoded, const std::string &what);
// `encoded` has passed checkJpeg().
Image readJpeg(Encoded encoded, const std::string &what);
Image readWebp(Encoded encoded, const std::string &what);
Image readAvif(Encoded encoded, const std::string &what);

// The most texels that this many bytes are believed to have.
uint64_t mostTexels(Encoded encoded);
// An image of this size without its texels, once the size is believable.
Image imageOf(uint64_t width, uint64_t height, Encoded encoded, const std::string &what);
// Deflate takes at least 1 byte for 1032: what is not there need not be waited for.
void checkDeflated(uint64_t bytes, Encoded encoded, const std::string &what);
// The texels of a PNG with 16 bits for each channel: its rows with four channels, the upper byte first.
void takeWide(Encoded rows, Image &image);

[[noreturn]] inline void failToDecode(const std::string &what, const std::string &why)
{
    throw GltfError(what + " cannot be decoded: " + why);
}

} // namespace vellum
