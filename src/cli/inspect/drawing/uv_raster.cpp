#include "cli/inspect/drawing/uv_raster.h"

#include <algorithm>
#include <cmath>

namespace vellum::cli
{

UvRaster::UvRaster(const UvWindow &window)
    : m_window(window), m_numbers(std::size_t{window.width} * window.height, -1),
      m_next(std::size_t{window.width + 1} * window.height), m_free(m_numbers.size())
{
    for (std::size_t i = 0; i < m_next.size(); ++i)
        m_next[i] = static_cast<std::uint32_t>(i % (window.width + 1));
}

std::uint32_t UvRaster::nextFree(std::uint32_t *row, std::uint32_t x) const
{
    std::uint32_t found = x;
    while (row[found] != found)
        found = row[found];
    while (row[x] != found) { // the way is shorter the next time
        const std::uint32_t next = row[x];
        row[x] = found;
        x = next;
    }
    return found;
}

void UvRaster::add(const TriangleUvs &uvs, std::int32_t number)
{
    std::array<double, 3> x{};
    std::array<double, 3> y{};
    for (std::size_t i = 0; i < 3; ++i) {
        x[i] = (uvs[i].u - m_window.left) * m_window.scale;
        y[i] = (uvs[i].v - m_window.top) * m_window.scale;
        if (!std::isfinite(x[i]) || !std::isfinite(y[i]))
            return;
    }
    const auto [least, most] = std::minmax({y[0], y[1], y[2]});
    const auto first = static_cast<std::uint32_t>(std::clamp(std::ceil(least - 0.5), 0.0, double(m_window.height)));
    const auto end = static_cast<std::uint32_t>(std::clamp(std::floor(most - 0.5) + 1, 0.0, double(m_window.height)));
    for (std::uint32_t row = first; row < end && m_free != 0; ++row) {
        const double at = row + 0.5; // pixels whose centres are inside
        double low = INFINITY;
        double high = -INFINITY;
        for (std::size_t i = 0; i < 3; ++i) {
            const std::size_t j = (i + 1) % 3;
            if (std::min(y[i], y[j]) > at || std::max(y[i], y[j]) < at)
                continue;
            const double crossing = y[i] == y[j] ? x[i] : x[i] + (at - y[i]) / (y[j] - y[i]) * (x[j] - x[i]);
            low = std::min({low, crossing, y[i] == y[j] ? x[j] : crossing});
            high = std::max({high, crossing, y[i] == y[j] ? x[j] : crossing});
        }
        if (!(low <= high))
            continue;
        const double width = m_window.width;
        const auto from = static_cast<std::uint32_t>(std::clamp(std::ceil(low - 0.5), 0.0, width));
        const auto to = static_cast<std::uint32_t>(std::clamp(std::floor(high - 0.5) + 1, 0.0, width));
        std::uint32_t *next = m_next.data() + std::size_t{row} * (m_window.width + 1);
        for (std::uint32_t pixel = nextFree(next, from); pixel < to; pixel = nextFree(next, pixel)) {
            m_numbers[std::size_t{row} * m_window.width + pixel] = number;
            next[pixel] = pixel + 1;
            --m_free;
        }
    }
}

UvBarycentrics::UvBarycentrics(const TriangleUvs &uvs) : m_originU(uvs[0].u), m_originV(uvs[0].v)
{
    const double ax = uvs[1].u - m_originU, ay = uvs[1].v - m_originV;
    const double bx = uvs[2].u - m_originU, by = uvs[2].v - m_originV;
    const double area = ax * by - ay * bx;
    m_usable = std::isfinite(area) && area != 0;
    if (!m_usable)
        return;
    m_uPerU = by / area;
    m_uPerV = -bx / area;
    m_vPerU = -ay / area;
    m_vPerV = ax / area;
    m_slopeU = std::hypot(m_uPerU, m_uPerV);
    m_slopeV = std::hypot(m_vPerU, m_vPerV);
    m_slopeW = std::hypot(m_uPerU + m_vPerU, m_uPerV + m_vPerV);
}

} // namespace vellum::cli
