// SPDX-License-Identifier: Apache-2.0
#include "cli/check/worker_process.h"

#include <chrono>
#include <utility>

#include "cli/base/error.h"
#include "cli/base/system/interrupt.h"
#include "cli/check/case_id.h"

namespace vellum::cli
{
namespace
{

constexpr size_t kMostPrinted = 4096;
constexpr int kMillisecondsBetweenChecks = 20;

std::vector<std::string> argumentsOf(const WorkerOptions &options)
{
    std::vector<std::string> arguments = {"check", "--worker", "--api", nameOf(options.api)};
    if (options.device)
        arguments.insert(arguments.end(), {"--device", *options.device});
    if (!options.layer)
        arguments.emplace_back("--no-layer");
    return arguments;
}

// The failed assertion that a driver printed; empty if there is none.
std::string assertionIn(const std::string &printed)
{
    for (const char *word : {"Assertion ", "assertion "}) {
        const size_t at = printed.rfind(word);
        if (at == std::string::npos)
            continue;
        const size_t line = printed.rfind('\n', at);
        const size_t begin = line == std::string::npos ? 0 : line + 1;
        return printed.substr(begin, printed.find('\n', at) - begin);
    }
    return {};
}

} // namespace

WorkerProcess::WorkerProcess(const WorkerOptions &options) : process_(argumentsOf(options)) {}

void WorkerProcess::send(const Request &request)
{
    printed_.clear();
    process_.write(write(request) + "\n");
}

std::vector<Event> WorkerProcess::read()
{
    process_.read(line_, printed_);
    if (printed_.size() > kMostPrinted)
        printed_.erase(0, printed_.size() - kMostPrinted);
    std::vector<Event> events;
    for (size_t end = line_.find('\n'); end != std::string::npos; end = line_.find('\n')) {
        try {
            events.push_back(parseEvent(line_.substr(0, end)));
        } catch (const Error &) { // a driver writes where it should not
        }
        line_.erase(0, end + 1);
    }
    return events;
}

void WorkerProcess::startWaiting()
{
    waitingSince_ = std::chrono::steady_clock::now();
    waitedBefore_ = process_.waitedForProcessor();
}

bool WorkerProcess::isLate(double seconds) const
{
    constexpr double kMostTimes = 5;
    const double passed = std::chrono::duration<double>(std::chrono::steady_clock::now() - waitingSince_).count();
    return passed > seconds &&
           (passed > kMostTimes * seconds || passed - (process_.waitedForProcessor() - waitedBefore_) > seconds);
}

std::string causeOfEnd(const ProcessEnd &end, const std::string &printed)
{
    const std::string assertion = assertionIn(printed);
    return (end.text().empty() ? "exit code 0" : end.text()) + (assertion.empty() ? "" : ": " + assertion);
}

check::Outcome outcomeOfEnd(check::Status status, std::string cause, const std::string &printed)
{
    check::Outcome outcome;
    outcome.status = status;
    outcome.cause = std::move(cause);
    if (printed.empty())
        return outcome;
    outcome.detail = "The last output was:\n";
    for (const char c : printed)
        outcome.detail += (c >= ' ' && c <= '~') || c == '\n' || c == '\t' ? c : '?';
    return outcome;
}

Answer waitForAnswer(WorkerProcess &worker, double seconds)
{
    worker.startWaiting();
    while (!worker.isLate(seconds) && !Interruptible::interrupted()) {
        const ChildProcess *const process = &worker.process();
        ChildProcess::waitForAny({&process, 1}, kMillisecondsBetweenChecks);
        const std::optional<ProcessEnd> end = process->end(); // first: what was written before it is read below
        for (const Event &event : worker.read()) {
            if (event.kind != Event::Kind::Begin)
                return {event, {}};
            worker.startWaiting();
        }
        if (end)
            return {{}, end};
    }
    return {};
}

} // namespace vellum::cli
