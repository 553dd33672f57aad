// SPDX-License-Identifier: Apache-2.0
#include "verify/texels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace vellum::verify
{
namespace
{

constexpr int64_t kGroundSquare = 4;
constexpr Range kNoTexels{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
constexpr float kFloatInfinity = std::numeric_limits<float>::infinity();

void widen(Range &range, double low, double high)
{
    range.low = std::min(range.low, low);
    range.high = std::max(range.high, high);
}

void includeTexel(Range &range, float value)
{
    if (std::isfinite(value))
        widen(range, value, value);
    else
        range = {-kFloatInfinity, kFloatInfinity};
}

// Stored positions that a run of unwrapped ones along an axis reads.
struct Stored {
    struct Span {
        int64_t first, last;
    };
    std::array<Span, 3> spans;
    unsigned count = 0;
    bool border = false;

    void add(int64_t first, int64_t last)
    {
        if (first <= last)
            spans[count++] = {first, last};
    }
};

int64_t modulo(int64_t a, int64_t b)
{
    const int64_t rest = a % b;
    return rest < 0 ? rest + b : rest;
}

Stored storedOf(int64_t first, int64_t last, int64_t size, Wrap wrap)
{
    Stored stored;
    const auto clamped = [&](int64_t i) { return std::clamp<int64_t>(i, 0, size - 1); };
    const bool periodic = wrap == Wrap::Repeat || wrap == Wrap::Mirror;
    if (periodic && last - first + 1 >= size) {
        stored.add(0, size - 1);
        return stored;
    }
    switch (wrap) {
    case Wrap::Repeat: {
        const int64_t from = modulo(first, size);
        const int64_t to = from + (last - first);
        stored.add(from, std::min(to, size - 1));
        stored.add(0, to - size);
        break;
    }
    case Wrap::Mirror: {
        // Forwards, backwards, and forwards again.
        const int64_t from = modulo(first, 2 * size);
        const int64_t to = from + (last - first);
        stored.add(from, std::min(to, size - 1));
        stored.add(2 * size - 1 - std::min(to, 2 * size - 1), 2 * size - 1 - std::max(from, size));
        stored.add(0, to - 2 * size);
        break;
    }
    case Wrap::Clamp: stored.add(clamped(first), clamped(last)); break;
    case Wrap::Border:
        stored.border = first < 0 || last >= size;
        stored.add(std::max<int64_t>(first, 0), std::min(last, size - 1));
        break;
    case Wrap::MirrorOnce:
        if (first < 0)
            stored.add(clamped(-1 - std::min<int64_t>(last, -1)), clamped(-1 - first));
        if (last >= 0)
            stored.add(clamped(std::max<int64_t>(first, 0)), clamped(last));
        break;
    }
    return stored;
}

} // namespace

Texels::Texels(const AlphaTexture &texture) : texture_(texture)
{
    if (!texture.isComplete())
        throw std::invalid_argument("a texture without a value for each texel");
    if (std::isfinite(texture.border))
        largest_ = std::abs(double{texture.border});
    addGroundFloor();
    while (floors_.back().width > 1 || floors_.back().height > 1)
        addFloor();
}

void Texels::addGroundFloor()
{
    const auto squares = [](int64_t size) { return (size + kGroundSquare - 1) / kGroundSquare; };
    Floor floor{squares(texture_.width), squares(texture_.height), {}, {}};
    const auto count = static_cast<size_t>(floor.width * floor.height);
    floor.low.assign(count, kFloatInfinity);
    floor.high.assign(count, -kFloatInfinity);
    for (int64_t y = 0; y < texture_.height; ++y) {
        for (int64_t x = 0; x < texture_.width; ++x) {
            const float value = stored(x, y);
            const auto square = static_cast<size_t>(y / kGroundSquare * floor.width + x / kGroundSquare);
            const bool finite = std::isfinite(value);
            if (finite)
                largest_ = std::max(largest_, std::abs(double{value}));
            floor.low[square] = finite ? std::min(floor.low[square], value) : -kFloatInfinity;
            floor.high[square] = finite ? std::max(floor.high[square], value) : kFloatInfinity;
        }
    }
    floors_.push_back(std::move(floor));
}

void Texels::addFloor()
{
    const Floor &below = floors_.back();
    Floor floor{(below.width + 1) / 2, (below.height + 1) / 2, {}, {}};
    const auto count = static_cast<size_t>(floor.width * floor.height);
    floor.low.assign(count, kFloatInfinity);
    floor.high.assign(count, -kFloatInfinity);
    for (int64_t y = 0; y < below.height; ++y) {
        for (int64_t x = 0; x < below.width; ++x) {
            const auto from = static_cast<size_t>(y * below.width + x);
            const auto to = static_cast<size_t>(y / 2 * floor.width + x / 2);
            floor.low[to] = std::min(floor.low[to], below.low[from]);
            floor.high[to] = std::max(floor.high[to], below.high[from]);
        }
    }
    floors_.push_back(std::move(floor));
}

float Texels::at(int64_t x, int64_t y) const
{
    const auto position = [](int64_t i, int64_t size, Wrap wrap) -> int64_t {
        if (i >= 0 && i < size)
            return i;
        const Stored stored = storedOf(i, i, size, wrap);
        return stored.border ? -1 : stored.spans[0].first;
    };
    const int64_t column = position(x, texture_.width, texture_.wrapU);
    const int64_t row = position(y, texture_.height, texture_.wrapV);
    if (column < 0 || row < 0)
        return texture_.border;
    return stored(column, row);
}

Range Texels::stored(int64_t left, int64_t right, int64_t top, int64_t bottom) const
{
    constexpr int64_t kFew = 8;
    Range range = kNoTexels;
    const int64_t longest = std::max(right - left, bottom - top) + 1;
    if (longest <= kFew) {
        for (int64_t y = top; y <= bottom; ++y)
            for (int64_t x = left; x <= right; ++x)
                includeTexel(range, stored(x, y));
        return range;
    }
    size_t number = 0;
    int64_t square = kGroundSquare;
    while (number + 1 < floors_.size() && longest > 4 * square) {
        ++number;
        square *= 2;
    }
    const Floor &floor = floors_[number];
    for (int64_t y = top / square; y <= bottom / square; ++y) {
        for (int64_t x = left / square; x <= right / square; ++x) {
            const auto i = static_cast<size_t>(y * floor.width + x);
            widen(range, floor.low[i], floor.high[i]);
        }
    }
    return range;
}

Range Texels::range(const TexelBox &box) const
{
    const Stored columns = storedOf(box.left, box.right, texture_.width, texture_.wrapU);
    const Stored rows = storedOf(box.top, box.bottom, texture_.height, texture_.wrapV);
    Range range = kNoTexels;
    if (columns.border || rows.border)
        includeTexel(range, texture_.border);
    for (unsigned r = 0; r < rows.count; ++r) {
        for (unsigned c = 0; c < columns.count; ++c) {
            const Range part =
                stored(columns.spans[c].first, columns.spans[c].last, rows.spans[r].first, rows.spans[r].last);
            widen(range, part.low, part.high);
        }
    }
    return range;
}

Range Texels::all() const
{
    Range range = stored(0, texture_.width - 1, 0, texture_.height - 1);
    if (texture_.wrapU == Wrap::Border || texture_.wrapV == Wrap::Border)
        includeTexel(range, texture_.border);
    return range;
}

} // namespace vellum::verify
