// SPDX-License-Identifier: Apache-2.0
#include "bake/budget.h"

#include <algorithm>
#include <limits>
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

} // namespace vellum
