// SPDX-License-Identifier: Apache-2.0
// Compressed parts of glTF files, made for tests by the encoders of the libraries that decode them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "glb_file.h"

namespace vellum::test
{

// Triangles that share no vertices; attribute 0 has their positions, attribute 1 texture coordinates. The order of
// triangles and vertices may be another afterwards.
Bytes dracoTriangles(const std::vector<std::array<float, 3>> &positions, const std::vector<std::array<float, 2>> &uvs,
                     bool sequential = false);

// EXT_meshopt_compression's modes ATTRIBUTES, TRIANGLES and INDICES. KHR_meshopt_compression also has version 1 of the
// first, and the filter COLOR. Of what the library cannot encode, only the beginning is right.
extern const int kMeshoptVersion; // of the library: 1000 times the major one, 10 times the minor one
Bytes meshoptAttributes(const Bytes &vertices, size_t stride, int version = 0);
Bytes meshoptColors(const std::vector<float> &rgba);
Bytes meshoptTriangles(const std::vector<uint32_t> &indices);
Bytes meshoptIndices(const std::vector<uint32_t> &indices);

// If the build cannot decode such images, only the beginning of one.
Bytes webpImage(uint32_t width, uint32_t height, const Bytes &rgba);

struct AvifKind {
    unsigned depth = 8; // bits of each value of `rgba`
    bool alpha = true;
    bool premultiplied = false; // `rgba` is
    uint8_t rotation = 0;       // quarters of a turn
    bool mirrored = false;
    bool cropped = false;
    unsigned frames = 1;
    unsigned columns = 1; // of a grid whose cells are all this image
};
// Lossless. If the build cannot decode such images, only the beginning of one.
Bytes avifImage(uint32_t width, uint32_t height, const std::vector<uint16_t> &rgba, const AvifKind &kind = {});
// The same with other sizes in its headers; those of its frames stay.
Bytes resizedAvif(Bytes avif, uint32_t width, uint32_t height);

Bytes jpegImage(uint32_t width, uint32_t height, const Bytes &rgb);
constexpr int kGray = 0;
constexpr int kRgb = 2;
constexpr int kGrayAlpha = 4;
constexpr int kRgba = 6;
// `rows` are as they stand in the file, 16-bit values with the upper byte first.
Bytes pngImage(uint32_t width, uint32_t height, int bitDepth, int colorType, bool interlaced, const Bytes &rows);

} // namespace vellum::test
