// SPDX-License-Identifier: Apache-2.0
// Maps positions along one axis of a texture to texels, by a sampler's address mode.
//
// Cell i is the interval between the centres of texels i and i + 1, for any integer i. An address mode folds all of
// them onto a few stored cells. Stored cells are consecutive and read the texels of a padded row: stored cell s reads
// padded texels s and s + 1.
#pragma once

#include <cstdint>

#include "bake/texture/texture.h"

namespace vellum
{

class Axis
{
public:
    Axis(uint32_t size, Wrap wrap);

    // The number of stored cells; padded rows have one texel more.
    [[nodiscard]] int64_t cells() const { return cells_; }
    // The texel of a padded row, -1 for the border.
    [[nodiscard]] int64_t padded(int64_t index) const;
    // After that many cells the axis looks the same; 0 where the mode has no such number.
    [[nodiscard]] int64_t period() const { return period_; }
    // Returns whether the cells from `first` to `last` read all texels.
    [[nodiscard]] bool spans(double first, double last) const
    {
        return period_ != 0 ? last - first >= static_cast<double>(period_)
                            : first <= 0 && last >= static_cast<double>(size_);
    }

    // Neighbouring cells of one direction: cell `i + n` is stored cell `first + n * step`, for n below `count`. A step
    // of -1 reads its texels mirrored; with step 0 all of them are one.
    struct Run {
        int64_t first;
        int64_t step;
        int64_t count;
    };
    // The longest run from cell `i` on that ends at `last` or before.
    [[nodiscard]] Run run(int64_t i, int64_t last) const
    {
        // Before the border, every mode maps cells directly.
        if (i >= -lead_ && last < cells_ - lead_)
            return {i + lead_, 1, last - i + 1};
        return foldedRun(i, last);
    }
    // A cell from which on the axis looks the same as from `i` on, as near to 0 as the mode allows; -1 where that is
    // one, since what covers a texture starts there.
    [[nodiscard]] int64_t reduced(int64_t i) const;

private:
    [[nodiscard]] Run foldedRun(int64_t i, int64_t last) const;

    int64_t size_;
    Wrap wrap_;
    int64_t cells_;
    int64_t lead_;
    int64_t period_; // 0 where the mode has none
};

} // namespace vellum
