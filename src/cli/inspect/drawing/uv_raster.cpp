// SPDX-License-Identifier: Apache-2.0
#include "cli/inspect/drawing/uv_raster.h"

#include <algorithm>
#include <cmath>

namespace vellum::cli
{

UvRaster::UvRaster(const UvWindow &window)
    : window_(window), numbers_(size_t{window.width} * window.height, -1),
      next_(size_t{window.width + 1} * window.height), free_(numbers_.size())
{
    for (size_t i = 0; i < next_.size(); ++i)
        next_[i] = static_cast<uint32_t>(i % (window.width + 1));
}

uint32_t UvRaster::nextFree(uint32_t *row, uint32_t x) const
{
    uint32_t found = x;
    while (row[found] != found)
        found = row[found];
    while (row[x] != found) { // the way is shorter the next time
        const uint32_t next = row[x];
        row[x] = found;
        x = next;
    }
    return found;
}

void UvRaster::add(const TriangleUvs &uvs, int32_t number)
{
    std::array<double, 3> x{};
    std::array<double, 3> y{};
    for (size_t i = 0; i < 3; ++i) {
        x[i] = (uvs[i].u - window_.left) * window_.scale;
        y[i] = (uvs[i].v - window_.top) * window_.scale;
        if (!std::isfinite(x[i]) || !std::isfinite(y[i]))
            return;
    }
    const auto [least, most] = std::minmax({y[0], y[1], y[2]});
    const auto first = static_cast<uint32_t>(std::clamp(std::ceil(least - 0.5), 0.0, double(window_.height)));
    const auto end = static_cast<uint32_t>(std::clamp(std::floor(most - 0.5) + 1, 0.0, double(window_.height)));
    for (uint32_t row = first; row < end && free_ != 0; ++row) {
        const double at = row + 0.5; // pixels whose centres are inside
        double low = INFINITY;
        double high = -INFINITY;
        for (size_t i = 0; i < 3; ++i) {
            const size_t j = (i + 1) % 3;
            if (std::min(y[i], y[j]) > at || std::max(y[i], y[j]) < at)
                continue;
            const double crossing = y[i] == y[j] ? x[i] : x[i] + (at - y[i]) / (y[j] - y[i]) * (x[j] - x[i]);
            low = std::min({low, crossing, y[i] == y[j] ? x[j] : crossing});
            high = std::max({high, crossing, y[i] == y[j] ? x[j] : crossing});
        }
        if (!(low <= high))
            continue;
        const double width = window_.width;
        const auto from = static_cast<uint32_t>(std::clamp(std::ceil(low - 0.5), 0.0, width));
        const auto to = static_cast<uint32_t>(std::clamp(std::floor(high - 0.5) + 1, 0.0, width));
        uint32_t *next = next_.data() + size_t{row} * (window_.width + 1);
        for (uint32_t pixel = nextFree(next, from); pixel < to; pixel = nextFree(next, pixel)) {
            numbers_[size_t{row} * window_.width + pixel] = number;
            next[pixel] = pixel + 1;
            --free_;
        }
    }
}

UvBarycentrics::UvBarycentrics(const TriangleUvs &uvs) : originU_(uvs[0].u), originV_(uvs[0].v)
{
    const double ax = uvs[1].u - originU_, ay = uvs[1].v - originV_;
    const double bx = uvs[2].u - originU_, by = uvs[2].v - originV_;
    const double area = ax * by - ay * bx;
    usable_ = std::isfinite(area) && area != 0;
    if (!usable_)
        return;
    uPerU_ = by / area;
    uPerV_ = -bx / area;
    vPerU_ = -ay / area;
    vPerV_ = ax / area;
    slopeU_ = std::hypot(uPerU_, uPerV_);
    slopeV_ = std::hypot(vPerU_, vPerV_);
    slopeW_ = std::hypot(uPerU_ + vPerU_, uPerV_ + vPerV_);
}

} // namespace vellum::cli
