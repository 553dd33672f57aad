// SPDX-License-Identifier: Apache-2.0
#include "bake/texture/cell_map.h"

#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>

#include "bake/numbers/float4.h"
#include "core/portable_math.h"

namespace vellum
{
namespace
{

constexpr auto kSide = static_cast<size_t>(CellMap::kTile);
constexpr size_t kRow = kSide + 1; // the texels at their corners

constexpr std::array<uint64_t, kSide> repeated(uint64_t word)
{
    std::array<uint64_t, kSide> words{};
    words.fill(word);
    return words;
}

// The codes from the first to the last whose value fulfils the condition: values rise or fall.
template <typename Range, typename Condition>
Range codesWhere(const std::array<float, 256> &values, Condition &&condition)
{
    Range range;
    for (size_t code = 0; code < values.size(); ++code) {
        if (!condition(values[code]))
            continue;
        if (!range.any)
            range.first = static_cast<uint8_t>(code);
        assert(code == size_t{range.first} + (code == range.first ? 0 : range.span + 1u));
        range.any = true;
        range.span = static_cast<uint8_t>(code - range.first);
    }
    return range;
}

// Bit k: codes[k] is within the range; for 64 of them.
template <typename Range>
uint64_t within(const uint8_t *codes, const Range &range)
{
    if (!range.any)
        return 0;
    std::array<uint8_t, kSide> in;
    for (size_t k = 0; k < kSide; ++k)
        in[k] = static_cast<uint8_t>(codes[k] - range.first) <= range.span ? 1 : 0;
    uint64_t bits = 0;
    for (size_t k = 0; k < kSide; k += 8) {
        uint64_t eight;
        std::memcpy(&eight, &in[k], sizeof eight);
        // Gathers the lowest bits of eight bytes, the first byte's at bit 56.
        bits |= (eight * 0x0102040810204080 >> 56) << k;
    }
    return bits;
}

} // namespace

const CellMap::Tile CellMap::kOpaque = {repeated(0), repeated(~uint64_t{0}), 0};
const CellMap::Tile CellMap::kTransparent = {repeated(0), repeated(0), 0};

// The classes of 65 neighbouring texels of a padded row: bit k for texel k, and those of the last one.
struct CellMap::RowBits {
    uint64_t opaque = 0;
    uint64_t transparent = 0;
    bool lastOpaque = false;
    bool lastTransparent = false;

