// SPDX-License-Identifier: Apache-2.0
#include "check/case/case.h"
#include "check/case/shrink/shrink.h"
#include "check/groups/group.h"

namespace vellum::check
{
namespace
{

bool endsItsProcess(Status status)
{
    return status == Status::Crash || status == Status::DeviceLost;
}

std::string inWords(const Outcome &outcome)
{
    switch (outcome.status) {
    case Status::Crash: return "the process ended: " + outcome.cause;
    case Status::DeviceLost: return "the device was lost: " + outcome.cause;
    case Status::Timeout: return "nothing within the time limit";
    default: return outcome.cause;
    }
}

} // namespace

Outcome runSeparately(const std::string &reproducer, Api api, double seconds,
                      const std::function<Outcome(const std::string &reproducer)> &run)
{
    Outcome outcome = run(reproducer);
    outcome.reproducer = reproducer;
    if (!endsItsProcess(outcome.status) && outcome.status != Status::Timeout)
        return outcome;
    if (seconds > 0 && endsItsProcess(outcome.status)) {
        const auto stillFails = [&](const Case &smaller) {
            const Outcome other = run(toJson(smaller));
            return other.status == outcome.status && other.cause == outcome.cause;
        };
        outcome.reproducer = toJson(shrink(caseFromJson(reproducer), stillFails, {.seconds = seconds}).smallest);
    }
    outcome.files = {separateAccount(outcome.reproducer, api, outcome, {})};
    return outcome;
}

OutcomeFile separateAccount(const std::string &reproducer, Api api, const Outcome &outcome, const std::string &note)
{
    const std::string detail = inWords(outcome) + (note.empty() ? "" : "\n" + note);
    return {"txt", accountOf(caseFromJson(reproducer), {.cause = outcome.cause, .detail = detail}, api)};
}

} // namespace vellum::check
