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

// The element of a group, which is added where there is none.
template <typename OfGroup>
OfGroup &elementOf(check::Api api, const check::Group *group, std::vector<OfGroup> &groups)
{
    const auto found =
        std::find_if(groups.begin(), groups.end(), [&](const OfGroup &g) { return g.api == api && g.group == group; });
    if (found != groups.end())
        return *found;
    OfGroup &added = groups.emplace_back();
    added.api = api;
    added.group = group;
    return added;
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

std::vector<PlannedGroup> planOf(const std::vector<CaseId> &cases)
{
    std::vector<PlannedGroup> plan;
    for (const CaseId &id : cases)
        ++elementOf(id.api, id.group, plan).cases;
    return plan;
}

size_t GroupTally::count(std::initializer_list<check::Status> some) const
{
    size_t sum = 0;
    for (const check::Status status : some)
        if (const auto found = statuses.find(status); found != statuses.end())
            sum += found->second;
    return sum;
}

size_t GroupTally::tested() const
{
    size_t sum = 0;
    for (const auto &[status, number] : statuses)
        sum += status == check::Status::Skip ? 0 : number;
    return sum;
}

CheckTally tallyOf(const std::vector<CaseResult> &results, const std::vector<PlannedGroup> &plan)
{
    CheckTally tally;
    for (const PlannedGroup &planned : plan)
        elementOf(planned.api, planned.group, tally.groups).planned = planned.cases;
    for (const CaseResult &result : results) {
        GroupTally &group = elementOf(result.id.api, result.id.group, tally.groups);
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
