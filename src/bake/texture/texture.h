// SPDX-License-Identifier: Apache-2.0
// The alpha channel of a texture with the sampler that reads it: what the baker proves its states against.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/large_memory.h"

namespace vellum
{

// VkSamplerAddressMode. glTF knows the first three.
enum class Wrap : uint8_t { Repeat, Mirror, Clamp, Border, MirrorOnce };

// VkFilter of mip level 0, the one that alpha tests for ray tracing read.
enum class Filter : uint8_t { Nearest, Bilinear };

// Texels as 8-bit codes in the memory of an image, which is not copied.
struct AlphaCodes {
    const uint8_t *first = nullptr;    // of texel (0, 0); null where there are no codes
    size_t pixelStride = 0;            // bytes from one texel to the next in a row
    size_t rowStride = 0;              // and from one row to the next
    std::array<float, 256> values{};   // what codes mean: rising, or falling
    std::shared_ptr<const void> owner; // of the memory; null where it outlives the texture by itself
};

struct AlphaTexture {
    uint32_t width = 0;  // in texels, at least 1
    uint32_t height = 0; // in texels, at least 1
    // width * height values, row 0 is at v = 0; what is not finite proves nothing. Not used where there are codes.
    std::vector<float> alpha;
    AlphaCodes codes;
    Wrap wrapU = Wrap::Repeat;
    Wrap wrapV = Wrap::Repeat;
    Filter filter = Filter::Bilinear;
    float border = 0; // read outside by Wrap::Border

    // Takes every `pixelStride`-th byte as an 8-bit normalised value, where it is.
    //   first   the alpha of texel (0, 0): 3 bytes after the pixels of an RGBA image
    //   scale   what the shader multiplies the filtered alpha with: glTF's baseColorFactor[3]
    //   owner   keeps the bytes; null where they outlive the texture and its copies
    static AlphaTexture fromUnorm8(uint32_t width, uint32_t height, const uint8_t *first, size_t pixelStride,
                                   size_t rowStride, float scale = 1.0f, std::shared_ptr<const void> owner = {});

    // Reads 16-bit values, in native byte order; `stride` counts values.
    static AlphaTexture fromUnorm16(uint32_t width, uint32_t height, const uint16_t *first, size_t stride,
                                    float scale = 1.0f);

    // Negates all values, and the border.
    void negate();
    [[nodiscard]] uint64_t texelCount() const { return uint64_t{width} * height; }
    // Whether there is a value for each texel, and at least one.
    [[nodiscard]] bool isComplete() const;

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

    // Where a texel is, for value(). Texels of a row are pixelStride() apart, and those of a column rowStride().
    [[nodiscard]] size_t place(size_t column, size_t row) const { return row * rowStride() + column * pixelStride(); }
    [[nodiscard]] size_t pixelStride() const { return codes.first != nullptr ? codes.pixelStride : 1; }
    [[nodiscard]] size_t rowStride() const { return codes.first != nullptr ? codes.rowStride : width; }
    [[nodiscard]] float value(size_t place) const
    {
        return codes.first != nullptr ? codes.values[codes.first[place]] : alpha[place];
    }
    // The texel at any integer position, wrapped, or the border.
    [[nodiscard]] float texel(int64_t x, int64_t y) const;
    // The filtered value at (u, v), in double precision: exactly as Vulkan's "Texel Filtering" defines it, without the
    // rounding of a GPU. u and v must be finite and below 2^31 texels.
    [[nodiscard]] double sample(double u, double v) const;
};

// The texel that position `i` means on an axis of `size` texels; -1 for the border.
int64_t wrapTexel(int64_t i, int64_t size, Wrap wrap);

// Maps positions along one axis of a texture to texels, by a sampler's address mode.
//
// Cell i is the interval between the centres of texels i and i + 1, for any integer i. An address mode folds all of
// them onto a few stored cells. Stored cells are consecutive and read the texels of a padded row: stored cell s reads
// padded texels s and s + 1.
class Axis
{
public:
    Axis(uint32_t size, Wrap wrap);

    // The number of stored cells; padded rows have one texel more.
    [[nodiscard]] int64_t cells() const { return cells_; }
    // The texel of a padded row, -1 for the border.
    [[nodiscard]] int64_t padded(int64_t index) const;
    // After that many cells the axis looks the same; 0 where the mode has no such number.
    [[nodiscard]] int64_t period() const { return period_; }
    // Returns whether the cells from `first` to `last` read all texels.
    [[nodiscard]] bool spans(double first, double last) const
    {
        return period_ != 0 ? last - first >= static_cast<double>(period_)
                            : first <= 0 && last >= static_cast<double>(size_);
    }

    // Neighbouring cells of one direction: cell `i + n` is stored cell `first + n * step`, for n below `count`. A step
    // of -1 reads its texels mirrored; with step 0 all of them are one.
    struct Run {
        int64_t first;
        int64_t step;
        int64_t count;
    };
    // The longest run from cell `i` on that ends at `last` or before.
    [[nodiscard]] Run run(int64_t i, int64_t last) const
    {
        // Before the border, every mode maps cells directly.
        if (i >= -lead_ && last < cells_ - lead_)
            return {i + lead_, 1, last - i + 1};
        return foldedRun(i, last);
    }
    // A cell from which on the axis looks the same as from `i` on, as near to 0 as the mode allows; -1 where that is
    // one, since what covers a texture starts there.
    [[nodiscard]] int64_t reduced(int64_t i) const;

private:
    [[nodiscard]] Run foldedRun(int64_t i, int64_t last) const;

    int64_t size_;
    Wrap wrap_;
    int64_t cells_;
    int64_t lead_;
    int64_t period_; // 0 where the mode has none
};

} // namespace vellum
