#include "bake/texture/cell_map.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "bake/numbers/float4.h"

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

constexpr std::uint32_t kMagnitude = 0x7fffffff;
constexpr std::uint32_t kInfinity = 0x7f800000;

// What is known of a texel, as bits of a byte.
constexpr std::uint8_t kSurelyOpaque = 1;
constexpr std::uint8_t kSurelyTransparent = 2;

struct Classes {
    float opaqueFrom;
    float transparentBelow;

    [[nodiscard]] std::uint8_t operator()(float alpha) const
    {
        if ((std::bit_cast<std::uint32_t>(alpha) & kMagnitude) >= kInfinity)
            return 0;
        return static_cast<std::uint8_t>((alpha >= opaqueFrom ? kSurelyOpaque : 0) |
                                         (alpha < transparentBelow ? kSurelyTransparent : 0));
    }
};

// The two classes of a padded row of texels, a bit each; then those of pairs of neighbours, that is of cells.
struct Bits {
    std::vector<std::uint64_t> opaque;
    std::vector<std::uint64_t> transparent;

    void set(std::size_t at, std::uint8_t classes)
    {
        const std::uint64_t bit = std::uint64_t{1} << (at % 64);
        std::uint64_t &o = opaque[at / 64];
        std::uint64_t &t = transparent[at / 64];
        o = (classes & kSurelyOpaque) != 0 ? o | bit : o & ~bit;
        t = (classes & kSurelyTransparent) != 0 ? t | bit : t & ~bit;
    }

    // Sets the bits of a row of texels from bit 0 on. Returns the largest magnitude of those that are finite.
    float read(const float *alpha, std::size_t width, const Classes &classify)
    {
        const Float4 from(classify.opaqueFrom);
        const Float4 to(classify.transparentBelow);
        Float4 low(0.0f);
        Float4 high(0.0f);
        std::size_t i = 0;
        // This runs for every texel of a texture.
        for (std::size_t word = 0; i + 64 <= width; ++word, i += 64) {
            std::uint64_t o = 0;
            std::uint64_t t = 0;
            for (std::size_t part = 0; part < 64; part += 4) {
                const Float4 v = Float4::load(alpha + i + part);
                o |= std::uint64_t{atLeast(v, from)} << part;
                t |= std::uint64_t{below(v, to)} << part;
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
    void moveUp(std::size_t count)
    {
        if (count == 0)
            return;
        for (std::vector<std::uint64_t> *bits : {&opaque, &transparent})
            for (std::size_t word = bits->size(); word-- > 0;)
                (*bits)[word] = (*bits)[word] << count | (word > 0 ? (*bits)[word - 1] >> (64 - count) : 0);
    }

    void toCells()
    {
        for (std::vector<std::uint64_t> *bits : {&opaque, &transparent})
            for (std::size_t word = 0; word < bits->size(); ++word) {
                const std::uint64_t next = word + 1 < bits->size() ? (*bits)[word + 1] : 0;
                (*bits)[word] &= (*bits)[word] >> 1 | next << 63;
            }
    }
};

} // namespace

CellMap::CellMap(const AlphaTexture &texture, const Thresholds &thresholds)
    : m_texture(texture), m_axisX(texture.width, texture.wrapU), m_axisY(texture.height, texture.wrapV),
      m_words(static_cast<std::size_t>(m_axisX.cells()) / 64 + 1)
{
    const auto paddedTexels = [](const Axis &axis) {
        std::vector<std::int32_t> texels(static_cast<std::size_t>(axis.cells()) + 1);
        for (std::size_t i = 0; i < texels.size(); ++i)
            texels[i] = static_cast<std::int32_t>(axis.padded(static_cast<std::int64_t>(i)));
        return texels;
    };
    m_columns = paddedTexels(m_axisX);
    m_rows = paddedTexels(m_axisY);
    fill(thresholds);
}

void CellMap::fill(const Thresholds &thresholds)
{
    const Classes classify{atLeast(thresholds.opaque), atLeast(thresholds.transparent)};
    const auto stored = static_cast<std::size_t>(m_axisY.cells());
    m_mixed.resize((stored + 1) * m_words);
    m_opaque.resize(stored * m_words);

    // Words of 64 padded texels, and one for the last cell's right neighbour. What lies behind the row counts as opaque
    // and transparent, which no cell of the row sees and which leaves the rest of a word unmixed.
    Bits rows[2] = {{std::vector<std::uint64_t>(m_words), std::vector<std::uint64_t>(m_words)},
                    {std::vector<std::uint64_t>(m_words), std::vector<std::uint64_t>(m_words)}};
    const std::size_t width = m_texture.width;
    const auto lead = static_cast<std::size_t>(m_axisX.lead());
    float largest = std::isfinite(m_texture.border) ? std::abs(m_texture.border) : 0;
    std::uint64_t any = 0;
    for (std::size_t padded = 0; padded <= stored; ++padded) {
        Bits &now = rows[padded % 2];
        const std::int64_t row = m_rows[padded];
        if (row >= 0) {
            const float *alpha = m_texture.alpha.data() + static_cast<std::size_t>(row) * width;
            largest = std::max(largest, now.read(alpha, width, classify));
            now.moveUp(lead);
        }
        for (std::size_t i = 0; i < m_words * 64; ++i) {
            if (row >= 0 && i == lead)
                i += width;
            if (i < m_columns.size())
                now.set(i, classify(texel(m_columns[i], row)));
            else if (i < m_words * 64)
                now.set(i, kSurelyOpaque | kSurelyTransparent);
        }
        now.toCells();
        if (padded == 0)
            continue;
        const Bits &before = rows[(padded - 1) % 2];
        std::uint64_t *mixed = &m_mixed[(padded - 1) * m_words];
        std::uint64_t *opaque = &m_opaque[(padded - 1) * m_words];
        for (std::size_t word = 0; word < m_words; ++word) {
            opaque[word] = now.opaque[word] & before.opaque[word];
            mixed[word] = ~(opaque[word] | (now.transparent[word] & before.transparent[word]));
        }
        // The cell behind the last one has but one texel that belongs to the row.
        const std::size_t last = static_cast<std::size_t>(m_axisX.cells());
        mixed[last / 64] &= (std::uint64_t{1} << (last % 64)) - 1;
        for (std::size_t word = 0; word < m_words; ++word) {
            m_mixed[stored * m_words + word] |= mixed[word];
            any |= mixed[word];
        }
    }
    m_anyMixed = any != 0;
    m_largest = double{largest};
}

CellMap::Rows CellMap::rowsOf(const Axis::Run &run) const
{
    const auto at = static_cast<std::size_t>(run.first);
    const bool mirrored = run.step < 0;
    return {m_rows[mirrored ? at + 1 : at], m_rows[mirrored ? at : at + 1]};
}

Cell CellMap::cell(std::int64_t x, std::int64_t y) const
{
    const Axis::Run column = m_axisX.run(x, x);
    return read(place(x, y, column.first, column.step < 0, rowsOf(m_axisY.run(y, y))));
}

int CellMap::side(std::int64_t x, std::int64_t y) const
{
    const auto column = static_cast<std::size_t>(m_axisX.run(x, x).first);
    const std::size_t word = static_cast<std::size_t>(m_axisY.run(y, y).first) * m_words + column / 64;
    if ((m_mixed[word] >> (column % 64) & 1) != 0)
        return -1;
    return static_cast<int>(m_opaque[word] >> (column % 64) & 1);
}

} // namespace vellum
