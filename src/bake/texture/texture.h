// SPDX-License-Identifier: Apache-2.0
// The alpha channel of a texture with the sampler that reads it: what the baker proves its states against.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/large_memory.h"

namespace vellum
{

// VkSamplerAddressMode. glTF knows the first three.
enum class Wrap : uint8_t { Repeat, Mirror, Clamp, Border, MirrorOnce };

// VkFilter of mip level 0, the one that alpha tests for ray tracing read.
enum class Filter : uint8_t { Nearest, Bilinear };

struct AlphaTexture {
    uint32_t width = 0;       // in texels, at least 1
    uint32_t height = 0;      // in texels, at least 1
    std::vector<float> alpha; // width * height values, row 0 is at v = 0; what is not finite proves nothing
    Wrap wrapU = Wrap::Repeat;
    Wrap wrapV = Wrap::Repeat;
    Filter filter = Filter::Bilinear;
    float border = 0; // read outside by Wrap::Border

    // Takes every `stride`-th byte as an 8-bit normalised value.
    //   first   the alpha of texel (0, 0): 3 bytes after the pixels of an RGBA image
    //   stride  bytes from one texel to the next, 4 for RGBA
    //   scale   what the shader multiplies the filtered alpha with: glTF's baseColorFactor[3]
    static AlphaTexture fromUnorm8(uint32_t width, uint32_t height, const uint8_t *first, size_t stride,
                                   float scale = 1.0f);

    // Reads 16-bit values, in native byte order; `stride` counts values.
    static AlphaTexture fromUnorm16(uint32_t width, uint32_t height, const uint16_t *first, size_t stride,
                                    float scale = 1.0f);

    // Makes `alpha` of rows that function(y, to) writes.
    template <typename Function>
    void appendRows(Function &&function)
    {
        reserveLarge(alpha, size_t{width} * height);
        for (size_t y = 0; y < height; ++y) {
            alpha.resize((y + 1) * width); // row by row, while the zeros are still near
            function(y, alpha.data() + y * width);
        }
    }

    // The texel at any integer position, wrapped, or the border.
    [[nodiscard]] float texel(int64_t x, int64_t y) const;
    // The filtered value at (u, v), in double precision: exactly as Vulkan's "Texel Filtering" defines it, without the
    // rounding of a GPU. u and v must be finite and below 2^31 texels.
    [[nodiscard]] double sample(double u, double v) const;
};

// The texel that position `i` means on an axis of `size` texels; -1 for the border.
int64_t wrapTexel(int64_t i, int64_t size, Wrap wrap);

} // namespace vellum
