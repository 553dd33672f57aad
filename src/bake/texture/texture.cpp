// SPDX-License-Identifier: Apache-2.0
#include "bake/texture/texture.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace vellum
{

AlphaTexture AlphaTexture::fromUnorm8(uint32_t width, uint32_t height, const uint8_t *first, size_t pixelStride,
                                      size_t rowStride, float scale, std::shared_ptr<const void> owner)
{
    AlphaTexture texture;
    texture.width = width;
    texture.height = height;
    texture.codes = {first, pixelStride, rowStride, {}, std::move(owner)};
    for (size_t i = 0; i < texture.codes.values.size(); ++i)
        texture.codes.values[i] = static_cast<float>(i) / 255.0f * scale;
    return texture;
}

AlphaTexture AlphaTexture::fromUnorm16(uint32_t width, uint32_t height, const uint16_t *first, size_t stride,
                                       float scale)
{
    AlphaTexture texture;
    texture.width = width;
    texture.height = height;
    texture.appendRows([&](size_t y, float *to) {
        const uint16_t *row = first + y * width * stride;
        for (size_t x = 0; x < width; ++x)
            to[x] = static_cast<float>(row[x * stride]) / 65535.0f * scale;
    });
    return texture;
}

void AlphaTexture::negate()
{
    border = -border;
    for (float &value : codes.values)
        value = -value;
    for (float &value : alpha)
        value = -value;
}

bool AlphaTexture::isComplete() const
{
    return texelCount() > 0 && (codes.first != nullptr || alpha.size() == texelCount());
}

int64_t wrapTexel(int64_t i, int64_t size, Wrap wrap)
{
    const auto modulo = [](int64_t a, int64_t b) { return ((a % b) + b) % b; };
    switch (wrap) {
    case Wrap::Repeat: return modulo(i, size);
    case Wrap::Mirror: {
        const int64_t m = modulo(i, 2 * size);
        return m < size ? m : 2 * size - 1 - m;
    }
    case Wrap::Border: return i >= 0 && i < size ? i : -1;
    case Wrap::MirrorOnce: return std::min(i >= 0 ? i : -1 - i, size - 1);
    case Wrap::Clamp: break;
    }
    return std::clamp<int64_t>(i, 0, size - 1);
}

float AlphaTexture::texel(int64_t x, int64_t y) const
{
    const int64_t column = wrapTexel(x, width, wrapU);
    const int64_t row = wrapTexel(y, height, wrapV);
    if (column < 0 || row < 0)
        return border;
    return value(place(static_cast<size_t>(column), static_cast<size_t>(row)));
}

double AlphaTexture::sample(double u, double v) const
{
    const double x = u * width;
    const double y = v * height;
    if (filter == Filter::Nearest)
        return texel(static_cast<int64_t>(std::floor(x)), static_cast<int64_t>(std::floor(y)));
    const double left = std::floor(x - 0.5);
    const double top = std::floor(y - 0.5);
    const double a = x - 0.5 - left;
    const double b = y - 0.5 - top;
    const auto i = static_cast<int64_t>(left);
    const auto j = static_cast<int64_t>(top);
    const auto at = [this](int64_t column, int64_t row) { return static_cast<double>(texel(column, row)); };
    return (at(i, j) * (1 - a) + at(i + 1, j) * a) * (1 - b) + (at(i, j + 1) * (1 - a) + at(i + 1, j + 1) * a) * b;
}

} // namespace vellum
