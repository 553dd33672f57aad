// SPDX-License-Identifier: Apache-2.0
#include "bake/texture/cell_map.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "bake/numbers/float4.h"
#include "core/bit_cast.h"

namespace vellum
{
namespace
{

// The least float that is not below `value`, so that comparing floats with it is comparing them with `value`.
float atLeast(double value)
{
    if (value > double{std::numeric_limits<float>::max()})
        return std::numeric_limits<float>::infinity();
    if (value < -double{std::numeric_limits<float>::max()})
        return -std::numeric_limits<float>::max();
    const auto rounded = static_cast<float>(value);
    return double{rounded} >= value ? rounded : std::nextafter(rounded, std::numeric_limits<float>::infinity());
}

constexpr uint32_t kMagnitude = 0x7fffffff;
constexpr uint32_t kInfinity = 0x7f800000;

// Facts about a texel, as bits of a byte.
constexpr uint8_t kSurelyOpaque = 1;
constexpr uint8_t kSurelyTransparent = 2;

struct Classes {
    float opaqueFrom;
    float transparentBelow;

    [[nodiscard]] uint8_t operator()(float alpha) const
    {
        if ((bitCast<uint32_t>(alpha) & kMagnitude) >= kInfinity)
            return 0;
        return static_cast<uint8_t>((alpha >= opaqueFrom ? kSurelyOpaque : 0) |
                                    (alpha < transparentBelow ? kSurelyTransparent : 0));
    }
};

// The two classes of a padded row of texels, a bit each; then those of pairs of neighbours, that is of cells.
struct Bits {
    std::vector<uint64_t> opaque;
    std::vector<uint64_t> transparent;

    void set(size_t at, uint8_t classes)
    {
        const uint64_t bit = uint64_t{1} << (at % 64);
        uint64_t &o = opaque[at / 64];
        uint64_t &t = transparent[at / 64];
        o = (classes & kSurelyOpaque) != 0 ? o | bit : o & ~bit;
        t = (classes & kSurelyTransparent) != 0 ? t | bit : t & ~bit;
    }

    // Sets the bits of a row of texels from bit 0 on. Returns the largest magnitude of those that are finite.
    float read(const float *alpha, size_t width, const Classes &classify)
    {
        const Float4 from(classify.opaqueFrom);
        const Float4 to(classify.transparentBelow);
        Float4 low(0.0f);
        Float4 high(0.0f);
        size_t i = 0;
        // This runs for every texel of a texture.
        for (size_t word = 0; i + 64 <= width; ++word, i += 64) {
            uint64_t o = 0;
            uint64_t t = 0;
            for (size_t part = 0; part < 64; part += 4) {
                const Float4 v = Float4::load(alpha + i + part);
                o |= uint64_t{atLeast(v, from)} << part;
                t |= uint64_t{below(v, to)} << part;
                low = min(v, low); // and not the other way round: a NaN is passed over
                high = max(v, high);
            }
            opaque[word] = o;
            transparent[word] = t;
        }
        float largest = std::max(high.most(), -low.least());
        if (largest > std::numeric_limits<float>::max()) {
            // Infinities are classified like numbers above, which they must not be.
            largest = 0;
            i = 0;
        }
        for (; i < width; ++i) {
            set(i, classify(alpha[i]));
            if (std::isfinite(alpha[i]))
                largest = std::max(largest, std::abs(alpha[i]));
        }
        return largest;
    }

    // Moves what is there by some bits, fewer than 64.
    void moveUp(size_t count)
    {
        if (count == 0)
            return;
        for (std::vector<uint64_t> *bits : {&opaque, &transparent})
            for (size_t word = bits->size(); word-- > 0;)
                (*bits)[word] = (*bits)[word] << count | (word > 0 ? (*bits)[word - 1] >> (64 - count) : 0);
    }

