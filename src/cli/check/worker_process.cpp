// SPDX-License-Identifier: Apache-2.0
#include "cli/check/worker_process.h"

#include <chrono>
#include <utility>

#include "base/error.h"
#include "base/files.h"
#include "cli/check/case_id.h"

namespace vellum::cli
{
namespace
{

constexpr int kMillisecondsBetweenChecks = 20;

std::vector<std::string> argumentsOf(const WorkerOptions &options)
{
    std::vector<std::string> arguments = {"check", "--worker", "--api", nameOf(options.api)};
    if (options.device.text())
        arguments.insert(arguments.end(), {"--device", *options.device.text()});
    if (!options.layer)
        arguments.emplace_back("--no-layer");
    return arguments;
}

} // namespace

WorkerProcess::WorkerProcess(const WorkerOptions &options) : Worker(argumentsOf(options)) {}

WorkerProcess::Output WorkerProcess::read()
{
    const Worker::Output read = Worker::read();
    Output output{{}, read.end};
    for (const std::string &line : read.lines) {
        try {
            output.events.push_back(parseEvent(line));
        } catch (const Error &) { // a driver writes where it should not
        }
    }
    return output;
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
        const auto [events, end] = worker.read();
        for (const Event &event : events) {
            if (event.kind != Event::Kind::Begin)
                return {event, {}};
            worker.startWaiting();
        }
        if (end)
            return {{}, end};
    }
    return {};
}

std::string SeparateRuns::make(const std::string &group, uint64_t seed)
{
    const check::Outcome outcome = outcomeOf({.kind = Request::Kind::Make, .group = group, .seed = seed});
    if (outcome.status != check::Status::Pass)
        throw Error(outcome.cause.empty() ? "timeout" : outcome.cause);
    return outcome.reproducer;
}

check::Outcome SeparateRuns::run(const std::string &reproducer)
{
    const SharedText document(write(Reproducer{.api = options_.api, .shrunk = reproducer}));
    return outcomeOf({.kind = Request::Kind::Replay, .document = document.path()});
}

check::Outcome SeparateRuns::outcomeOf(const Request &request)
{
    if (process_ == nullptr)
        process_ = std::make_unique<WorkerProcess>(options_);
    process_->send(request);
    const Answer answer = waitForAnswer(*process_, timeout_);
    const std::string printed = process_->printed();
    const std::string cause = answer.end ? process_->causeOf(*answer.end) : "";
    const bool alive = answer.event && answer.event->kind == Event::Kind::End &&
                       answer.event->outcome.status != check::Status::DeviceLost;
    if (!alive)
        process_.reset();
    if (answer.event)
        return answer.event->kind == Event::Kind::End
                   ? answer.event->outcome
                   : outcomeOfEnd(check::Status::Crash, answer.event->message, printed);
    if (answer.end)
        return outcomeOfEnd(check::Status::Crash, cause, printed);
    return outcomeOfEnd(check::Status::Timeout, "", printed);
}

} // namespace vellum::cli
