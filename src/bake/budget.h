// SPDX-License-Identifier: Apache-2.0
// Chooses the levels of triangles so that a micromap fits a budget and the most is known.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/curve.h"
#include "core/micromap.h"

namespace vellum
{

// Bytes of a micromap triangle's record, VkMicromapTriangleEXT.
inline constexpr uint32_t kRecordBytes = 8;

// A triangle, or several with the same coordinates, and what it would be at each level.
struct LevelChoice {
    double weight = 0;    // what is known of it counts that much
    uint32_t level = 0;   // the chosen one
    uint32_t highest = 0; // that can be chosen
    Format format = Format::FourState;
    // By level: the share of micro-triangles that are known, and a hash of the data and all else that triangles must
    // have in common to share it; 0 for a special index, which has no bytes. Triangles that are equal at one level
    // are equal at all below it.
    std::array<float, shared::kMaxSubdivisionLevel + 1> known{};
    std::array<uint64_t, shared::kMaxSubdivisionLevel + 1> data{};

    // With the record, if no other triangle shares it.
    [[nodiscard]] uint64_t bytes(uint32_t atLevel) const;
};

// The bytes of all together at their levels, where equal data is stored once.
uint64_t sharedBytes(std::span<const LevelChoice> choices);

// What is known of all together at their levels, of the weights.
double knownWeight(std::span<const LevelChoice> choices);

// Lowers levels until all together have at most `budget` bytes, or are at level 0. Each step is the one that loses the
// least of what is known for a byte; among equal ones, that of the first triangle.
void lowerLevels(std::span<LevelChoice> choices, uint64_t budget);

// Lowers levels as long as at least `known` of the weights is known, by the same steps.
void lowerLevelsWhileKnown(std::span<LevelChoice> choices, double known);

// Raises levels as long as all together have at most `budget` bytes. Each step is the one that gains the most for a
// byte; among equal ones, that of the first triangle.
void raiseLevels(std::span<LevelChoice> choices, uint64_t budget);

} // namespace vellum
