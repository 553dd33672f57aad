// SPDX-License-Identifier: Apache-2.0
// Chooses the triangles that get a lower level so that a micromap fits a budget.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/curve.h"

namespace vellum
{

// The cost of a triangle, and its known share, at each level up to its own.
struct LevelChoice {
    uint64_t uses = 0;  // triangles of the mesh that share it
    uint32_t level = 0; // the highest, and then the chosen one
    // By level: the share of micro-triangles that are known, and bytes.
    std::array<float, shared::kMaxSubdivisionLevel + 1> known{};
    std::array<uint32_t, shared::kMaxSubdivisionLevel + 1> bytes{};
};

// Lowers levels until the sum of bytes is at most `budget`, or all are at level 0. Each step is the one that loses the
// least known area for a byte; among equal ones, that of the first triangle.
void fitBudget(std::span<LevelChoice> choices, uint64_t budget);

} // namespace vellum
