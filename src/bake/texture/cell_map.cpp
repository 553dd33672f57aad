#include "bake/texture/cell_map.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

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
        // No branches: this runs for every texel of a texture, and becomes vector code.
        const unsigned finite = (std::bit_cast<std::uint32_t>(alpha) & kMagnitude) < kInfinity ? 3 : 0;
        const unsigned opaque = alpha >= opaqueFrom ? kSurelyOpaque : 0;
        const unsigned transparent = alpha < transparentBelow ? kSurelyTransparent : 0;
        return static_cast<std::uint8_t>((opaque | transparent) & finite);
    }
};

// Bit k of the result is bit 0 of byte k.
std::uint64_t gather(std::uint64_t bytes)
{
    return ((bytes & 0x0101010101010101u) * 0x0102040810204080u) >> 56;
}

// The two classes of a padded row of texels, a bit each; then those of pairs of neighbours, that is of cells.
struct Bits {
    std::vector<std::uint64_t> opaque;
    std::vector<std::uint64_t> transparent;

    void pack(const std::vector<std::uint8_t> &classes)
    {
        for (std::size_t word = 0; word < opaque.size(); ++word) {
            std::uint64_t o = 0;
            std::uint64_t t = 0;
            for (std::size_t part = 0; part < 8; ++part) {
                std::uint64_t bytes = 0;
                std::memcpy(&bytes, classes.data() + word * 64 + part * 8, 8);
                if constexpr (std::endian::native == std::endian::big)
                    bytes = __builtin_bswap64(bytes);
                o |= gather(bytes) << (8 * part);
                t |= gather(bytes >> 1) << (8 * part);
            }
            opaque[word] = o;
            transparent[word] = t;
        }
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
    std::vector<std::uint8_t> classes(m_words * 64, kSurelyOpaque | kSurelyTransparent);
    Bits rows[2] = {{std::vector<std::uint64_t>(m_words), std::vector<std::uint64_t>(m_words)},
                    {std::vector<std::uint64_t>(m_words), std::vector<std::uint64_t>(m_words)}};
    const std::size_t width = m_texture.width;
    const auto lead = static_cast<std::size_t>(m_axisX.lead());
    std::uint32_t largest = std::bit_cast<std::uint32_t>(m_texture.border) & kMagnitude;
    largest = largest < kInfinity ? largest : 0;
    std::uint64_t any = 0;
    for (std::size_t padded = 0; padded <= stored; ++padded) {
        Bits &now = rows[padded % 2];
        const std::int64_t row = m_rows[padded];
        if (row < 0) {
            std::fill_n(classes.begin(), m_columns.size(), classify(m_texture.border));
        } else {
            const float *alpha = m_texture.alpha.data() + static_cast<std::size_t>(row) * width;
            for (std::size_t i = 0; i < width; ++i) {
                classes[lead + i] = classify(alpha[i]);
                const std::uint32_t magnitude = std::bit_cast<std::uint32_t>(alpha[i]) & kMagnitude;
                largest = std::max(largest, magnitude < kInfinity ? magnitude : 0);
            }
            for (std::size_t i = 0; i < m_columns.size(); ++i) {
                if (i == lead)
                    i += width;
                if (i < m_columns.size())
                    classes[i] = classify(texel(m_columns[i], row));
            }
        }
        now.pack(classes);
        if (padded == 0)
            continue;
        const Bits &before = rows[(padded - 1) % 2];
        std::uint64_t *mixed = &m_mixed[(padded - 1) * m_words];
        std::uint64_t *opaque = &m_opaque[(padded - 1) * m_words];
        for (std::size_t word = 0; word < m_words; ++word) {
            opaque[word] = now.opaque[word] & before.opaque[word];
            mixed[word] = ~(opaque[word] | (now.transparent[word] & before.transparent[word]));
            any |= mixed[word];
        }
        // The cell behind the last one has but one texel that belongs to the row.
        const std::size_t last = static_cast<std::size_t>(m_axisX.cells());
        mixed[last / 64] &= (std::uint64_t{1} << (last % 64)) - 1;
        for (std::size_t word = 0; word < m_words; ++word)
            m_mixed[stored * m_words + word] |= mixed[word];
    }
    m_anyMixed = any != 0;
    m_largest = double{std::bit_cast<float>(largest)};
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
