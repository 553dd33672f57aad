// SPDX-License-Identifier: Apache-2.0
#include "cli/check/worker.h"

#include <cerrno>
#include <csignal>
#include <exception>
#include <fcntl.h>
#include <iostream>
#include <string>
#include <sys/prctl.h>
#include <unistd.h>

#include "cli/base/error.h"
#include "cli/base/exit_code.h"
#include "cli/check/case_id.h"
#include "cli/check/device.h"
#include "cli/check/protocol.h"
#include "cli/check/separate_runs.h"

namespace vellum::cli
{
namespace
{

void send(const Event &event)
{
    const std::string line = write(event) + "\n";
    for (size_t at = 0; at < line.size();) {
        const ssize_t written = ::write(kEventDescriptor, line.data() + at, line.size() - at);
        if (written < 0 && errno != EINTR)
            throw Error("vellum check has ended");
        at += written > 0 ? static_cast<size_t>(written) : 0;
    }
}

class Worker
{
public:
    explicit Worker(const check::SessionOptions &options) : options_(options) {}

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
            session_ = check::openSession(options_);
        send({Event::Kind::Begin, {}, {}, {}});
        send({Event::Kind::End, {}, outcomeOf(request), {}});
    }

private:
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

    check::SessionOptions options_;
    std::shared_ptr<check::Session> session_;
};

} // namespace

int runWorker(const check::SessionOptions &options)
{
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (fcntl(kEventDescriptor, F_SETFD, FD_CLOEXEC) < 0)
        throw UsageError("--worker is for vellum check itself");
    Worker worker(options);
    for (std::string line; std::getline(std::cin, line);) {
        try {
            worker.answer(parseRequest(line));
        } catch (const std::exception &error) {
            send({Event::Kind::Error, {}, {}, error.what()});
            return static_cast<int>(ExitCode::Failed);
        }
    }
    return static_cast<int>(ExitCode::Success);
}

} // namespace vellum::cli
