// SPDX-License-Identifier: Apache-2.0
#include "bake/levels.h"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <queue>
#include <unordered_map>
#include <unordered_set>

namespace vellum
{
namespace
{

struct Step {
    double price; // known for each byte: lost, or gained
    size_t which;
    uint32_t to;
};

// Of equal prices, the first triangle comes first.
struct Dearer {
    bool operator()(const Step &a, const Step &b) const
    {
        return a.price != b.price ? a.price > b.price : a.which > b.which;
    }
};
struct Cheaper {
    bool operator()(const Step &a, const Step &b) const
    {
        return a.price != b.price ? a.price < b.price : a.which > b.which;
    }
};

// Lowers classes of triangles that have the same data: they stay together, and meet others on their way down.
class Lowering
{
public:
    explicit Lowering(std::span<LevelChoice> choices);
    // Until there are at most `budget` bytes, and without losing more than `spare` of what is known.
    void run(uint64_t budget, double spare);

private:
    [[nodiscard]] size_t classOf(size_t which);
    [[nodiscard]] double lost(size_t which, uint32_t to) const;
    [[nodiscard]] uint64_t saved(const LevelChoice &choice, uint32_t to) const;
    void offer(size_t which);
    void apply(const Step &step);

    std::span<LevelChoice> choices_; // the first of a class has its level and weight
    std::vector<size_t> parents_;
    std::unordered_map<uint64_t, size_t> holders_; // by data: the class that has it
    std::vector<double> weights_;
    std::priority_queue<Step, std::vector<Step>, Dearer> steps_;
    uint64_t bytes_ = 0;
    double spare_ = 0;
};

Lowering::Lowering(std::span<LevelChoice> choices) : choices_(choices), parents_(choices.size())
{
    std::iota(parents_.begin(), parents_.end(), size_t{0});
    for (size_t i = 0; i < choices.size(); ++i) {
        const LevelChoice &choice = choices[i];
        weights_.push_back(choice.weight);
        if (choice.data[choice.level] == 0)
            continue;
        const auto [holder, isNew] = holders_.try_emplace(choice.data[choice.level], i);
        if (isNew)
            bytes_ += choice.bytes(choice.level);
        else
            weights_[parents_[i] = holder->second] += choice.weight;
    }
}

size_t Lowering::classOf(size_t which)
{
    while (parents_[which] != which)
        which = parents_[which] = parents_[parents_[which]];
    return which;
}

double Lowering::lost(size_t which, uint32_t to) const
{
    const LevelChoice &choice = choices_[which];
    return weights_[which] * (double{choice.known[choice.level]} - double{choice.known[to]});
}

uint64_t Lowering::saved(const LevelChoice &choice, uint32_t to) const
{
    return choice.bytes(choice.level) - (holders_.contains(choice.data[to]) ? 0 : choice.bytes(to));
}

// The cheapest of all steps down that lose no more than can be spared. Levels between that would save less for what
// they lose are skipped: the price of a triangle's steps then rises as it goes down, so taking the cheapest step of all
// is optimal where nothing is shared.
void Lowering::offer(size_t which)
{
    const LevelChoice &choice = choices_[which];
    Step best{0, which, choice.level};
    for (uint32_t to = choice.level; to-- > 0 && choice.data[choice.level] != 0;) {
        if (lost(which, to) > spare_)
            break; // and lower levels lose no less
        const double price = lost(which, to) / static_cast<double>(saved(choice, to));
        // The longest of equally priced steps saves the most.
        if (best.to == choice.level || price <= best.price)
            best = {price, which, to};
    }
    if (best.to != choice.level)
        steps_.push(best);
}

void Lowering::apply(const Step &step)
{
    LevelChoice &choice = choices_[step.which];
    bytes_ -= saved(choice, step.to);
    spare_ -= lost(step.which, step.to);
    holders_.erase(choice.data[choice.level]);
    choice.level = step.to;
    if (choice.data[step.to] == 0)
        return;
    const auto [holder, isNew] = holders_.try_emplace(choice.data[step.to], step.which);
    if (isNew)
        return offer(step.which);
    parents_[step.which] = holder->second;
    weights_[holder->second] += weights_[step.which];
}

void Lowering::run(uint64_t budget, double spare)
{
    if (bytes_ <= budget)
        return;
    spare_ = spare;
    for (size_t i = 0; i < choices_.size(); ++i)
        if (parents_[i] == i)
            offer(i);
    while (bytes_ > budget && !steps_.empty()) {
        const Step step = steps_.top();
        steps_.pop();
        if (parents_[step.which] != step.which)
            continue;
        // Others that came or went since have changed the price.
        const double loss = lost(step.which, step.to);
        if (loss > spare_ || loss / static_cast<double>(saved(choices_[step.which], step.to)) > step.price)
            offer(step.which);
        else
            apply(step);
    }
    for (size_t i = 0; i < choices_.size(); ++i)
        choices_[i].level = choices_[classOf(i)].level;
}

// Raises classes of triangles that have the same data at the highest level; they may share that of the lower ones with
// others.
class Raising
{
public:
    explicit Raising(std::span<LevelChoice> choices);
    void run(uint64_t budget);

private:
    // Bytes that a step adds; negative where it saves some.
    [[nodiscard]] int64_t added(const LevelChoice &choice, uint32_t to) const;
    [[nodiscard]] Step bestOf(size_t which) const;
    void apply(const Step &step);

