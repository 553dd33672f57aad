// SPDX-License-Identifier: Apache-2.0
#include "bake/budget.h"

#include <algorithm>
#include <queue>

namespace vellum
{
namespace
{

// From a choice's level down to another one. Levels between that would save less for each known area are skipped: the
// price of a triangle's steps then rises as it goes down, so taking the cheapest step of all is optimal.
struct Step {
    double price; // known area lost for each byte saved
    size_t which;
    uint32_t to;

    bool operator>(const Step &other) const { return price != other.price ? price > other.price : which > other.which; }
};

Step cheapestStep(const LevelChoice &choice, size_t which)
{
    Step best{0, which, choice.level};
    for (uint32_t to = choice.level; to-- > 0;) {
        const double lost =
            static_cast<double>(choice.uses) * (double{choice.known[choice.level]} - double{choice.known[to]});
        const double saved = static_cast<double>(choice.bytes[choice.level]) - static_cast<double>(choice.bytes[to]);
        if (saved <= 0)
            continue;
        // The longest of equally priced steps saves the most.
        if (best.to == choice.level || lost / saved <= best.price)
            best = {lost / saved, which, to};
    }
    return best;
}

} // namespace

void fitBudget(std::span<LevelChoice> choices, uint64_t budget)
{
    uint64_t bytes = 0;
    std::priority_queue<Step, std::vector<Step>, std::greater<>> steps;
    const auto offer = [&](size_t which) {
        const Step step = cheapestStep(choices[which], which);
        if (step.to != choices[which].level)
            steps.push(step);
    };
    for (size_t i = 0; i < choices.size(); ++i) {
        bytes += choices[i].bytes[choices[i].level];
        offer(i);
    }
    while (bytes > budget && !steps.empty()) {
        const Step step = steps.top();
        steps.pop();
        LevelChoice &choice = choices[step.which];
        bytes -= choice.bytes[choice.level] - choice.bytes[step.to];
        choice.level = step.to;
        offer(step.which);
    }
}

} // namespace vellum
