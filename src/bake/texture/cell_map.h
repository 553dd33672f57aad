// SPDX-License-Identifier: Apache-2.0
// The cells of a texture in which the alpha test can change: one bit for each cell, the square between four texel
// centres.
//
// In a cell whose four texels are on one side of the cutoff the filtered value stays there, whatever the filter. Only
// the other cells, the mixed ones, need closer examination, and they are few: the outlines of leaves.
//
// The bits are made in tiles of 64 x 64 cells, each when it is first needed: of textures of 8 bits, a texel that no
// triangle comes near is never read.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "bake/texture/texture.h"

namespace vellum
{

// A filtered value is certainly opaque from `opaque` on, and certainly transparent below `transparent`. They differ
// only by the tolerance of values.
struct Thresholds {
    double transparent;
    double opaque;
};

// A cell and the texels at its corners, named by their position in the cell: f<x><y>. Cells are counted in unwrapped
// positions, from an origin that the caller chooses.
struct Cell {
    int64_t x;
    int64_t y;
    float f00, f10, f01, f11;
};

// Safe to use from several threads.
class CellMap
{
public:
    static constexpr int64_t kTile = 64; // cells along a side

    // `texture` must outlive the map.
    CellMap(const AlphaTexture &texture, const Thresholds &thresholds);
    ~CellMap();
    CellMap(const CellMap &) = delete;
    CellMap &operator=(const CellMap &) = delete;

    [[nodiscard]] const Axis &axisX() const { return axisX_; }
    [[nodiscard]] const Axis &axisY() const { return axisY_; }
    // No finite value that the texture can have is further from 0 than this.
    [[nodiscard]] double largest() const { return largest_; }

    // The texels of a cell.
    [[nodiscard]] Cell cell(int64_t x, int64_t y) const;
    // 1: all of the cell is opaque, 0: transparent, -1: mixed.
    [[nodiscard]] int side(int64_t x, int64_t y) const;
    // Copies the texels of at most kMostCopied columns, and of some rows, from position (x, y) on. In `to`, rows are
    // `pitch` values apart.
    static constexpr size_t kMostCopied = 16;
    void copy(int64_t x, int64_t y, size_t columns, size_t rows, float *to, size_t pitch) const;
    // Returns whether the texels of the cells from (x0, y0) to (x1, y1) lie in the texture as they do in the plane.
    [[nodiscard]] bool isInside(int64_t x0, int64_t y0, int64_t x1, int64_t y1) const
    {
        return x0 >= 0 && y0 >= 0 && x1 + 1 < texture_.width && y1 + 1 < texture_.height;
    }
    // Where the texels of a cell are: rows and columns, -1 for the border.
    struct Place {
        int64_t x, y;
        int64_t left, right, upper, lower;
    };
    [[nodiscard]] Cell read(const Place &place) const
    {
        return {place.x,
                place.y,
                texel(place.left, place.upper),
                texel(place.right, place.upper),
                texel(place.left, place.lower),
                texel(place.right, place.lower)};
    }
    // Has the processor load the texels of a cell meanwhile.
    void prefetch(const Place &place) const
    {
#ifdef VELLUM_PORTABLE
        static_cast<void>(place);
#else
        for (const int64_t row : {place.upper, place.lower}) {
            const size_t at = texture_.place(static_cast<size_t>(std::max<int64_t>(place.left, 0)),
                                             static_cast<size_t>(std::max<int64_t>(row, 0)));
            if (texture_.codes.first != nullptr)
                __builtin_prefetch(texture_.codes.first + at);
            else
                __builtin_prefetch(texture_.alpha.data() + at);
        }
#endif
    }
    // Mixed cells of a row, at most 64 neighbours: bit k says whether the k-th cell from `x` on is one, or the k-th
    // before it where the texture is mirrored.
    struct Word {
        uint64_t mixed;
        int64_t x, y;
        int64_t stored; // the column
        bool mirrored;

        [[nodiscard]] int64_t column(int k) const { return mirrored ? x - k : x + k; }
    };
    // Calls `sink` with the words of row `y` from column `first` to `last` that have mixed cells until it returns true;
    // returns whether it did.
    template <typename Sink>
    bool forMixed(int64_t y, int64_t first, int64_t last, Sink &&sink) const
    {
        const auto row = static_cast<size_t>(axisY_.run(y, y).first);
        const size_t tileRow = row / kTile;
        const std::atomic<const Tile *> *tiles = &tiles_[tileRow * tileColumns_];
        return scan(
            [&](int64_t word) {
                const Tile *made = tiles[word].load(std::memory_order_acquire);
                return (made != nullptr ? *made : makeTile(static_cast<size_t>(word), tileRow)).mixed[row % kTile];
            },
            first, last,
            [&](uint64_t mixed, int64_t x, int64_t stored, bool mirrored) {
                return sink(Word{mixed, x, y, stored, mirrored});
            });
    }
    // The place of the k-th cell.
    [[nodiscard]] Place place(const Word &word, int k) const
    {
        const Axis::Run row = axisY_.run(word.y, word.y);
        return place(word.column(k), word.y, word.stored + k, word.mirrored, rowsOf(row));
    }
    // Writes the mixed cells of a window, of at most 64 columns: bit k of to[row] says whether cell (x + k, y + row) is
    // one. Returns false only where none is.
    bool window(int64_t x, int64_t y, size_t columns, size_t rows, uint64_t *to) const;
    // Returns false where no cell of the columns from `first` to `last` is mixed. Reads all their texels: for what
    // covers all rows.
    [[nodiscard]] bool anyMixedIn(int64_t first, int64_t last) const;

private:
    struct RowBits;
    struct Columns;
    // The bits of stored cells, a word for each row.
    struct Tile {
        std::array<uint64_t, kTile> mixed;
        uint64_t mixedColumns; // a bit for each column with a mixed cell