    std::span<LevelChoice> choices_;
    std::vector<size_t> classes_; // of each choice: the first of its class
    std::vector<double> weights_;
    std::unordered_map<uint64_t, size_t> uses_; // by data: classes that have it
    int64_t left_ = 0;
};

Raising::Raising(std::span<LevelChoice> choices) : choices_(choices), classes_(choices.size())
{
    std::unordered_map<uint64_t, size_t> firsts;
    for (size_t i = 0; i < choices.size(); ++i) {
        const LevelChoice &choice = choices[i];
        weights_.push_back(choice.weight);
        classes_[i] = i;
        if (choice.data[choice.highest] != 0) {
            const auto [first, isNew] = firsts.try_emplace(choice.data[choice.highest], i);
            const LevelChoice &other = choices[first->second];
            if (!isNew && other.level == choice.level && other.highest == choice.highest &&
                other.data[other.level] == choice.data[choice.level])
                classes_[i] = first->second;
        }
        if (classes_[i] != i)
            weights_[classes_[i]] += choice.weight;
        else if (choice.data[choice.level] != 0)
            ++uses_[choice.data[choice.level]];
    }
}

int64_t Raising::added(const LevelChoice &choice, uint32_t to) const
{
    const auto from = uses_.find(choice.data[choice.level]);
    const uint64_t saves = from != uses_.end() && from->second == 1 ? choice.bytes(choice.level) : 0;
    const uint64_t adds = uses_.contains(choice.data[to]) ? 0 : choice.bytes(to);
    return static_cast<int64_t>(adds) - static_cast<int64_t>(saves);
}

// The best step up for which there are bytes, to the same level if there is none.
Step Raising::bestOf(size_t which) const
{
    const LevelChoice &choice = choices_[which];
    Step best{0, which, choice.level};
    for (uint32_t to = choice.level + 1; to <= choice.highest; ++to) {
        const double gain = weights_[which] * (double{choice.known[to]} - double{choice.known[choice.level]});
        const int64_t bytes = added(choice, to);
        const double price = gain / static_cast<double>(std::max<int64_t>(bytes, 1));
        if (bytes <= left_ && price > best.price)
            best = {price, which, to};
    }
    return best;
}

void Raising::apply(const Step &step)
{
    LevelChoice &choice = choices_[step.which];
    left_ -= added(choice, step.to);
    if (const auto from = uses_.find(choice.data[choice.level]); from != uses_.end() && --from->second == 0)
        uses_.erase(from);
    choice.level = step.to;
    if (choice.data[step.to] != 0)
        ++uses_[choice.data[step.to]];
}

void Raising::run(uint64_t budget)
{
    const uint64_t bytes = sharedBytes(choices_);
    if (bytes >= budget)
        return;
    left_ = static_cast<int64_t>(std::min(budget - bytes, uint64_t{1} << 62));
    std::priority_queue<Step, std::vector<Step>, Cheaper> steps;
    const auto offer = [&](const Step &step) {
        if (step.to != choices_[step.which].level)
            steps.push(step);
    };
    for (size_t i = 0; i < choices_.size(); ++i)
        if (classes_[i] == i)
            offer(bestOf(i));
    while (!steps.empty()) {
        const Step step = steps.top();
        steps.pop();
        // Others have used bytes, or changed the price, since.
        const Step now = bestOf(step.which);
        if (now.price < step.price) {
            offer(now);
        } else {
            apply(now);
            offer(bestOf(step.which));
        }
    }
    for (size_t i = 0; i < choices_.size(); ++i)
        choices_[i].level = choices_[classes_[i]].level;
}

} // namespace

uint64_t LevelChoice::bytes(uint32_t atLevel) const
{
    return data[atLevel] == 0 ? 0 : packedBytes(atLevel, format) + kRecordBytes;
}

uint64_t sharedBytes(std::span<const LevelChoice> choices)
{
    std::unordered_set<uint64_t> seen;
    uint64_t bytes = 0;
    for (const LevelChoice &choice : choices)
        if (seen.insert(choice.data[choice.level]).second)
            bytes += choice.bytes(choice.level);
    return bytes;
}

double knownWeight(std::span<const LevelChoice> choices)
{
    double known = 0;
    for (const LevelChoice &choice : choices)
        known += choice.weight * double{choice.known[choice.level]};
    return known;
}

void lowerLevels(std::span<LevelChoice> choices, uint64_t budget)
{
    Lowering(choices).run(budget, std::numeric_limits<double>::infinity());
}

void lowerLevelsWhileKnown(std::span<LevelChoice> choices, double known)
{
    Lowering(choices).run(0, knownWeight(choices) - known);
}

void raiseLevels(std::span<LevelChoice> choices, uint64_t budget)
{
    Raising(choices).run(budget);
}

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
