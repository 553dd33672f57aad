// SPDX-License-Identifier: Apache-2.0
// Worker processes: this program once more, where a driver may crash, hang and print what it likes. A worker reads
// requests from stdin and answers with events on stdout, each a JSON object in a line. `vellum check` runs cases in
// workers, `vellum bench` its parts.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/files.h"
#include "base/process.h"

namespace vellum::job
{

// A worker, seen from the process that started it.
class Worker
{
public:
    // `arguments` must lead to answerRequests(). Throws Error.
    explicit Worker(const std::vector<std::string> &arguments) : process_(arguments) {}

    void send(const std::string &request);
    // It ends when it has answered.
    void endRequests() { process_.closeInput(); }
    [[nodiscard]] const ChildProcess &process() const { return process_; }

    struct Output {
        std::vector<std::string> lines; // a driver may have written some of them
        std::optional<ProcessEnd> end;  // after these lines
    };
    // The output since the last call.
    Output read();
    // Begins to count the time that the worker needs for the next event.
    void startWaiting();
    // Returns whether that is more than so many seconds. Time in which its threads wait for a processor does not count,
    // so that a job does not time out because the machine is busy, except that five times the seconds are always
    // enough.
    [[nodiscard]] bool isLate(double seconds) const;
    // The end of what was printed to stderr since the last request, by the driver or with the error that ended the
    // worker.
    [[nodiscard]] const std::string &printed() const { return printed_; }
    // Describes an end of the worker, with the failed assertion that a driver has printed.
    [[nodiscard]] std::string causeOf(const ProcessEnd &end) const;

private:
    ChildProcess process_;
    std::string line_; // begun
    std::string printed_;
    std::chrono::steady_clock::time_point waitingSince_{};
    double waitedBefore_ = 0;
};

// The channel of a worker's events.
class Events
{
public:
    void send(const std::string &event);

private:
    DataOutput output_{DataOutput::Reports::ToStderr};
};

// Answers the requests of stdin until it ends. What else is printed goes to stderr. An exception ends the worker, after
// an event that errorEvent() makes. Returns the exit code.
int answerRequests(const std::function<void(const std::string &request, Events &events)> &answer);

std::string errorEvent(std::string_view message);
// The message of such an event; nothing for another line.
std::optional<std::string> errorIn(const std::string &line);

} // namespace vellum::job
