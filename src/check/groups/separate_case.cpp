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
    Case smallest = caseFromJson(reproducer);
    if (seconds > 0 && endsItsProcess(outcome.status)) {
        const auto stillFails = [&](const Case &smaller) {
            const Outcome other = run(toJson(smaller));
            return other.status == outcome.status && other.cause == outcome.cause;
        };
        smallest = shrink(smallest, stillFails, {.seconds = seconds}).smallest;
        outcome.reproducer = toJson(smallest);
    }
    outcome.files = {{"txt", accountOf(smallest, {.cause = outcome.cause, .detail = inWords(outcome)}, api)}};
    return outcome;
}

} // namespace vellum::check
