#include "bake/cell_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vellum
{
namespace
{

std::int64_t floorToInt(double x)
{
    return static_cast<std::int64_t>(std::floor(x));
}

// Extent in x of the part of the triangle between two horizontal lines; low > high where there is none.
void extentBetween(const std::array<Footprint::Point, 3> &corners, double top, double bottom, double &low, double &high)
{
    low = std::numeric_limits<double>::infinity();
    high = -low;
    const auto include = [&](double x) {
        low = std::min(low, x);
        high = std::max(high, x);
    };
    for (std::size_t i = 0; i < 3; ++i) {
        const Footprint::Point &a = corners[i];
        const Footprint::Point &b = corners[(i + 1) % 3];
        if (a.y >= top && a.y <= bottom)
            include(a.x);
        for (const double line : {top, bottom})
            if ((a.y < line) != (b.y < line))
                include(a.x + (b.x - a.x) * ((line - a.y) / (b.y - a.y)));
    }
}

} // namespace

std::int64_t CellGrid::Axis::map(std::int64_t cell) const
{
    // With bilinear filtering the first stored cell is -1, half a texel before the first centre: there the left texel
    // comes from across the border (repeat) or is the first one again (mirror, clamp).
    if (!bilinear)
        return wrapTexel(cell, size, wrap);
    switch (wrap) {
    case Wrap::Repeat: return wrapTexel(cell, size, wrap) + 1;
    case Wrap::Mirror: {
        const std::int64_t m = wrapTexel(cell, 2 * size, Wrap::Repeat);
        return m < size ? m + 1 : 2 * size - 1 - m;
    }
    case Wrap::Clamp: break;
    }
    return std::clamp<std::int64_t>(cell, -1, size - 1) + 1;
}

unsigned CellGrid::outcomesOf(double low, double high) const
{
    // Written so that NaN proves nothing.
    return (low >= m_opaqueFrom ? 0u : unsigned{kMayBeTransparent}) |
           (high < m_transparentBelow ? 0u : unsigned{kMayBeOpaque});
}

CellGrid::CellGrid(const AlphaTexture &texture, double cutoff, double valueTolerance)
    : m_texture(texture), m_opaqueFrom(cutoff + valueTolerance), m_transparentBelow(cutoff - valueTolerance),
      m_u{texture.width, texture.wrapU, texture.filter == Filter::Bilinear}, m_v{texture.height, texture.wrapV,
                                                                                 texture.filter == Filter::Bilinear}
{
    const bool bilinear = m_u.bilinear;
    const std::int64_t columns = m_u.stored();
    const std::int64_t rows = m_v.stored();
    const std::int64_t origin = bilinear ? -1 : 0;
    m_before.resize(static_cast<std::size_t>((columns + 1) * rows));
    for (std::int64_t r = 0; r < rows; ++r) {
        Before *before = &m_before[static_cast<std::size_t>(r * (columns + 1))];
        for (std::int64_t c = 0; c < columns; ++c) {
            unsigned possible = 0;
            bool some[2] = {true, true};
            for (std::int64_t k = 0; k < (bilinear ? 4 : 1); ++k) {
                const float a = texture.texel(c + origin + (k & 1), r + origin + (k >> 1));
                some[0] = some[0] && a >= m_opaqueFrom;
                some[1] = some[1] && a < m_transparentBelow;
            }
            possible = (some[0] ? 0u : unsigned{kMayBeTransparent}) | (some[1] ? 0u : unsigned{kMayBeOpaque});
            m_everywhere |= possible;
            before[c + 1] = {before[c].transparent + (possible & kMayBeTransparent),
                             before[c].opaque + ((possible & kMayBeOpaque) >> 1)};
        }
    }
}

Footprint::Point CellGrid::position(double u, double v) const
{
    const double shift = m_u.bilinear ? 0.5 : 0.0;
    return {u * m_texture.width - shift, v * m_texture.height - shift};
}

unsigned CellGrid::storedRange(std::int64_t first, std::int64_t last, std::int64_t row) const
{
    const Before *before = &m_before[static_cast<std::size_t>(row * (m_u.stored() + 1))];
    const Before &a = before[first];
    const Before &b = before[last + 1];
    return (b.transparent != a.transparent ? unsigned{kMayBeTransparent} : 0u) |
           (b.opaque != a.opaque ? unsigned{kMayBeOpaque} : 0u);
}

unsigned CellGrid::rowRange(std::int64_t first, std::int64_t last, std::int64_t row) const
{
    const std::int64_t storedRow = m_v.map(row);
    if (m_u.wrap == Wrap::Clamp)
        return storedRange(m_u.map(first), m_u.map(last), storedRow);
    if (last - first >= 2 * m_u.size)
        return storedRange(0, m_u.stored() - 1, storedRow);
    // Between multiples of the size the mapping is monotonous, up (repeat, mirror) or down (mirror).
    unsigned possible = 0;
    while (first <= last && possible != kMayBeEither) {
        const std::int64_t end = std::min(last, first - wrapTexel(first, m_u.size, Wrap::Repeat) + m_u.size - 1);
        const auto [low, high] = std::minmax({m_u.map(first), m_u.map(end)});
        possible |= storedRange(low, high, storedRow);
        first = end + 1;
    }
    return possible;
}

// Outcomes in a part of one cell. A bilinear function on a rectangle has its extremes at the corners.
unsigned CellGrid::insideCell(std::int64_t x, std::int64_t y, Range across, Range down) const
{
    const double t[4] = {m_texture.texel(x, y), m_texture.texel(x + 1, y), m_texture.texel(x, y + 1),
                         m_texture.texel(x + 1, y + 1)};
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    for (const double px : {across.low, across.high}) {
        for (const double py : {down.low, down.high}) {
            const double a = std::clamp(px - static_cast<double>(x), 0.0, 1.0);
            const double b = std::clamp(py - static_cast<double>(y), 0.0, 1.0);
            const double value = (t[0] * (1 - a) + t[1] * a) * (1 - b) + (t[2] * (1 - a) + t[3] * a) * b;
            if (std::isnan(value))
                return kMayBeEither;
            low = std::min(low, value);
            high = std::max(high, value);
        }
    }
    // The roundings above, a few units in the last place of values around 1.
    const double rounding = 1e-12 * std::max({1.0, std::abs(low), std::abs(high)});
    return outcomesOf(low - rounding, high + rounding);
}

bool CellGrid::farTooLarge(std::int64_t rows) const
{
    return rows > 4 * m_v.size + 64;
}

unsigned CellGrid::outcomes(const Footprint &footprint) const
{
    const auto &[a, b, c] = footprint.corners;
    const Range down = {std::min({a.y, b.y, c.y}) - footprint.marginY, std::max({a.y, b.y, c.y}) + footprint.marginY};
    const std::int64_t firstRow = floorToInt(down.low);
    const std::int64_t lastRow = floorToInt(down.high);
    if (farTooLarge(lastRow - firstRow + 1))
        return m_everywhere;
    // Where micro-triangles are not much larger than texels, whole cells are too coarse a bound.
    constexpr std::int64_t kLookInside = 4;
    const bool few = m_u.bilinear && lastRow - firstRow < kLookInside;

    unsigned possible = 0;
    for (std::int64_t row = firstRow; row <= lastRow && possible != kMayBeEither; ++row) {
        const auto top = static_cast<double>(row);
        Range across;
        extentBetween(footprint.corners, top - footprint.marginY, top + 1 + footprint.marginY, across.low, across.high);
        if (across.low > across.high)
            continue;
        across = {across.low - footprint.marginX, across.high + footprint.marginX};
        const std::int64_t first = floorToInt(across.low);
        const std::int64_t last = floorToInt(across.high);
        const unsigned whole = rowRange(first, last, row);
        if (!few || whole != kMayBeEither || last - first >= kLookInside) {
            possible |= whole;
            continue;
        }
        for (std::int64_t x = first; x <= last; ++x)
            possible |= insideCell(x, row, across, down);
    }
    return possible;
}

} // namespace vellum
