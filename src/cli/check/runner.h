// SPDX-License-Identifier: Apache-2.0
// Runs cases in worker processes.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "cli/check/cases.h"
#include "cli/check/expectations.h"
#include "cli/check/worker.h"

namespace vellum::cli
{

struct RunSettings {
    WorkerOptions worker; // with any API
    uint64_t seed = 0;
    unsigned jobs = 1;
    double timeout = 60;          // seconds of a case, of opening and of closing the device
    std::optional<double> budget; // seconds after which no further case begins
    bool failFast = false;        // ends with the first failure
    bool failOnFlake = false;     // a flake is one
    std::string replay;           // runs this reproducer for each case; empty without
};

struct Finished {
    CaseId id;
    check::Outcome outcome;
    Verdict verdict = Verdict::Pass;
    double seconds = 0;
    std::vector<CaseId> before; // it fails only after these in the same process
};
// The seed is that of the run.
std::vector<EarlierCase> earlierCases(const std::vector<CaseId> &cases, uint64_t seed);

// "Crash: SIGSEGV": results with the same are put together.
std::string causeOf(const check::Outcome &outcome);

class Runner
{
public:
    // `report` gets each result once it is final; `tick` is called now and then.
    Runner(RunSettings settings, const Expectations &expectations, std::function<void(const Finished &)> report,
           std::function<void()> tick);

    // Until the end of the schedule, of the time, or an interruption.
    void run(Schedule &schedule);
    [[nodiscard]] double seconds() const;

private:
    class Slot;
    using Clock = std::chrono::steady_clock;
    static constexpr unsigned kMostFailedOpenings = 5;
    static constexpr size_t kMostConfirmations = 3;

    [[nodiscard]] bool timeIsOver() const { return settings_.budget && seconds() >= *settings_.budget; }
    // The device cannot be opened any more, or no worker can be started.
    [[nodiscard]] bool givesUp() const { return failedOpenings_ >= kMostFailedOpenings; }
    // Reports skipped cases. Nothing at the end of the stream.
    std::optional<CaseId> nextOf(Stream &stream);
    // Returns whether a failure is to be run again.
    [[nodiscard]] bool mustConfirm(const Finished &finished) const;
    void noteFailedStart(const std::string &error, Clock::time_point time);
    void reportMissing(const CaseId &id);

    RunSettings settings_;
    const Expectations &expectations_;
    std::function<void(const Finished &)> report_;
    std::function<void()> tick_;
    Clock::time_point start_ = Clock::now();
    double turn_ = 0;                   // seconds that a worker runs the cases of one stream
    unsigned failedOpenings_ = 0;       // one after the other
    unsigned workers_ = 0;              // existing workers
    Clock::time_point lastFailedStart_; // the last failure that counts
    std::string whyMissing_;            // of the last one
    bool failed_ = false;
    std::map<std::string, size_t> confirmed_; // cases that failed twice, by cause
};

// The device that workers with these options test. Throws Error if it does not exist, and UsageError if the layer
// ignores a setting, because cases would then not run as the environment requests.
DeviceSummary findDevice(const WorkerOptions &options, double timeout);

} // namespace vellum::cli
