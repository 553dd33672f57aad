// SPDX-License-Identifier: Apache-2.0
// What bakes of the same triangles with several settings would be: their bytes and what they know, without their data.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "bake/bake.h"

namespace vellum
{

// In place of the same members of BakeOptions.
struct BakeSetting {
    std::optional<uint32_t> level; // none: automatic
    Format format = Format::FourState;
    std::optional<uint64_t> budget; // with automatic levels and 4 states only
    bool operator==(const BakeSetting &) const = default;
};

struct BakeOutline {
    uint64_t bytes = 0;                // of data and records, and emptyGroupBytes
    bool tooLarge = false;             // a bake of one group alone would throw BakeTooLarge
    std::array<uint64_t, 13> levels{}; // triangles with data by level
    std::vector<float> known;          // of each triangle, the share of which the outcome is proven
    BakeSetting setting;
};

// Calls `take` with each level in 4 and in 2 states, then with each budget. A triangle is classified once for each
// level, and twice for all budgets. Inputs must leave levels and formats to the options. Throws BakeError.
void outlineBakes(std::span<const BakeInput> inputs, const BakeOptions &options,
                  std::span<const std::optional<uint32_t>> levels, std::span<const uint64_t> budgets,
                  const std::function<void(const BakeOutline &)> &take);

} // namespace vellum
