// SPDX-License-Identifier: Apache-2.0
// The endless plane of texels that a sampler makes of a texture, with bounds for the texels of any rectangle.
//
// Written from the specification ("Wrapping Operation"), with nothing of the baker's: of the texture only its data is
// used.
#pragma once

#include <cstdint>
#include <vector>

#include "bake/texture/texture.h"

namespace vellum::verify
{

// Columns and rows, the last included, in unwrapped positions.
struct TexelBox {
    int64_t left;
    int64_t right;
    int64_t top;
    int64_t bottom;
};

// Bounds of all values. If one is NaN or infinite: from minus to plus infinity.
struct Range {
    double low;
    double high;
};

class Texels
{
public:
    // Looks at every texel once. The texture must outlive this. Throws std::invalid_argument where it has no value for
    // each texel, or none at all.
    explicit Texels(const AlphaTexture &texture);

    [[nodiscard]] const AlphaTexture &texture() const { return texture_; }
    // The texel at an unwrapped position, or the border.
    [[nodiscard]] float at(int64_t x, int64_t y) const;
    // Bounds for the texels of a box: the exact ones for boxes of a few texels, wider ones for others.
    [[nodiscard]] Range range(const TexelBox &box) const;
    // Bounds for all there is, border included.
    [[nodiscard]] Range all() const;
    // No finite texel, and not the border, is further from 0.
    [[nodiscard]] double largest() const { return largest_; }

private:
    // One level of a pyramid: bounds for squares of texels.
    struct Floor {
        int64_t width = 0;
        int64_t height = 0;
        std::vector<float> low;
        std::vector<float> high;
    };

    [[nodiscard]] float stored(int64_t column, int64_t row) const
    {
        return texture_.value(texture_.place(static_cast<size_t>(column), static_cast<size_t>(row)));
    }
    [[nodiscard]] Range stored(int64_t left, int64_t right, int64_t top, int64_t bottom) const;
    void addGroundFloor();
    void addFloor();

    const AlphaTexture &texture_;
    std::vector<Floor> floors_; // of squares of 4, 8, 16... texels
    double largest_ = 0;
};

} // namespace vellum::verify
