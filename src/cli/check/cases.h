// SPDX-License-Identifier: Apache-2.0
// The cases of `vellum check`: their names, "khr.resolution-query.0042", and seeds, which are selected, and in which
// order they run.
#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/text.h"
#include "check/groups/group.h"
#include "job/shard.h"

namespace vellum::cli
{

struct CaseId {
    check::Api api = check::Api::Khr;
    const check::Group *group = nullptr;
    uint32_t number = 0;

    friend bool operator==(const CaseId &, const CaseId &) = default;
};

const char *nameOf(check::Api api);
// "khr.resolution-query"
std::string nameOf(check::Api api, const check::Group &group);
std::string nameOf(const CaseId &id);
// Nothing if there is no such group, or the name is not of this form.
std::optional<CaseId> parseCase(std::string_view name);
// Returns whether the name of any case is accepted. `endless`: of a run with new cases as well, which follow those of a
// full run: they are tried up to the number 9999.
bool anyCase(const std::function<bool(const std::string &name)> &accepts, bool endless);
// Null if there is none.
const check::Group *findGroup(std::string_view name);

// Depends on nothing else, so that a case stays the same from one run and one machine to the next.
uint64_t seedOf(uint64_t seed, const CaseId &id);

// The cases of one group with one extension, which a worker process runs one after the other.
class Stream
{
public:
    Stream(check::Api api, const check::Group &group, std::vector<uint32_t> numbers)
        : api_(api), group_(&group), numbers_(std::move(numbers))
    {
    }
    // Goes on with cases that are not part of a full run, those that `wanted` accepts, unless all are skipped.
    void goOn(std::function<bool(const CaseId &)> wanted) { wanted_ = std::move(wanted); }

    [[nodiscard]] check::Api api() const { return api_; }
    [[nodiscard]] bool atEnd();
    // Must not be called at the end.
    CaseId next();
    // Records the result of a case.
    void note(check::Status status, double ofSeconds)
    {
        seconds += ofSeconds;
        spent_ += ofSeconds;
        onlySkips_ &= status == check::Status::Skip;
        ++finished_;
    }
    // Records that a case was run again.
    void noteRepeated(double ofSeconds) { seconds += ofSeconds; }
    // The number of remaining cases, without those of goOn().
    [[nodiscard]] size_t remaining() const { return numbers_.size() - at_; }
    // "khr.levels"
    [[nodiscard]] std::string name() const;
    // Cases that have ended, and the time of their first runs.
    [[nodiscard]] uint32_t finished() const { return finished_; }
    [[nodiscard]] double spent() const { return spent_; }
    // Cases of a group's quick run take about the same time for all groups: work is counted in it.
    [[nodiscard]] double workOf(size_t cases) const { return static_cast<double>(cases) / group_->quickCases(); }

    unsigned workers = 0; // workers that run its cases now
    double seconds = 0;   // time that its cases took

private:
    check::Api api_;
    const check::Group *group_;
    std::vector<uint32_t> numbers_;
    size_t at_ = 0;
    uint32_t finished_ = 0;
    double spent_ = 0;
    bool onlySkips_ = true;
    std::function<bool(const CaseId &)> wanted_;
};

class Schedule
{
public:
    void add(Stream stream) { streams_.push_back(std::move(stream)); }
    // All streams get the same time; without, each is run to its end.
    void shareTime() { timed_ = true; }

    // The stream that a worker runs next; null at the end.
    Stream *choose();
    [[nodiscard]] size_t remaining() const;
    // The time that the remaining cases take a worker, if those of a stream take as long as the ones that have ended,
    // and a stream of which none has ended is as fast as the others. 0 if no case has ended.
    [[nodiscard]] double expectedSeconds() const;
    // The time of the cases that have ended, without repetitions.
    [[nodiscard]] double spentSeconds() const;
    [[nodiscard]] size_t streams() const { return streams_.size(); }
    // The groups of the cases that workers run now: "khr.levels, ext.updates".
    [[nodiscard]] std::string running() const;

private:
    std::list<Stream> streams_;
    bool timed_ = false;
};

// The selection by the command line.
struct CaseSelection {
    std::vector<check::Api> apis;
    std::vector<std::string> filters; // globs; a case must match one of them, if there are any
    std::vector<CaseId> list;         // only these, if `listed`
    bool listed = false;
    bool quick = false; // the first cases of each group
    bool endless = false;
    job::Shard
        shard; // of each group the cases whose numbers have the same rest, so that shards take about the same time

    [[nodiscard]] bool accepts(const CaseId &id) const;
};
Schedule makeSchedule(const CaseSelection &selection);
// The first filter of the selection that matches no case.
std::optional<std::string> idleFilter(const CaseSelection &selection);
// What is selected, without the shard: "60 cases (0123456789abcdef)". Of other cases it is another text.
std::string describe(CaseSelection selection);
// The cases of a full run, or a quick one, that a selection has.
std::vector<CaseId> casesOf(const CaseSelection &selection);

} // namespace vellum::cli