    void toCells()
    {
        for (std::vector<uint64_t> *bits : {&opaque, &transparent})
            for (size_t word = 0; word < bits->size(); ++word) {
                const uint64_t next = word + 1 < bits->size() ? (*bits)[word + 1] : 0;
                (*bits)[word] &= (*bits)[word] >> 1 | next << 63;
            }
    }
};

} // namespace

CellMap::CellMap(const AlphaTexture &texture, const Thresholds &thresholds)
    : texture_(texture), axisX_(texture.width, texture.wrapU), axisY_(texture.height, texture.wrapV),
      words_(static_cast<size_t>(axisX_.cells()) / 64 + 1)
{
    const auto paddedTexels = [](const Axis &axis) {
        std::vector<int32_t> texels(static_cast<size_t>(axis.cells()) + 1);
        for (size_t i = 0; i < texels.size(); ++i)
            texels[i] = static_cast<int32_t>(axis.padded(static_cast<int64_t>(i)));
        return texels;
    };
    columns_ = paddedTexels(axisX_);
    rows_ = paddedTexels(axisY_);
    fill(thresholds);
}

void CellMap::fill(const Thresholds &thresholds)
{
    const Classes classify{atLeast(thresholds.opaque), atLeast(thresholds.transparent)};
    const auto stored = static_cast<size_t>(axisY_.cells());
    mixed_.resize((stored + 1) * words_);
    opaque_.resize(stored * words_);

    // Words of 64 padded texels, and one for the last cell's right neighbour. What lies behind the row counts as opaque
    // and transparent, which no cell of the row sees and which leaves the rest of a word unmixed.
    Bits rows[2] = {{std::vector<uint64_t>(words_), std::vector<uint64_t>(words_)},
                    {std::vector<uint64_t>(words_), std::vector<uint64_t>(words_)}};
    const size_t width = texture_.width;
    const auto lead = static_cast<size_t>(axisX_.lead());
    float largest = std::isfinite(texture_.border) ? std::abs(texture_.border) : 0;
    uint64_t any = 0;
    for (size_t padded = 0; padded <= stored; ++padded) {
        Bits &now = rows[padded % 2];
        const int64_t row = rows_[padded];
        if (row >= 0) {
            const float *alpha = texture_.alpha.data() + static_cast<size_t>(row) * width;
            largest = std::max(largest, now.read(alpha, width, classify));
            now.moveUp(lead);
        }
        for (size_t i = 0; i < words_ * 64; ++i) {
            if (row >= 0 && i == lead)
                i += width;
            if (i < columns_.size())
                now.set(i, classify(texel(columns_[i], row)));
            else if (i < words_ * 64)
                now.set(i, kSurelyOpaque | kSurelyTransparent);
        }
        now.toCells();
        if (padded == 0)
            continue;
        const Bits &before = rows[(padded - 1) % 2];
        uint64_t *mixed = &mixed_[(padded - 1) * words_];
        uint64_t *opaque = &opaque_[(padded - 1) * words_];
        for (size_t word = 0; word < words_; ++word) {
            opaque[word] = now.opaque[word] & before.opaque[word];
            mixed[word] = ~(opaque[word] | (now.transparent[word] & before.transparent[word]));
        }
        // The cell behind the last one has but one texel that belongs to the row.
        const size_t last = static_cast<size_t>(axisX_.cells());
        mixed[last / 64] &= (uint64_t{1} << (last % 64)) - 1;
        for (size_t word = 0; word < words_; ++word) {
            mixed_[stored * words_ + word] |= mixed[word];
            any |= mixed[word];
        }
    }
    anyMixed_ = any != 0;
    largest_ = double{largest};
}

CellMap::Rows CellMap::rowsOf(const Axis::Run &run) const
{
    const auto at = static_cast<size_t>(run.first);
    const bool mirrored = run.step < 0;
    return {rows_[mirrored ? at + 1 : at], rows_[mirrored ? at : at + 1]};
}

Cell CellMap::cell(int64_t x, int64_t y) const
{
    const Axis::Run column = axisX_.run(x, x);
    return read(place(x, y, column.first, column.step < 0, rowsOf(axisY_.run(y, y))));
}

int CellMap::side(int64_t x, int64_t y) const
{
    const auto column = static_cast<size_t>(axisX_.run(x, x).first);
    const size_t word = static_cast<size_t>(axisY_.run(y, y).first) * words_ + column / 64;
    if ((mixed_[word] >> (column % 64) & 1) != 0)
        return -1;
    return static_cast<int>(opaque_[word] >> (column % 64) & 1);
}

} // namespace vellum
