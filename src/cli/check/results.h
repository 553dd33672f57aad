// SPDX-License-Identifier: Apache-2.0
// Results of cases, put together, also those of several runs such as the shards of one, in the forms in which they are
// printed and written.
#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/version.h"
#include "cli/check/cases.h"
#include "cli/check/expectations.h"
#include "cli/check/runner.h"
#include "cli/check/worker.h"

namespace vellum::cli
{

struct CaseResult {
    CaseId id;
    check::Status status = check::Status::Pass;
    Verdict verdict = Verdict::Pass;
    double seconds = 0;
    uint64_t rays = 0;
    // Details of a case that did not pass, or else null.
    struct Details {
        std::string cause;
        std::string text;
        std::string reproducer; // its path; empty if none
        size_t before = 0;      // it fails only after as many cases in the same process
    };
    std::shared_ptr<const Details> details;

    [[nodiscard]] const std::string &cause() const;
};

// "Crash: SIGSEGV", "UnexpectedImprovement(Pass)": results with the same are put together.
std::string causeOf(const CaseResult &result);

// A group with one extension, and how many of its cases a run selects. --minutes adds to them.
struct PlannedGroup {
    check::Api api = check::Api::Khr;
    const check::Group *group = nullptr;
    size_t cases = 0;
};
std::vector<PlannedGroup> planOf(const std::vector<CaseId> &cases);

// The results of one group with one extension.
struct GroupTally {
    check::Api api = check::Api::Khr;
    const check::Group *group = nullptr;
    size_t planned = 0;
    size_t cases = 0;
    std::map<check::Status, size_t> statuses; // without cases that were not run
    uint64_t rays = 0;
    double seconds = 0;

    [[nodiscard]] size_t count(std::initializer_list<check::Status> some) const;
    // Cases that were run, and tested something.
    [[nodiscard]] size_t tested() const;
    // The number of cases that a run should test at least.
    [[nodiscard]] size_t least() const { return std::min<size_t>(planned, group->quickCases()); }
};

// Failures with one cause.
struct CauseTally {
    std::string cause;
    size_t count = 0;
    const CaseResult *first = nullptr;      // by number
    const CaseResult *reproduced = nullptr; // the first one with a reproducer
};

struct CheckTally {
    std::vector<GroupTally> groups;
    std::map<Verdict, size_t> verdicts;
    std::vector<CauseTally> failures;     // most frequent first
    std::vector<CauseTally> improvements; // upon the baseline; they fail the run as well
    std::vector<CauseTally> flakes;
    std::vector<CauseTally> skips;
};
// Points to elements of `results`. Groups of the plan that have no result are in the tally as well.
CheckTally tallyOf(const std::vector<CaseResult> &results, const std::vector<PlannedGroup> &plan = {});

// Facts about a run as a whole.
struct RunFacts {
    DeviceSummary device;
    uint64_t seed = 0;
    std::vector<PlannedGroup> plan;
    double seconds = 0;
    std::string incomplete;    // why results are missing; empty if none are
    std::string shard;         // of --shard; empty: without
    std::string selection;     // describe()
    std::string replayOptions; // of the command line that runs a failure again, each followed by a space
    std::string version = versionText();
};

// The file of a run's folder that has everything, and in which another run recognizes the folder.
inline constexpr const char *kResultsFile = "results.json";

// deqp-runner's results.csv: name,status,seconds, by name.
std::string resultsCsv(const std::vector<CaseResult> &results);
// failures.csv as deqp-runner writes it: name,status of unexpected results. Of a run without a baseline, it can be that
// of the next run.
std::string failuresCsv(const std::vector<CaseResult> &results);
// JUnit's XML, a test suite for each group and extension.
std::string junitXml(const RunFacts &facts, const std::vector<CaseResult> &results);
// src/cli/schema.json describes it.
std::string resultsJson(const RunFacts &facts, const std::vector<CaseResult> &results);

// Readable text: a table of groups and a list of causes.
std::string resultsTable(const RunFacts &facts, const std::vector<CaseResult> &results);

class OutputFolder
{
public:
    // Throws Error for a folder with files that are not of an earlier run, unless `force` is set. Removes the failures
    // of an earlier run.
    OutputFolder(std::filesystem::path path, bool force);

    // Writes the reproducer of a failure and its account, for the first failures with each cause. Returns its path;
    // empty if none was written. The seed is that of the run.
    std::string writeFailure(const Finished &finished, uint64_t seed);
    // The file of a failure in the folder of a run.
    static std::filesystem::path reproducerIn(const std::filesystem::path &folder, const CaseId &id);
    // Copies the files of a failure from another folder that has its reproducer. Returns the path of the copy. Throws
    // Error.
    [[nodiscard]] std::string copyFailure(const std::filesystem::path &from, const CaseId &id) const;
    // Writes results.csv, failures.csv, junit.xml and results.json. Throws Error.
    void writeResults(const RunFacts &facts, const std::vector<CaseResult> &results) const;

    static constexpr size_t kMostReproducers = 3; // of each cause

private:
    void removeFailures() const;

    static constexpr size_t kMostReproducerBytes = 65000; // of a case

    std::filesystem::path path_;
    std::map<std::string, size_t> written_; // reproducers, by cause
};

// The results of several runs, such as the shards of one, as those of one run.
struct MergedRuns {
    RunFacts facts;
    std::vector<CaseResult> results;
};

// The results of a run, which is given by its folder or by this file.
std::filesystem::path resultsOf(const std::filesystem::path &run);
// Why the results in a folder are not whole, "interrupted"; empty if they are, or are not there.
std::string incompleteIn(const std::filesystem::path &folder);
// Throws UsageError for other files, and for runs that do not belong together: of other versions of Vellum, devices,
// seeds, selections or divisions, or with the same case.
MergedRuns mergeRuns(const std::vector<std::filesystem::path> &runs);
// Copies the files of the first failures of each cause to the folder. Throws Error.
void copyFailures(MergedRuns &runs, const OutputFolder &folder);

} // namespace vellum::cli
