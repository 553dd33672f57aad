// SPDX-License-Identifier: Apache-2.0
#include "bake/texture/cell_map.h"

#include <cassert>
#include <cstring>
#include <limits>
#include <memory>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include "bake/numbers/float4.h"
#include "core/portable_math.h"

namespace vellum
{
namespace
{

constexpr auto kSide = static_cast<size_t>(CellMap::kTile);
constexpr size_t kRow = kSide + 1; // the texels at their corners

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

// The bits of which the next one is set, too, that behind the last one included.
uint64_t pairs(uint64_t bits, bool last)
{
    return bits & (bits >> 1 | uint64_t{last} << 63);
}

// Finds codes within a range.
template <typename Range>
class CodeTest
{
public:
    explicit CodeTest(const Range &range) : range_(range) {}

    // Whether all of kRow codes are.
    [[nodiscard]] bool all(const uint8_t *codes) const
    {
#ifdef __SSE2__
        const __m128i most = _mm_and_si128(_mm_and_si128(mask(codes), mask(codes + 16)),
                                           _mm_and_si128(mask(codes + 32), mask(codes + 48)));
        return _mm_movemask_epi8(most) == 0xffff && range_.has(codes[kSide]);
#else
        return std::all_of(codes, codes + kRow, [this](uint8_t code) { return range_.has(code); });
#endif
    }
    // Bit k: codes[k] and codes[k + 1] are; for 64 of them.
    [[nodiscard]] uint64_t pairs(const uint8_t *codes) const
    {
        uint64_t bits = 0;
#ifdef __SSE2__
        for (size_t k = 0; k < kSide; k += 16)
            bits |= uint64_t{static_cast<uint16_t>(_mm_movemask_epi8(mask(codes + k)))} << k;
#else
        std::array<uint8_t, kSide> in;
        for (size_t k = 0; k < kSide; ++k)
            in[k] = range_.has(codes[k]) ? 1 : 0;
        for (size_t k = 0; k < kSide; k += 8) {
            uint64_t eight;
            std::memcpy(&eight, &in[k], sizeof eight);
            // Gathers the lowest bits of eight bytes, the first byte's at bit 56.
            bits |= (eight * 0x0102040810204080 >> 56) << k;
        }
#endif
        return range_.any ? vellum::pairs(bits, range_.has(codes[kSide])) : 0;
    }

private:
    Range range_;
#ifdef __SSE2__
    // 255 where one of 16 codes is.
    [[nodiscard]] __m128i mask(const uint8_t *codes) const
    {
        const __m128i from = _mm_sub_epi8(_mm_loadu_si128(reinterpret_cast<const __m128i *>(codes)), first_);
        return _mm_cmpeq_epi8(_mm_min_epu8(from, span_), from);
    }
    __m128i first_ = _mm_set1_epi8(static_cast<char>(range_.first));
    __m128i span_ = _mm_set1_epi8(static_cast<char>(range_.span));
#endif
};

} // namespace

const CellMap::Tile CellMap::kUniform{};

// Of 65 neighbouring texels of a padded row: bit k says whether texels k and k + 1 are of that class.
struct CellMap::RowBits {
    uint64_t opaque;
    uint64_t transparent;
};

// Up to 65 neighbouring columns of a padded row.
struct CellMap::Columns {
    Columns(const std::vector<int32_t> &all, size_t first)
        : texels(&all[first]), count(std::min(kRow, all.size() - first))
    {
        // None is more than 1 behind the one before.
        runEnd = count;
        if (texels[count - 1] - texels[0] == static_cast<int32_t>(count - 1))
            return;
        while (runBegin + 1 < count && texels[runBegin + 1] != texels[runBegin] + 1)
            ++runBegin;
        runEnd = runBegin;
        while (runEnd < count && texels[runEnd] - texels[runBegin] == static_cast<int32_t>(runEnd - runBegin))
            ++runEnd;
    }
    // Whether they are kRow neighbours.
    [[nodiscard]] bool isRun() const { return runEnd - runBegin == kRow; }
    // Copies the codes of these columns, none of which may be the border, from a row.
    const uint8_t *gather(const uint8_t *row, size_t stride, std::array<uint8_t, kRow> &to) const
    {
        const auto at = [&](size_t k) { return row + static_cast<size_t>(texels[k]) * stride; };
        const uint8_t *run = at(runBegin);
        const auto readRun = [&](size_t apart) {
            for (size_t k = runBegin; k < runEnd; ++k)
                to[k] = run[(k - runBegin) * apart];
        };
        for (size_t k = 0; k < runBegin; ++k)
            to[k] = *at(k);
        // The compiler reads usual strides in vectors.
        switch (stride) {
        case 1: readRun(1); break;
        case 4: readRun(4); break;
        default: readRun(stride); break;
        }
        for (size_t k = runEnd; k < count; ++k)
            to[k] = *at(k);
        return to.data();
    }

