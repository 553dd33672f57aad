// SPDX-License-Identifier: Apache-2.0
// Levels of the triangles of a bake by its budget, or by what has to be known.
#pragma once

#include <cstdint>
#include <vector>

#include "bake/budget.h"
#include "bake/distinct.h"

namespace vellum
{

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
