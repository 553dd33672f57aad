// SPDX-License-Identifier: Apache-2.0
// A worker process, seen from `vellum check`.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "cli/base/system/child_process.h"
#include "cli/check/protocol.h"

namespace vellum::cli
{

class WorkerProcess
{
public:
    // Starts `vellum check --worker` with these options. Throws Error.
    explicit WorkerProcess(const WorkerOptions &options);

    void send(const Request &request);
    // The worker ends when it has answered.
    void endRequests() { process_.closeInput(); }
    [[nodiscard]] const ChildProcess &process() const { return process_; }

    // The events that have come.
    std::vector<Event> read();
    // Begins to count the time that the worker needs for the next event.
    void startWaiting();
    // Whether that is more than so many seconds. Time in which its threads wait for a processor does not count, so that
    // a case does not time out because the machine is busy, except that five times the seconds are always enough.
    [[nodiscard]] bool isLate(double seconds) const;
    // The end of what the driver printed since the last request.
    [[nodiscard]] const std::string &printed() const { return printed_; }

private:
    ChildProcess process_;
    std::string line_; // begun
    std::string printed_;
    std::chrono::steady_clock::time_point waitingSince_{};
    double waitedBefore_ = 0;
};

// What a worker answers to a request.
struct Answer {
    std::optional<Event> event;    // no Event::Begin
    std::optional<ProcessEnd> end; // of a process that has ended instead; neither: the time is over
};
// Waits that many seconds for the device to be open, and as many for what follows; less if vellum is interrupted.
Answer waitForAnswer(WorkerProcess &worker, double seconds);

// Of a case whose worker ended or did not end in time.
check::Outcome outcomeOfEnd(check::Status status, std::string cause, const std::string &printed);
// What became of the worker, with the failed assertion that a driver has printed.
std::string causeOfEnd(const ProcessEnd &end, const std::string &printed);

} // namespace vellum::cli
