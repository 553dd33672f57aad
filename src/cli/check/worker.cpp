// SPDX-License-Identifier: Apache-2.0
#include "cli/check/worker.h"

#include <exception>
#include <string>
#include <utility>

#include "base/error.h"
#include "cli/check/cases.h"
#include "cli/check/protocol.h"

namespace vellum::cli
{
namespace
{

class Worker
{
public:
    explicit Worker(const WorkerOptions &options) : options_(options) {}

    void answer(const Request &request, job::Events &events)
    {
        const auto send = [&events](const Event &event) { events.send(write(event)); };
        if (request.kind == Request::Kind::Describe) {
            send({Event::Kind::Device, describeDevice(options_), {}, {}});
            return;
        }
        if (request.kind == Request::Kind::Separate) {
            send({Event::Kind::End, {}, runSeparately(request, events), {}});
            return;
        }
        if (session_ == nullptr)
            session_ = check::openSession({chosenDevice(), options_.api, options_.layer});
        send({Event::Kind::Begin, {}, {}, {}});
        send({Event::Kind::End, {}, outcomeOf(request), {}});
    }

private:
    [[nodiscard]] uint32_t chosenDevice() const
    {
        const std::optional<uint32_t> number = options_.device.number();
        if (!number)
            throw Error("a worker takes a device by its number");
        return *number;
    }

    check::Outcome runSeparately(const Request &request, job::Events &events)
    {
        SeparateRuns runs(options_, request.timeout);
        const std::string made = runs.make(request.group, request.seed);
        events.send(write(Event{.kind = Event::Kind::Begin}));
        return check::runSeparately(made, options_.api, request.shrinkSeconds,
                                    [&](const std::string &reproducer) { return runs.run(reproducer); });
    }

    check::Outcome outcomeOf(const Request &request)
    {
        try {
            if (request.kind == Request::Kind::Run)
                return run(request.group, request.seed);
            if (request.kind == Request::Kind::Make) {
                check::Outcome outcome;
                outcome.reproducer = check::makeCase(*session_, groupOf(request.group), request.seed);
                return outcome;
            }
            const Reproducer reproducer = parseReproducer(request.reproducer);
            return reproducer.shrunk.empty() ? run(reproducer.group, reproducer.seed)
                                             : check::replay(*session_, reproducer.shrunk);
        } catch (const std::exception &error) {
            check::Outcome outcome;
            outcome.status = check::Status::Fail;
            outcome.cause = std::string("exception: ") + error.what();
            return outcome;
        }
    }

    check::Outcome run(const std::string &group, uint64_t seed) { return groupOf(group).run(*session_, group, seed); }

    static const check::Group &groupOf(const std::string &name)
    {
        const check::Group *group = findGroup(name);
        if (group == nullptr)
            throw Error("there is no group " + name);
        return *group;
    }

    WorkerOptions options_;
    std::shared_ptr<check::Session> session_;
};

} // namespace

int runWorker(const WorkerOptions &options)
{
    Worker worker(options);
    return job::answerRequests(
        [&](const std::string &request, job::Events &events) { worker.answer(parseRequest(request), events); });
}

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
    return outcomeOf(
        {.kind = Request::Kind::Replay, .reproducer = write(Reproducer{.api = options_.api, .shrunk = reproducer})});
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
