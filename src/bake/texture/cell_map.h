// SPDX-License-Identifier: Apache-2.0
// The cells of a texture in which the alpha test can change: one bit for each cell, the square between four texel
// centres.
//
// In a cell whose four texels are on one side of the cutoff the filtered value stays there, whatever the filter. Only
// the other cells, the mixed ones, need closer examination, and they are few: the outlines of leaves.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <vector>

#include "bake/texture/axis.h"
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

class CellMap
{
public:
    CellMap(const AlphaTexture &texture, const Thresholds &thresholds);

    [[nodiscard]] const Axis &axisX() const { return axisX_; }
    [[nodiscard]] const Axis &axisY() const { return axisY_; }
    [[nodiscard]] bool anyMixed() const { return anyMixed_; }
    // No finite texel is further from 0 than this.
    [[nodiscard]] double largest() const { return largest_; }

    // The texels of a cell.
    [[nodiscard]] Cell cell(int64_t x, int64_t y) const;
    // 1: all of the cell is opaque, 0: transparent, -1: mixed.
    [[nodiscard]] int side(int64_t x, int64_t y) const;
    // The texels of the cells from (x0, y0) to (x1, y1) where they lie in the texture as they do in the plane: the one
    // at the upper left corner of the first cell, with rows `pitch()` apart. Null where they do not.
    [[nodiscard]] const float *window(int64_t x0, int64_t y0, int64_t x1, int64_t y1) const
    {
        const bool inside = x0 >= 0 && y0 >= 0 && x1 + 1 < texture_.width && y1 + 1 < texture_.height;
        return inside ? texture_.alpha.data() + y0 * pitch() + x0 : nullptr;
    }
    [[nodiscard]] int64_t pitch() const { return texture_.width; }
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
        const int64_t left = std::max<int64_t>(place.left, 0);
        __builtin_prefetch(texture_.alpha.data() + std::max<int64_t>(place.upper, 0) * pitch() + left);
        __builtin_prefetch(texture_.alpha.data() + std::max<int64_t>(place.lower, 0) * pitch() + left);
    }
    // Calls `sink` with the place of each mixed cell of row `y` from `first` to `last` until it returns true; returns
    // whether it did.
    template <typename Sink>
    bool forMixed(int64_t y, int64_t first, int64_t last, Sink &&sink) const
    {
        const Axis::Run row = axisY_.run(y, y);
        const Rows rows = rowsOf(row);
        return scan(static_cast<size_t>(row.first), first, last, [&](int64_t x, int64_t stored, bool mirrored) {
            return sink(place(x, y, stored, mirrored, rows));
        });
    }
    // Returns whether any cell of the columns from `first` to `last` is mixed.
    [[nodiscard]] bool anyMixedIn(int64_t first, int64_t last) const
    {
        return scan(static_cast<size_t>(axisY_.cells()), first, last, [](int64_t, int64_t, bool) { return true; });
    }

private:
    struct Rows {
        int64_t upper; // texels' rows, -1 for the border
        int64_t lower;
    };
    [[nodiscard]] Rows rowsOf(const Axis::Run &run) const;
    [[nodiscard]] float texel(int64_t column, int64_t row) const
    {
        return row < 0 || column < 0
                   ? texture_.border
                   : texture_.alpha[static_cast<size_t>(row * static_cast<int64_t>(texture_.width) + column)];
    }
    [[nodiscard]] Place place(int64_t x, int64_t y, int64_t stored, bool mirrored, const Rows &rows) const
    {
        const auto at = static_cast<size_t>(stored);
        return {x, y, columns_[mirrored ? at + 1 : at], columns_[mirrored ? at : at + 1], rows.upper, rows.lower};
    }
    void fill(const Thresholds &thresholds);
    // Calls `sink` with the position of each mixed cell of a stored row, with its stored column, and whether it is
    // mirrored, until it returns true.
    template <typename Sink>
    bool scan(size_t row, int64_t first, int64_t last, Sink &&sink) const;

    const AlphaTexture &texture_;
    Axis axisX_;
    Axis axisY_;
    bool anyMixed_ = false;
    double largest_ = 0;
    size_t words_;                 // of one row of bits
    std::vector<uint64_t> mixed_;  // one bit for each stored cell; behind the last row, one for all of its column
    std::vector<uint64_t> opaque_; // likewise
    std::vector<int32_t> columns_; // texels of padded rows
    std::vector<int32_t> rows_;
};

template <typename Sink>
bool CellMap::scan(size_t row, int64_t first, int64_t last, Sink &&sink) const
{
    const uint64_t *bits = &mixed_[row * words_];
    for (int64_t x = first; x <= last;) {
        const Axis::Run run = axisX_.run(x, last);
        if (run.step == 0) {
            const auto at = static_cast<size_t>(run.first);
            if ((bits[at / 64] >> (at % 64) & 1) != 0)
                for (int64_t i = 0; i < run.count; ++i)
                    if (sink(x + i, run.first, false))
                        return true;
            x += run.count;
            continue;
        }
        const int64_t low = run.step > 0 ? run.first : run.first - run.count + 1;
        const int64_t high = low + run.count - 1;
        for (int64_t word = low / 64; word <= high / 64; ++word) {
            uint64_t set = bits[word];
            if (word == low / 64)
                set &= ~uint64_t{0} << (low % 64);
            if (word == high / 64)
                set &= ~uint64_t{0} >> (63 - high % 64);
            for (; set != 0; set &= set - 1) {
                const int64_t stored = word * 64 + std::countr_zero(set);
                const bool mirrored = run.step < 0;
                const int64_t at = x + (mirrored ? run.first - stored : stored - run.first);
                if (sink(at, stored, mirrored))
                    return true;
            }
        }
        x += run.count;
    }
    return false;
}

} // namespace vellum
