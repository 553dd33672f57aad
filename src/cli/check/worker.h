// SPDX-License-Identifier: Apache-2.0
// The two ends of a worker process of `vellum check`. Only in a worker does the driver run, which may crash, hang and
// print what it likes.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/check/protocol.h"
#include "job/worker.h"

namespace vellum::cli
{

// Answers the requests of stdin until it ends, on stdout. What the driver prints goes to stderr. Returns an exit code.
int runWorker(const WorkerOptions &options);

// Worker processes of `vellum check`.
class WorkerProcess : public job::Worker
{
public:
    // Starts `vellum check --worker` with these options. Throws Error.
    explicit WorkerProcess(const WorkerOptions &options);

    void send(const Request &request) { Worker::send(write(request)); }

    struct Output {
        std::vector<Event> events;
        std::optional<ProcessEnd> end; // after these events
    };
    // The output since the last call.
    Output read();
};

// A worker's answer to a request.
struct Answer {
    std::optional<Event> event;    // no Event::Begin
    std::optional<ProcessEnd> end; // of a process that has ended instead; neither: the time is over
};
// Waits that many seconds for the device to be open, and as many for what follows; less if vellum is interrupted.
Answer waitForAnswer(WorkerProcess &worker, double seconds);

// The outcome of a case whose worker ended or did not end in time.
check::Outcome outcomeOfEnd(check::Status status, std::string cause, const std::string &printed);

// Cases in worker processes that they may end.
class SeparateRuns
{
public:
    SeparateRuns(WorkerOptions options, double timeout) : options_(std::move(options)), timeout_(timeout) {}

    // The case of a group as a reproducer; it does not run. Throws Error.
    std::string make(const std::string &group, uint64_t seed);
    // Runs one. Another process follows one that has ended.
    check::Outcome run(const std::string &reproducer);

private:
    check::Outcome outcomeOf(const Request &request);

    WorkerOptions options_;
    double timeout_;
    std::unique_ptr<WorkerProcess> process_;
};

} // namespace vellum::cli
