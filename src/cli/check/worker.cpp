// SPDX-License-Identifier: Apache-2.0
#include "cli/check/worker.h"

#include <exception>
#include <string>

#include "base/error.h"
#include "cli/check/case_id.h"
#include "cli/check/protocol.h"
#include "cli/check/worker_process.h"

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
            const Reproducer reproducer = readReproducer(request.document);
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

} // namespace vellum::cli
