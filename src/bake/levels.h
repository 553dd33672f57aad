// SPDX-License-Identifier: Apache-2.0
// The levels of triangles: chosen so that a micromap fits a budget, or so that enough is known.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "bake/distinct.h"
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

// Describes triangles once, however many budgets there are. All arguments must outlive it.
class LevelChooser
{
public:
    LevelChooser(const DistinctTriangles &distinct, const BakeOptions &options, unsigned threads, Progress &progress);

    // Levels that keep the result within `budget` bytes and make the most known.
    std::vector<LevelChoice> withinBudget(uint64_t budget);
    // The bytes of the result at these levels, as 4-state data.
    [[nodiscard]] uint64_t bytesOf(const std::vector<LevelChoice> &choices) const;

private:
    void describeRaised(uint64_t left);

    const DistinctTriangles &distinct_;
    const BakeOptions &options_;
    unsigned threads_;
    std::vector<LevelChoice> choices_; // at the levels without a budget
    std::vector<uint32_t> raisedTo_;   // the level above that, from which those between are described
    uint64_t unchanged_ = 0;           // bytes at those levels
};

// Raises automatic levels, and returns those of the smallest result of which `options.leastKnown` is known. Throws
// BakeTooLittleKnown.
std::vector<LevelChoice> levelsForKnown(DistinctTriangles &distinct, const BakeOptions &options, unsigned threads,
                                        Progress &progress);

// Sets the triangles' levels to what was chosen from what they are.
void applyLevels(DistinctTriangles &distinct, const std::vector<LevelChoice> &choices);

} // namespace vellum
