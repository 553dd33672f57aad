// SPDX-License-Identifier: Apache-2.0
#include "bake/texture/axis.h"

#include <algorithm>

namespace vellum
{
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
