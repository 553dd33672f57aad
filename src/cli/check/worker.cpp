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
        if (session_ == nullptr)
            session_ = check::openSession(options_);
        send({Event::Kind::Begin, {}, {}, {}});
        send({Event::Kind::End, {}, outcomeOf(request), {}});
    }

private:
    check::Outcome outcomeOf(const Request &request)
    {
        try {
            if (request.kind == Request::Kind::Run)
                return run(request.group, request.seed);
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

    check::Outcome run(const std::string &name, uint64_t seed)
    {
        const check::Group *group = findGroup(name);
        if (group == nullptr)
            throw Error("there is no group " + name);
        return group->run(*session_, group->name, seed);
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
