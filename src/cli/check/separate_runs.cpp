// SPDX-License-Identifier: Apache-2.0
#include "cli/check/separate_runs.h"

#include <cerrno>
#include <sys/mman.h>
#include <unistd.h>

#include "cli/base/error.h"

namespace vellum::cli
{
namespace
{

// A file that other processes can read as long as this object exists.
class SharedFile
{
public:
    explicit SharedFile(const std::string &text) : file_(memfd_create("reproducer", MFD_CLOEXEC))
    {
        for (size_t at = 0; at < text.size();) {
            const ssize_t written = ::write(file_.number(), text.data() + at, text.size() - at);
            if (written < 0 && errno != EINTR)
                throw Error("no reproducer can be written");
            at += written > 0 ? static_cast<size_t>(written) : 0;
        }
    }
    [[nodiscard]] std::string path() const
    {
        return "/proc/" + std::to_string(getpid()) + "/fd/" + std::to_string(file_.number());
    }

private:
    Descriptor file_;
};

} // namespace

std::string SeparateRuns::make(const std::string &group, uint64_t seed)
{
    const check::Outcome outcome = outcomeOf({.kind = Request::Kind::Make, .group = group, .seed = seed});
    if (outcome.status != check::Status::Pass)
        throw Error(outcome.cause.empty() ? "timeout" : outcome.cause);
    return outcome.reproducer;
}

check::Outcome SeparateRuns::run(const std::string &reproducer)
{
    const SharedFile file(write(Reproducer{.api = options_.api, .shrunk = reproducer}));
    return outcomeOf({.kind = Request::Kind::Replay, .document = file.path()});
}

check::Outcome SeparateRuns::outcomeOf(const Request &request)
{
    if (process_ == nullptr)
        process_ = std::make_unique<WorkerProcess>(options_);
    process_->send(request);
    const Answer answer = waitForAnswer(*process_, timeout_);
    const std::string printed = process_->printed();
    const bool alive = answer.event && answer.event->kind == Event::Kind::End &&
                       answer.event->outcome.status != check::Status::DeviceLost;
    if (!alive)
        process_.reset();
    if (answer.event)
        return answer.event->kind == Event::Kind::End
                   ? answer.event->outcome
                   : outcomeOfEnd(check::Status::Crash, answer.event->message, printed);
    if (answer.ending)
        return outcomeOfEnd(check::Status::Crash, causeOfEnd(*answer.ending, printed), printed);
    return outcomeOfEnd(check::Status::Timeout, "", printed);
}

} // namespace vellum::cli
