// SPDX-License-Identifier: Apache-2.0
#include "bake/levels.h"

#include <algorithm>
#include <map>

namespace vellum
{
namespace
{

// Above the level of about texelsPerEdge, levels can be raised by that many: to an eighth of it.
constexpr uint32_t kMostRaised = 3;

uint32_t highestOf(const Distinct &triangle, const BakeOptions &options)
{
    return triangle.automatic ? std::max(triangle.level, std::min(triangle.level + kMostRaised, options.maxLevel))
                              : triangle.level;
}

LevelChoice choiceOf(const Distinct &triangle)
{
    LevelChoice choice;
    choice.weight = triangle.weight;
    choice.level = choice.highest = triangle.level;
    choice.format = triangle.format;
    return choice;
}

// What a triangle is at the levels from `from` to `to`, by folding what it is at `to`.
void describe(const Distinct &triangle, uint32_t from, uint32_t to, const BakeOptions &options, LevelChoice &choice,
              PackedScratch &scratch)
{
    std::vector<uint8_t> &packed = scratch.packed;
    packed.assign(packedBytes(to, Format::FourState), 0);
    triangle.material->classify(*triangle.uvs, to, packed.data(), scratch.classifier);
    for (uint32_t level = to + 1; level-- > from;) {
        if (level < to)
            foldOnce(packed.data(), level + 1);
        const StateCounts counts = countStates(packed.data(), level);
        const uint64_t known = counts[0] + counts[1];
        const uint64_t all = microTriangleCount(level);
        const bool special = uniformState(counts) || isTooLittle(known, level, triangle.format, options);
        choice.known[level] = special && known != all ? 0 : static_cast<float>(known) / static_cast<float>(all);
        choice.data[level] = special ? 0 : dataKey(triangle, level, packed.data(), Format::FourState);
    }
}

// The bytes of the groups of which no triangle has data.
uint64_t emptyBytes(const DistinctTriangles &distinct, std::span<const LevelChoice> choices, const BakeOptions &options)
{
    std::map<uint32_t, bool> haveData;
    for (size_t i = 0; i < choices.size(); ++i) {
        bool &hasData = haveData[distinct.triangles[i].group];
        hasData = hasData || choices[i].data[choices[i].level] != 0;
    }
    const auto empty = std::count_if(haveData.begin(), haveData.end(), [](const auto &group) { return !group.second; });
    return options.emptyGroupBytes * static_cast<uint64_t>(empty);
}

// The bytes without a budget. 2-state data is often equal where the states that it is made from are not.
uint64_t unchangedBytes(const DistinctTriangles &distinct, std::span<const LevelChoice> choices,
                        const BakeOptions &options, unsigned threads)
{
    std::vector<LevelChoice> stored(choices.begin(), choices.end());
    inParallel<PackedScratch>(threads, stored.size(), options.cancelled, [&](size_t i, PackedScratch &scratch) {
        const Distinct &triangle = distinct.triangles[i];
        if (triangle.format != Format::TwoState)
            return;
        scratch.packed.resize(triangle.classifiedBytes());
        Packed packed{scratch.packed.data(), {}, {}, 0};
        pack(triangle, options, packed, scratch.classifier);
        stored[i].data[triangle.level] =
            packed.uniform ? 0 : dataKey(triangle, triangle.level, packed.data, triangle.format);
    });
    return sharedBytes(stored) + emptyBytes(distinct, stored, options);
}

} // namespace

LevelChooser::LevelChooser(const DistinctTriangles &distinct, const BakeOptions &options, unsigned threads,
                           Progress &progress)
    : distinct_(distinct), options_(options), threads_(threads), choices_(distinct.triangles.size()),
      raisedTo_(choices_.size())
{
    inParallel<PackedScratch>(threads, choices_.size(), options.cancelled, [&](size_t i, PackedScratch &scratch) {
        const Distinct &triangle = distinct.triangles[i];
        choices_[i] = choiceOf(triangle);
        describe(triangle, 0, triangle.level, options, choices_[i], scratch);
        progress.done(triangle.uses);
    });
    const bool any2State = std::any_of(distinct.triangles.begin(), distinct.triangles.end(),
                                       [](const Distinct &triangle) { return triangle.format == Format::TwoState; });
    unchanged_ = any2State ? unchangedBytes(distinct, choices_, options, threads) : bytesOf(choices_);
}

uint64_t LevelChooser::bytesOf(const std::vector<LevelChoice> &choices) const
{
    return sharedBytes(choices) + emptyBytes(distinct_, choices, options_);
}

// What triangles are at the levels to which `left` bytes could raise them.
void LevelChooser::describeRaised(uint64_t left)
{
    inParallel<PackedScratch>(threads_, choices_.size(), options_.cancelled, [&](size_t i, PackedScratch &scratch) {
        const Distinct &triangle = distinct_.triangles[i];
        LevelChoice &choice = choices_[i];
        choice.highest = triangle.level;
        if (choice.known[triangle.level] >= 1)
            return;
        uint32_t highest = highestOf(triangle, options_);
        while (highest > triangle.level && packedBytes(highest, triangle.format) > left)
            --highest;
        choice.highest = highest;
        if (highest == triangle.level || raisedTo_[i] == highest)
            return;
        raisedTo_[i] = highest;
        describe(triangle, triangle.level + 1, highest, options_, choice, scratch);
    });
}

std::vector<LevelChoice> LevelChooser::withinBudget(uint64_t budget)
{
    // The most bytes that special indices add which are separated.
    const uint64_t more = options_.disallowMixedSpecialIndices ? 4 * (kRecordBytes + 1) : 0;
    budget -= std::min(budget, more);
    const bool lower = unchanged_ > budget;
    if (!lower)
        describeRaised(budget - unchanged_);
    std::vector<LevelChoice> choices = choices_;
    uint64_t empty = emptyBytes(distinct_, choices, options_);
    if (lower) {
        for (LevelChoice &choice : choices)
            choice.highest = choice.level;
        // Groups that lose their data on the way take bytes, for which others have to be lowered.
        for (uint64_t before = ~uint64_t{0}; before != empty;) {
            before = empty;
            lowerLevels(choices, budget - std::min(budget, empty));
            empty = emptyBytes(distinct_, choices, options_);
        }
    }
    raiseLevels(choices, std::min(budget - std::min(budget, empty), options_.maxDataBytes));
    return choices;
}

std::vector<LevelChoice> levelsForKnown(DistinctTriangles &distinct, const BakeOptions &options, unsigned threads,
                                        Progress &progress)
{
    std::vector<LevelChoice> choices(distinct.triangles.size());
    inParallel<PackedScratch>(threads, choices.size(), options.cancelled, [&](size_t i, PackedScratch &scratch) {
        Distinct &triangle = distinct.triangles[i];
        triangle.level = highestOf(triangle, options);
        choices[i] = choiceOf(triangle);
        describe(triangle, 0, triangle.level, options, choices[i], scratch);
        progress.done(triangle.uses);
    });
    const double most = knownWeight(choices);
    // Sums of weights are rounded, once for each.
    if (most < *options.leastKnown * (1 - 1e-15 * static_cast<double>(choices.size() + 1000)))
        throw BakeTooLittleKnown(most);
    lowerLevelsWhileKnown(choices, std::min(*options.leastKnown, most));
    return choices;
}

void applyLevels(DistinctTriangles &distinct, const std::vector<LevelChoice> &choices)
{
    for (size_t i = 0; i < choices.size(); ++i) {
        Distinct &triangle = distinct.triangles[i];
        const uint32_t classified = choices[i].level > triangle.level ? choices[i].highest : triangle.level;
        triangle.folds = classified - choices[i].level;
        triangle.level = choices[i].level;
    }
}

} // namespace vellum
