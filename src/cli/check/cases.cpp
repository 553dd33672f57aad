// SPDX-License-Identifier: Apache-2.0
#include "cli/check/cases.h"

#include <algorithm>
#include <fmt/format.h>
#include <numeric>

#include "core/hash.h"

namespace vellum::cli
{

const char *nameOf(check::Api api)
{
    return api == check::Api::Khr ? "khr" : "ext";
}

std::string nameOf(check::Api api, const check::Group &group)
{
    return fmt::format("{}.{}", nameOf(api), group.name);
}

std::string nameOf(const CaseId &id)
{
    return fmt::format("{}.{:04}", nameOf(id.api, *id.group), id.number);
}

const check::Group *findGroup(std::string_view name)
{
    const auto groups = check::groups();
    const auto found =
        std::find_if(groups.begin(), groups.end(), [&](const check::Group &g) { return g.name == name; });
    return found != groups.end() ? &*found : nullptr;
}

std::optional<CaseId> parseCase(std::string_view name)
{
    const size_t first = name.find('.');
    const size_t last = name.rfind('.');
    if (first == last || (name.substr(0, first) != "khr" && name.substr(0, first) != "ext"))
        return std::nullopt;
    const check::Group *group = findGroup(name.substr(first + 1, last - first - 1));
    const auto number = parseNumber<uint32_t>(name.substr(last + 1));
    if (group == nullptr || !number || fmt::format("{:04}", *number) != name.substr(last + 1))
        return std::nullopt;
    return CaseId{name.starts_with("khr") ? check::Api::Khr : check::Api::Ext, group, *number};
}

bool anyCase(const std::function<bool(const std::string &name)> &accepts, bool endless)
{
    constexpr uint32_t kMostNumbers = 10000;
    const auto inRange = [&](bool beyond) {
        for (const check::Api api : {check::Api::Khr, check::Api::Ext})
            for (const check::Group &group : check::groups())
                for (uint32_t number = beyond ? group.cases : 0; number < (beyond ? kMostNumbers : group.cases);
                     ++number)
                    if (accepts(nameOf({api, &group, number})))
                        return true;
        return false;
    };
    return inRange(false) || (endless && inRange(true));
}

uint64_t seedOf(uint64_t seed, const CaseId &id)
{
    Hash hash;
    for (const char c : nameOf(id))
        hash.add(static_cast<uint8_t>(c));
    for (int byte = 0; byte < 8; ++byte)
        hash.add(seed >> (8 * byte) & 0xff);
    // The finalizer of SplitMix64: seeds of neighbours have nothing in common.
    uint64_t mixed = hash.value();
    mixed = (mixed ^ (mixed >> 30)) * 0xbf58476d1ce4e5b9u;
    mixed = (mixed ^ (mixed >> 27)) * 0x94d049bb133111ebu;
    mixed ^= mixed >> 31;
    // The seed alone then determines the kind.
    const uint64_t kinds = id.group->kinds;
    return kinds == 1 ? mixed : mixed / 2 / kinds * kinds + id.number % kinds;
}

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

double Schedule::spentSeconds() const
{
    return std::accumulate(streams_.begin(), streams_.end(), 0.0,
                           [](double sum, const Stream &stream) { return sum + stream.spent(); });
}

double Schedule::expectedSeconds() const
{
    double done = 0;
    double begun = 0;    // seconds
    double notBegun = 0; // work
    for (const Stream &stream : streams_) {
        done += stream.workOf(stream.finished());
        if (stream.finished() != 0)
            begun += stream.spent() / stream.finished() * static_cast<double>(stream.remaining());
        else
            notBegun += stream.workOf(stream.remaining());
    }
    return done > 0 ? begun + notBegun * spentSeconds() / done : 0;
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
