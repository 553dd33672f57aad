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

namespace
{

int64_t modulo(int64_t i, int64_t period)
{
    if (i >= 0 && i < period)
        return i;
    const int64_t rest = i % period;
    return rest < 0 ? rest + period : rest;
}

int64_t leadOf(Wrap wrap)
{
    switch (wrap) {
    case Wrap::Repeat: return 0;
    case Wrap::Border: return 2; // a cell of nothing but border, and one between border and texel 0
    case Wrap::Mirror:
    case Wrap::Clamp:
    case Wrap::MirrorOnce: break;
    }
    return 1; // a cell between texel 0 and itself
}

} // namespace

Axis::Axis(uint32_t size, Wrap wrap)
    : size_(size), wrap_(wrap), cells_(size_ + std::max<int64_t>(0, 2 * leadOf(wrap) - 1)), lead_(leadOf(wrap)),
      period_(wrap == Wrap::Repeat   ? size_
              : wrap == Wrap::Mirror ? 2 * size_
                                     : 0)
{
}

int64_t Axis::padded(int64_t index) const
{
    const int64_t texel = index - lead_;
    if (wrap_ == Wrap::Repeat)
        return modulo(texel, size_);
    if (wrap_ == Wrap::Border)
        return texel >= 0 && texel < size_ ? texel : -1;
    return std::clamp<int64_t>(texel, 0, size_ - 1);
}

Axis::Run Axis::foldedRun(int64_t i, int64_t last) const
{
    const int64_t wanted = last - i + 1;
    const auto rising = [&](int64_t stored) { return Run{stored, 1, std::min(wanted, cells_ - stored)}; };
    const auto falling = [&](int64_t stored) { return Run{stored, -1, std::min(wanted, stored + 1)}; };
    switch (wrap_) {
    case Wrap::Repeat: return rising(modulo(i, size_));
    case Wrap::Mirror: {
        // Stored cell 0 is cell -1, between texel 0 and its mirror image; so is cell 2 * size - 1.
        const int64_t m = modulo(i, period_);
        return m < size_ ? rising(m + 1) : falling(2 * size_ - 1 - m);
    }
    case Wrap::MirrorOnce:
        if (i < -size_ - 1)
            return {size_, 0, std::min(wanted, -size_ - 1 - i)};
        if (i < -1)
            return falling(-1 - i);
        break;
    case Wrap::Clamp:
    case Wrap::Border: break;
    }
    const int64_t stored = i + lead_;
    if (stored < 0)
        return {0, 0, std::min(wanted, -stored)};
    if (stored >= cells_)
        return {cells_ - 1, 0, wanted};
    return rising(stored);
}

int64_t Axis::reduced(int64_t i) const
{
    return period_ != 0 ? modulo(i + 1, period_) - 1 : i;
}

} // namespace vellum