    const int32_t *texels; // -1 for the border
    size_t count;
    size_t runBegin = 0; // a run of neighbouring texels, which almost all of them are
    size_t runEnd;
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
        if (made != &kUniform)
            delete made;
    }
}

CellMap::RowBits CellMap::readValues(const Columns &columns, int64_t row) const
{
    uint64_t opaque = 0;
    uint64_t transparent = 0;
    std::array<float, kRow> values{};
    for (size_t k = 0; k < columns.count; ++k)
        values[k] = texel(columns.texels[k], row);
    // Infinities are neither.
    const Float4 most(std::numeric_limits<float>::max());
    const Float4 least(-std::numeric_limits<float>::max());
    for (size_t k = 0; k < kSide; k += 4) {
        const Float4 v = Float4::load(&values[k]);
        opaque |= uint64_t{atLeast(v, Float4(opaqueFrom_)) & atLeast(most, v)} << k;
        transparent |= uint64_t{below(v, Float4(transparentBelow_)) & atLeast(v, least)} << k;
    }
    return {pairs(opaque, isOpaque(values[kSide])), pairs(transparent, isTransparent(values[kSide]))};
}

template <typename Read>
void CellMap::Tile::make(std::span<const int32_t> rows, size_t first, uint64_t cells, Read &&read)
{
    RowBits upper = read(rows[first]);
    uint64_t any = 0;
    for (size_t y = first; y + 1 < rows.size(); ++y) {
        const RowBits lower = read(rows[y + 1]);
        mixed[y] = ~((upper.opaque & lower.opaque) | (upper.transparent & lower.transparent)) & cells;
        any |= mixed[y];
        upper = lower;
    }
    mixedColumns = any;
}

const CellMap::Tile &CellMap::makeTile(size_t column, size_t row) const
{
    const Columns columns(columns_, column * kSide);
    const std::span rows(&rows_[row * kSide], std::min(kRow, rows_.size() - row * kSide));
    const uint64_t cells = ~uint64_t{0} >> (kRow - columns.count);
    // A border is at the ends.
    const bool border = std::min({rows.front(), rows.back(), columns.texels[0], columns.texels[columns.count - 1]}) < 0;
    std::unique_ptr<Tile> tile;
    if (texture_.codes.first != nullptr && !border) {
        const uint8_t *const first = texture_.codes.first;
        const size_t stride = texture_.codes.pixelStride;
        const size_t rowStride = texture_.codes.rowStride;
        std::array<uint8_t, kRow> gathered{};
        // Neighbouring codes are read where they are.
        const uint8_t *const direct = stride == 1 && columns.isRun() ? first + columns.texels[0] : nullptr;
        const auto codesOf = [=, &columns, &gathered](int32_t texelRow) {
            const size_t at = static_cast<size_t>(texelRow) * rowStride;
            return direct != nullptr ? direct + at : columns.gather(first + at, stride, gathered);
        };
        const CodeTest opaque(opaqueCodes_);
        const CodeTest transparent(transparentCodes_);
        // Most tiles are all of one kind.
        const bool isOpaque = opaqueCodes_.has(*codesOf(rows[0]));
        const CodeTest kind = isOpaque ? opaque : transparent;
        size_t same = 0;
        if (isOpaque ? opaqueCodes_.any : transparentCodes_.any)
            while (same < rows.size() && kind.all(codesOf(rows[same])))
                ++same;
        if (same < rows.size()) {
            tile = std::make_unique<Tile>();
            tile->make(rows, std::max<size_t>(same, 1) - 1, cells, [=](int32_t texelRow) {
                const uint8_t *codes = codesOf(texelRow);
                return RowBits{opaque.pairs(codes), transparent.pairs(codes)};
            });
        }
    } else {
        tile = std::make_unique<Tile>();
        tile->make(rows, 0, cells, [&](int32_t texelRow) { return readValues(columns, texelRow); });
    }
    const Tile *made = tile != nullptr && tile->mixedColumns != 0 ? tile.get() : &kUniform;
    const Tile *first = nullptr;
    // Another thread can have made the same one.
    if (!tiles_[row * tileColumns_ + column].compare_exchange_strong(first, made, std::memory_order_acq_rel))
        return *first;
    if (made == tile.get())
        (void)tile.release();
    return *made;
}

