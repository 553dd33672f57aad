// SPDX-License-Identifier: Apache-2.0
// The baker's inputs out of the forms that they have elsewhere: pixels of several formats, and vertices with indices.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "bake/bake.h"
#include "bake/texture/texture.h"

namespace vellum
{

enum class AlphaFormat : uint8_t { Unorm8, Unorm16, Float16, Float32 };

// An image's values of one channel, in native byte order; values need no alignment. Compressed blocks (BC1, BC3, BC4,
// BC7) are for the caller to decode.
struct AlphaPixels {
    uint32_t width = 0;
    uint32_t height = 0;
    AlphaFormat format = AlphaFormat::Unorm8;
    std::span<const std::byte> bytes; // from the image's first byte on
    size_t offset = 0;                // of the channel of texel (0, 0): 3 for 8-bit RGBA
    size_t pixelStride = 1;           // bytes from one texel to the next in a row
    size_t rowStride = 0;             // and from one row to the next; 0 where rows follow each other
    // The factor by which the shader multiplies the filtered value: glTF's baseColorFactor[3].
    float scale = 1.0f;
};

// The texture with default address modes and filter. Values of 8 bits are not copied: `bytes` must outlive the texture
// and its copies. Throws BakeError where pixels lie outside `bytes`.
AlphaTexture readAlpha(const AlphaPixels &pixels);

enum class UvFormat : uint8_t { Float32, Float16, Unorm16 };
enum class IndexFormat : uint8_t { None, Uint8, Uint16, Uint32 };

struct UvVertices {
    UvFormat format = UvFormat::Float32;
    std::span<const std::byte> bytes; // from the first vertex's u on
    size_t stride = 0;                // bytes from one vertex to the next; 0 where they follow each other
    // The triangles' vertices, three in a row for each; without indices, vertices are in that order themselves.
    IndexFormat indexFormat = IndexFormat::None;
    std::span<const std::byte> indices;
    // The transform that a shader applies to the coordinates before it samples: (u, v) becomes (m[0] u + m[1] v + m[2],
    // m[3] u + m[4] v + m[5]), in single precision.
    std::array<float, 6> transform = {1, 0, 0, 0, 1, 0};
};

// Finds BakeInput::uvTerms of a transform that a shader computes.
class UvTerms
{
public:
    // Of the transform of a vertex, whose products have its precision.
    template <typename Number>
    void add(const std::array<Number, 6> &transform, float u, float v)
    {
        for (const size_t row : {0u, 3u}) {
            const double sum = std::abs(double{transform[row] * u}) + std::abs(double{transform[row + 1] * v}) +
                               std::abs(double{transform[row + 2]});
            if (std::isfinite(sum))
                largest_ = std::max(largest_, sum);
        }
    }
    // A power of two.
    [[nodiscard]] float value() const;

private:
    double largest_ = 0;
};

// The triangles; what is left over of indices or vertices is dropped. uvTerms: gets BakeInput::uvTerms, 0 without a
// transform. Throws BakeError for an index without a vertex.
std::vector<TriangleUvs> readUvs(const UvVertices &vertices, double *uvTerms = nullptr);

// IEEE 754 half precision, exactly.
float halfToFloat(uint16_t bits);

} // namespace vellum
