// SPDX-License-Identifier: Apache-2.0
#include "cli/check/separate_runs.h"

#include "cli/base/error.h"
#include "cli/base/system/files.h"

namespace vellum::cli
{

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
    const bool alive = answer.event && answer.event->kind == Event::Kind::End &&
                       answer.event->outcome.status != check::Status::DeviceLost;
    if (!alive)
        process_.reset();
    if (answer.event)
        return answer.event->kind == Event::Kind::End
                   ? answer.event->outcome
                   : outcomeOfEnd(check::Status::Crash, answer.event->message, printed);
    if (answer.end)
        return outcomeOfEnd(check::Status::Crash, causeOfEnd(*answer.end, printed), printed);
    return outcomeOfEnd(check::Status::Timeout, "", printed);
}

} // namespace vellum::cli