bool CellMap::anyMixedIn(int64_t first, int64_t last) const
{
    for (size_t row = 0; row < tileRows_; ++row)
        if (scan([&](int64_t word) { return tile(static_cast<size_t>(word), row).mixedColumns; }, first, last,
                 [](uint64_t, int64_t, int64_t, bool) { return true; }))
            return true;
    return false;
}

bool CellMap::window(int64_t x, int64_t y, size_t columns, size_t rows, uint64_t *to) const
{
    std::fill_n(to, rows, 0);
    const int64_t right = x + static_cast<int64_t>(columns);
    const int64_t bottom = y + static_cast<int64_t>(rows);
    bool any = false;
    for (int64_t row = y; row < bottom;) {
        const Axis::Run down = axisY_.run(row, bottom - 1);
        for (int64_t column = x; column < right;) {
            const Axis::Run across = axisX_.run(column, right - 1);
            any = addRuns(across, down, to + (row - y), static_cast<unsigned>(column - x)) || any;
            column += across.count;
        }
        row += down.count;
    }
    return any;
}

bool CellMap::addRuns(const Axis::Run &across, const Axis::Run &down, uint64_t *to, unsigned firstBit) const
{
    const auto low = static_cast<size_t>(across.step < 0 ? across.first - across.count + 1 : across.first);
    const auto columns = static_cast<size_t>(across.step == 0 ? 1 : across.count);
    const size_t shift = low % kSide;
    const uint64_t mask = ~uint64_t{0} >> (kSide - columns);
    bool any = false;
    for (int64_t n = 0, count = 0; n < down.count; n += count) {
        // As many rows as one row of tiles has.
        const int64_t row = down.first + n * down.step;
        const int64_t most = down.step > 0 ? kTile - row % kTile : down.step < 0 ? row % kTile + 1 : down.count;
        count = std::min(down.count - n, most);
        const auto tileRow = static_cast<size_t>(row / kTile);
        const Tile &left = tile(low / kSide, tileRow);
        const Tile &beside = shift + columns > kSide ? tile(low / kSide + 1, tileRow) : kUniform;
        if (&left == &kUniform && &beside == &kUniform)
            continue;
        any = true;
        const uint64_t *const leftWords = &left.mixed[static_cast<size_t>(row % kTile)];
        const uint64_t *const besideWords = &beside.mixed[static_cast<size_t>(row % kTile)];
        uint64_t *const words = to + n;
        const auto stored = [=](int64_t k) {
            return (leftWords[k] >> shift | besideWords[k] << 1 << (kSide - 1 - shift)) & mask;
        };
        if (across.step > 0 && down.step > 0) {
            for (int64_t k = 0; k < count; ++k)
                words[k] |= stored(k) << firstBit;
            continue;
        }
        for (int64_t k = 0; k < count; ++k)
            for (int64_t c = 0; c < across.count; ++c) {
                const int64_t from = across.step < 0 ? across.count - 1 - c : across.step * c;
                words[k] |= (stored(k * down.step) >> from & 1) << (firstBit + c);
            }
    }
    return any;
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
    if ((tile(column / kSide, row / kSide).mixed[row % kSide] >> (column % kSide) & 1) != 0)
        return -1;
    return isOpaque(texel(columns_[column], rows_[row])) ? 1 : 0;
}

} // namespace vellum
