// SPDX-License-Identifier: Apache-2.0
#include "cli/check/schedule.h"

#include <algorithm>
#include <fmt/format.h>
#include <numeric>

#include "base/text.h"
#include "core/hash.h"

namespace vellum::cli
{
namespace
{

constexpr uint32_t kMostSkippedByFilters = 10000;
constexpr uint32_t kMostCasesThatSkip = 20; // before a group counts as one that the device lacks

} // namespace

bool Stream::atEnd()
{
    if (at_ < numbers_.size())
        return false;
    if (!wanted_ || (onlySkips_ && finished_ >= kMostCasesThatSkip))
        return true;
    const uint32_t first = std::max(group_->cases, numbers_.empty() ? 0 : numbers_.back() + 1);
    for (uint32_t number = first; number - first < kMostSkippedByFilters; ++number) {
        if (wanted_({api_, group_, number})) {
            numbers_.assign(1, number);
            at_ = 0;
            return false;
        }
    }
    wanted_ = nullptr;
    return true;
}

CaseId Stream::next()
{
    return {api_, group_, numbers_[at_++]};
}

std::string Stream::name() const
{
    return nameOf(api_, *group_);
}

Stream *Schedule::choose()
{
    Stream *best = nullptr;
    const auto better = [this](const Stream &a, const Stream &b) {
        if (a.workers != b.workers)
            return a.workers < b.workers;
        return timed_ && a.seconds < b.seconds;
    };
    for (Stream &stream : streams_)
        if (!stream.atEnd() && (best == nullptr || better(stream, *best)))
            best = &stream;
    return best;
}

size_t Schedule::remaining() const
{
    return std::accumulate(streams_.begin(), streams_.end(), size_t{0},
                           [](size_t sum, const Stream &stream) { return sum + stream.remaining(); });
}

double Schedule::work() const
{
    return std::accumulate(streams_.begin(), streams_.end(), 0.0,
                           [](double sum, const Stream &stream) { return sum + stream.work(); });
}

std::string Schedule::running() const
{
    std::string names;
    for (const Stream &stream : streams_)
        if (stream.workers != 0)
            names += (names.empty() ? "" : ", ") + stream.name();
    return names;
}

bool CaseSelection::accepts(const CaseId &id) const
{
    // Groups begin with different shards: some have fewer cases than there are shards.
    const size_t group = static_cast<size_t>(id.group - check::groups().data());
    if ((id.number + group) % shard.count != shard.number - 1)
        return false;
    if (filters.empty())
        return true;
    const std::string name = nameOf(id);
    return std::any_of(filters.begin(), filters.end(),
                       [&](const std::string &filter) { return matchesPattern(name, filter); });
}

std::vector<CaseId> casesOf(const CaseSelection &selection)
{
    std::vector<CaseId> cases;
    const auto add = [&](const CaseId &id) {
        if (selection.accepts(id))
            cases.push_back(id);
    };
    if (selection.listed) {
        std::for_each(selection.list.begin(), selection.list.end(), add);
        return cases;
    }
    for (const check::Api api : selection.apis)
        for (const check::Group &group : check::groups())
            for (uint32_t number = 0; number < (selection.quick ? group.quickCases() : group.cases); ++number)
                add({api, &group, number});
    return cases;
}

std::string describe(CaseSelection selection)
{
    selection.shard = {};
    const std::vector<CaseId> cases = casesOf(selection);
    std::string names;
    for (const CaseId &id : cases)
        names += nameOf(id) + "\n";
    if (selection.endless)
        for (const std::string &filter : selection.filters)
            names += filter + "\n";
    return fmt::format("{} ({:016x}){}", counted(cases.size(), "case"), Hash::of(names),
                       selection.endless ? " and new ones" : "");
}

Schedule makeSchedule(const CaseSelection &selection)
{
    Schedule schedule;
    const std::vector<CaseId> cases = casesOf(selection);
    for (const check::Api api : {check::Api::Khr, check::Api::Ext}) {
        for (const check::Group &group : check::groups()) {
            std::vector<uint32_t> numbers;
            for (const CaseId &id : cases)
                if (id.api == api && id.group == &group)
                    numbers.push_back(id.number);
            const bool chosen = std::find(selection.apis.begin(), selection.apis.end(), api) != selection.apis.end();
            Stream stream(api, group, std::move(numbers));
            if (selection.endless && chosen)
                stream.goOn([selection](const CaseId &id) { return selection.accepts(id); });
            if (!stream.atEnd())
                schedule.add(std::move(stream));
        }
    }
    return schedule;
}

std::optional<std::string> idleFilter(const CaseSelection &selection)
{
    for (const std::string &filter : selection.filters) {
        CaseSelection alone = selection;
        alone.shard = {};
        alone.filters = {filter};
        if (makeSchedule(alone).streams() == 0)
            return filter;
    }
    return std::nullopt;
}

} // namespace vellum::cli