    void set(size_t k, bool isOpaque, bool isTransparent)
    {
        const auto put = [&](uint64_t &bits, bool &last, bool value) {
            if (k == kSide)
                last = value;
            else
                bits = (bits & ~(uint64_t{1} << k)) | uint64_t{value} << k;
        };
        put(opaque, lastOpaque, isOpaque);
        put(transparent, lastTransparent, isTransparent);
    }
    // Of pairs of neighbours, that is of cells.
    [[nodiscard]] uint64_t opaquePairs() const { return opaque & (opaque >> 1 | uint64_t{lastOpaque} << 63); }
    [[nodiscard]] uint64_t transparentPairs() const
    {
        return transparent & (transparent >> 1 | uint64_t{lastTransparent} << 63);
    }
};

CellMap::CellMap(const AlphaTexture &texture, const Thresholds &thresholds)
    : texture_(texture), axisX_(texture.width, texture.wrapU), axisY_(texture.height, texture.wrapV),
      opaqueFrom_(floatAtLeast(thresholds.opaque)), transparentBelow_(floatAtLeast(thresholds.transparent)),
      tileColumns_((static_cast<size_t>(axisX_.cells()) + kSide - 1) / kSide),
      tileRows_((static_cast<size_t>(axisY_.cells()) + kSide - 1) / kSide), tiles_(tileColumns_ * tileRows_)
{
    const auto paddedTexels = [](const Axis &axis) {
        std::vector<int32_t> texels(static_cast<size_t>(axis.cells()) + 1);
        for (size_t i = 0; i < texels.size(); ++i)
            texels[i] = static_cast<int32_t>(axis.padded(static_cast<int64_t>(i)));
        return texels;
    };
    columns_ = paddedTexels(axisX_);
    rows_ = paddedTexels(axisY_);
    const auto include = [this](float value) {
        if (std::isfinite(value))
            largest_ = std::max(largest_, std::abs(double{value}));
    };
    include(texture.border);
    if (texture.codes.first == nullptr) {
        for (const float value : texture.alpha)
            include(value);
        return;
    }
    for (const float value : texture.codes.values)
        include(value);
    opaqueCodes_ = codesWhere<CodeRange>(texture.codes.values, [this](float value) { return isOpaque(value); });
    transparentCodes_ =
        codesWhere<CodeRange>(texture.codes.values, [this](float value) { return isTransparent(value); });
}

CellMap::~CellMap()
{
    for (const std::atomic<const Tile *> &tile : tiles_) {
        const Tile *made = tile.load(std::memory_order_relaxed);
        if (made != &kOpaque && made != &kTransparent)
            delete made;
    }
}

CellMap::RowBits CellMap::readRow(size_t firstColumn, int64_t row) const
{
    const size_t count = std::min(kRow, columns_.size() - firstColumn);
    const int32_t *columns = &columns_[firstColumn];
    const size_t first = texture_.place(0, static_cast<size_t>(std::max<int64_t>(row, 0)));
    const size_t stride = texture_.pixelStride();
    RowBits bits;
    if (row >= 0 && texture_.codes.first != nullptr) {
        std::array<uint8_t, kRow> gathered{};
        const uint8_t *codes = gathered.data();
        const uint8_t *from = texture_.codes.first + first;
        // Most tiles are whole ones, of neighbouring columns.
        if (count == kRow && columns[0] >= 0 && columns[kSide] - columns[0] == static_cast<int32_t>(kSide)) {
            from += static_cast<size_t>(columns[0]) * stride;
            if (stride == 1)
                codes = from;
            else if (stride == 4) // RGBA: the compiler reads it in vectors
                for (size_t k = 0; k < kRow; ++k)
                    gathered[k] = from[k * 4];
            else
                for (size_t k = 0; k < kRow; ++k)
                    gathered[k] = from[k * stride];
        } else {
            for (size_t k = 0; k < count; ++k)
                gathered[k] = from[static_cast<size_t>(std::max(columns[k], 0)) * stride];
        }
        bits.opaque = within(codes, opaqueCodes_);
        bits.transparent = within(codes, transparentCodes_);
        const float last = texture_.codes.values[codes[kSide]];
        bits.set(kSide, isOpaque(last), isTransparent(last));
    } else if (row >= 0) {
        std::array<float, kRow> values{};
        for (size_t k = 0; k < count; ++k)
            values[k] = texture_.alpha[first + static_cast<size_t>(std::max(columns[k], 0))];
        // Infinities are neither.
        const Float4 most(std::numeric_limits<float>::max());
        const Float4 least(-std::numeric_limits<float>::max());
        for (size_t k = 0; k < kSide; k += 4) {
            const Float4 v = Float4::load(&values[k]);
            bits.opaque |= uint64_t{atLeast(v, Float4(opaqueFrom_)) & atLeast(most, v)} << k;
            bits.transparent |= uint64_t{below(v, Float4(transparentBelow_)) & atLeast(v, least)} << k;
        }
        bits.set(kSide, isOpaque(values[kSide]), isTransparent(values[kSide]));
    }
    for (size_t k = 0; k < count && (row < 0 || texture_.wrapU == Wrap::Border); ++k)
        if (row < 0 || columns[k] < 0)
            bits.set(k, isOpaque(texture_.border), isTransparent(texture_.border));
    return bits;
}

const CellMap::Tile &CellMap::makeTile(size_t column, size_t row) const
{
    const size_t columns = std::min(kSide, static_cast<size_t>(axisX_.cells()) - column * kSide);
    const size_t rows = std::min(kSide, static_cast<size_t>(axisY_.cells()) - row * kSide);
    const uint64_t cells = ~uint64_t{0} >> (kSide - columns);
    Tile tile{};
    RowBits upper = readRow(column * kSide, rows_[row * kSide]);
    for (size_t y = 0; y < rows; ++y) {
        const RowBits lower = readRow(column * kSide, rows_[row * kSide + y + 1]);
        tile.opaque[y] = upper.opaquePairs() & lower.opaquePairs();
        tile.mixed[y] = ~(tile.opaque[y] | (upper.transparentPairs() & lower.transparentPairs())) & cells;
        tile.mixedColumns |= tile.mixed[y];
        upper = lower;
    }
    // Neighbours share texels: without a mixed cell all are on one side.
    const Tile *made = tile.mixedColumns != 0 ? new Tile(tile) : (tile.opaque[0] & 1) != 0 ? &kOpaque : &kTransparent;
    const Tile *first = nullptr;
    // Another thread can have made the same one.
    if (tiles_[row * tileColumns_ + column].compare_exchange_strong(first, made, std::memory_order_acq_rel))
        return *made;
    if (tile.mixedColumns != 0)
        delete made;
    return *first;
}

bool CellMap::anyMixedIn(int64_t first, int64_t last) const
{
    for (size_t row = 0; row < tileRows_; ++row)
        if (scan([&](int64_t word) { return tile(static_cast<size_t>(word), row).mixedColumns; }, first, last,
                 [](int64_t, int64_t, bool) { return true; }))
            return true;
    return false;
}

void CellMap::copy(int64_t x, int64_t y, size_t columns, size_t rows, float *to, size_t pitch) const
{
    // Wrapping divides.
    const auto stored = [](int64_t i, int64_t size, Wrap wrap) {
        return i >= 0 && i < size ? i : wrapTexel(i, size, wrap);
    };
    std::array<int64_t, kMostCopied> from;
    for (size_t column = 0; column < columns; ++column)
        from[column] = stored(x + static_cast<int64_t>(column), texture_.width, texture_.wrapU);
    for (size_t row = 0; row < rows; ++row, to += pitch) {
        const int64_t at = stored(y + static_cast<int64_t>(row), texture_.height, texture_.wrapV);
        for (size_t column = 0; column < columns; ++column)
            to[column] = texel(from[column], at);
    }
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
    const auto row = static_cast<size_t>(axisY_.run(y, y).first);
    const Tile &found = tile(column / kSide, row / kSide);
    if ((found.mixed[row % kSide] >> (column % kSide) & 1) != 0)
        return -1;
    return static_cast<int>(found.opaque[row % kSide] >> (column % kSide) & 1);
}

} // namespace vellum
