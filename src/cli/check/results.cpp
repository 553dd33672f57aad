// SPDX-License-Identifier: Apache-2.0
#include "cli/check/results.h"

#include <algorithm>

namespace vellum::cli
{
namespace
{

void add(const CaseResult &result, std::vector<CauseTally> &causes)
{
    const std::string cause = causeOf(result);
    auto found = std::find_if(causes.begin(), causes.end(), [&](const CauseTally &c) { return c.cause == cause; });
    if (found == causes.end())
        found = causes.insert(causes.end(), {cause, 0, &result});
    ++found->count;
    const auto hasReproducer = [](const CaseResult &r) {
        return r.details != nullptr && !r.details->reproducer.empty();
    };
    if (hasReproducer(result) && !hasReproducer(*found->first))
        found->first = &result;
}

GroupTally &tallyOf(const CaseId &id, std::vector<GroupTally> &groups)
{
    const auto found = std::find_if(groups.begin(), groups.end(),
                                    [&](const GroupTally &g) { return g.api == id.api && g.group == id.group; });
    return found != groups.end() ? *found : groups.emplace_back(GroupTally{id.api, id.group, 0, {}, 0, 0});
}

} // namespace

const std::string &CaseResult::cause() const
{
    static const std::string none;
    return details != nullptr ? details->cause : none;
}

std::string causeOf(const CaseResult &result)
{
    const bool byVerdict = result.verdict == Verdict::Missing || isImprovement(result.verdict);
    return std::string(byVerdict ? nameOf(result.verdict) : nameOf(result.status)) +
           (result.cause().empty() ? "" : ": " + result.cause());
}

CheckTally tallyOf(const std::vector<CaseResult> &results)
{
    CheckTally tally;
    for (const CaseResult &result : results) {
        GroupTally &group = tallyOf(result.id, tally.groups);
        ++group.cases;
        if (result.verdict != Verdict::Missing)
            ++group.statuses[result.status];
        group.rays += result.rays;
        group.seconds += result.seconds;
        ++tally.verdicts[result.verdict];
        if (isImprovement(result.verdict))
            add(result, tally.improvements);
        else if (!isSuccess(result.verdict))
            add(result, tally.failures);
        else if (result.verdict == Verdict::Skip)
            add(result, tally.skips);
        else if (result.verdict == Verdict::Flake || result.verdict == Verdict::KnownFlake)
            add(result, tally.flakes);
    }
    std::stable_sort(tally.groups.begin(), tally.groups.end(), [](const GroupTally &a, const GroupTally &b) {
        return a.api != b.api ? a.api == check::Api::Khr : a.group < b.group;
    });
    for (std::vector<CauseTally> *causes : {&tally.failures, &tally.improvements, &tally.flakes, &tally.skips})
        std::stable_sort(causes->begin(), causes->end(),
                         [](const CauseTally &a, const CauseTally &b) { return a.count > b.count; });
    return tally;
}

} // namespace vellum::cli
