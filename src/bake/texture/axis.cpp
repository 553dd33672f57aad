#include "bake/texture/axis.h"

#include <algorithm>

namespace vellum
{
namespace
{

std::int64_t modulo(std::int64_t i, std::int64_t period)
{
    if (i >= 0 && i < period)
        return i;
    const std::int64_t rest = i % period;
    return rest < 0 ? rest + period : rest;
}

std::int64_t leadOf(Wrap wrap)
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

Axis::Axis(std::uint32_t size, Wrap wrap)
    : m_size(size), m_wrap(wrap), m_cells(m_size + std::max<std::int64_t>(0, 2 * leadOf(wrap) - 1)),
      m_lead(leadOf(wrap)), m_period(wrap == Wrap::Repeat   ? m_size
                                     : wrap == Wrap::Mirror ? 2 * m_size
                                                            : 0)
{
}

std::int64_t Axis::padded(std::int64_t index) const
{
    const std::int64_t texel = index - m_lead;
    if (m_wrap == Wrap::Repeat)
        return modulo(texel, m_size);
    if (m_wrap == Wrap::Border)
        return texel >= 0 && texel < m_size ? texel : -1;
    return std::clamp<std::int64_t>(texel, 0, m_size - 1);
}

Axis::Run Axis::foldedRun(std::int64_t i, std::int64_t last) const
{
    const std::int64_t wanted = last - i + 1;
    const auto rising = [&](std::int64_t stored) { return Run{stored, 1, std::min(wanted, m_cells - stored)}; };
    const auto falling = [&](std::int64_t stored) { return Run{stored, -1, std::min(wanted, stored + 1)}; };
    switch (m_wrap) {
    case Wrap::Repeat: return rising(modulo(i, m_size));
    case Wrap::Mirror: {
        // Stored cell 0 is cell -1, between texel 0 and its mirror image; so is cell 2 * size - 1.
        const std::int64_t m = modulo(i, m_period);
        return m < m_size ? rising(m + 1) : falling(2 * m_size - 1 - m);
    }
    case Wrap::MirrorOnce:
        if (i < -m_size - 1)
            return {m_size, 0, std::min(wanted, -m_size - 1 - i)};
        if (i < -1)
            return falling(-1 - i);
        break;
    case Wrap::Clamp:
    case Wrap::Border: break;
    }
    const std::int64_t stored = i + m_lead;
    if (stored < 0)
        return {0, 0, std::min(wanted, -stored)};
    if (stored >= m_cells)
        return {m_cells - 1, 0, wanted};
    return rising(stored);
}

std::int64_t Axis::reduced(std::int64_t i) const
{
    return m_period != 0 ? modulo(i, m_period) : i;
}

} // namespace vellum