        // `rows`: of texels, one more than of cells; no cell above the row `first` is mixed. `cells`: the columns that
        // exist. read(row): a row's RowBits.
        template <typename Read>
        void make(std::span<const int32_t> rows, size_t first, uint64_t cells, Read &&read);
    };
    static const Tile kUniform; // without a mixed cell
    // An interval of codes.
    struct CodeRange {
        uint8_t first = 0;
        uint8_t span = 0; // from the first to the last
        bool any = false;

        [[nodiscard]] bool has(uint8_t code) const { return static_cast<uint8_t>(code - first) <= span; }
    };
    struct Rows {
        int64_t upper; // texels' rows, -1 for the border
        int64_t lower;
    };

    [[nodiscard]] bool isOpaque(float value) const
    {
        return std::isfinite(value) && value >= opaqueFrom_;
    }
    [[nodiscard]] bool isTransparent(float value) const
    {
        return std::isfinite(value) && value < transparentBelow_;
    }
    [[nodiscard]] Rows rowsOf(const Axis::Run &run) const;
    [[nodiscard]] float texel(int64_t column, int64_t row) const
    {
        return row < 0 || column < 0
                   ? texture_.border
                   : texture_.value(texture_.place(static_cast<size_t>(column), static_cast<size_t>(row)));
    }
    [[nodiscard]] Place place(int64_t x, int64_t y, int64_t stored, bool mirrored, const Rows &rows) const
    {
        const auto at = static_cast<size_t>(stored);
        return {x, y, columns_[mirrored ? at + 1 : at], columns_[mirrored ? at : at + 1], rows.upper, rows.lower};
    }
    // The tile whose first stored cell is (kTile * column, kTile * row).
    [[nodiscard]] const Tile &tile(size_t column, size_t row) const
    {
        const Tile *tile = tiles_[row * tileColumns_ + column].load(std::memory_order_acquire);
        return tile != nullptr ? *tile : makeTile(column, row);
    }
    const Tile &makeTile(size_t column, size_t row) const;
    [[nodiscard]] RowBits readValues(const Columns &columns, int64_t row) const;
    // The part of window() where a run of columns, from bit `firstBit` on, meets a run of rows.
    bool addRuns(const Axis::Run &across, const Axis::Run &down, uint64_t *to, unsigned firstBit) const;
    // Calls `sink` with words of the bits from `first` to `last`, unless they are 0, the position and the stored column
    // of the lowest bit, and whether they are mirrored, until it returns true; returns whether it did. bits(i): those
    // of the stored columns from i * kTile on.
    template <typename Bits, typename Sink>
    bool scan(Bits &&bits, int64_t first, int64_t last, Sink &&sink) const;

    const AlphaTexture &texture_;
    Axis axisX_;
    Axis axisY_;
    float opaqueFrom_;
    float transparentBelow_;
    CodeRange opaqueCodes_;
    CodeRange transparentCodes_;
    double largest_ = 0;
    size_t tileColumns_;
    size_t tileRows_;
    mutable std::vector<std::atomic<const Tile *>> tiles_; // null until they are needed
    std::vector<int32_t> columns_;                         // texels of padded rows
    std::vector<int32_t> rows_;
};

template <typename Bits, typename Sink>
bool CellMap::scan(Bits &&bits, int64_t first, int64_t last, Sink &&sink) const
{
    bool any = false;
    for (int64_t x = first; x <= last;) {
        // All the rest is like what was seen.
        if (!any && axisX_.period() != 0 && x - first >= axisX_.period())
            return false;
        const Axis::Run run = axisX_.run(x, last);
        if (run.step == 0) {
            if ((bits(run.first / kTile) >> (run.first % kTile) & 1) != 0)
                for (int64_t i = 0; i < run.count; ++i)
                    if (sink(uint64_t{1}, x + i, run.first, false))
                        return true;
            x += run.count;
            continue;
        }
        const int64_t low = run.step > 0 ? run.first : run.first - run.count + 1;
        const int64_t high = low + run.count - 1;
        for (int64_t word = low / kTile; word <= high / kTile; ++word) {
            uint64_t set = bits(word);
            if (word == low / kTile)
                set &= ~uint64_t{0} << (low % kTile);
            if (word == high / kTile)
                set &= ~uint64_t{0} >> (kTile - 1 - high % kTile);
            any = any || set != 0;
            const bool mirrored = run.step < 0;
            const int64_t at = x + (mirrored ? run.first - word * kTile : word * kTile - run.first);
            if (set != 0 && sink(set, at, word * kTile, mirrored))
                return true;
        }
        x += run.count;
    }
    return false;
}

} // namespace vellum
