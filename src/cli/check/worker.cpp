// SPDX-License-Identifier: Apache-2.0
#include "cli/check/worker.h"

#include <charconv>
#include <exception>
#include <iostream>
#include <string>

#include "cli/base/error.h"
#include "cli/base/exit_code.h"
#include "cli/base/standard_streams.h"
#include "cli/base/system/child_process.h"
#include "cli/check/case_id.h"
#include "cli/check/device.h"
#include "cli/check/protocol.h"
#include "cli/check/separate_runs.h"

namespace vellum::cli
{
namespace
{

class Worker
{
public:
    explicit Worker(const WorkerOptions &options) : options_(options) {}

    void send(const Event &event)
    {
        events_.write(write(event) + "\n");
        events_.finish();
    }

    void answer(const Request &request)
    {
        if (request.kind == Request::Kind::Describe) {
            send({Event::Kind::Device, describeDevice(options_), {}, {}});
            return;
        }
        if (request.kind == Request::Kind::Separate) {
            send({Event::Kind::End, {}, runSeparately(request), {}});
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
        const std::string text = options_.device.value_or("");
        uint32_t number = 0;
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
        if (error != std::errc() || end != text.data() + text.size())
            throw Error("a worker takes a device by its number");
        return number;
    }

    check::Outcome runSeparately(const Request &request)
    {
        SeparateRuns runs(options_, request.timeout);
        const std::string made = runs.make(request.group, request.seed);
        send({Event::Kind::Begin, {}, {}, {}});
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
    DataOutput events_{DataOutput::Reports::ToStderr};
    std::shared_ptr<check::Session> session_;
};

} // namespace

int runWorker(const WorkerOptions &options)
{
    endWithParent();
    Worker worker(options);
    bool asked = false;
    for (std::string line; std::getline(std::cin, line); asked = true) {
        try {
            worker.answer(parseRequest(line));
        } catch (const std::exception &error) {
            worker.send({Event::Kind::Error, {}, {}, error.what()});
            return static_cast<int>(ExitCode::Failed);
        }
    }
    if (!asked)
        throw UsageError("--worker is for vellum check itself");
    return static_cast<int>(ExitCode::Success);
}

} // namespace vellum::cli
