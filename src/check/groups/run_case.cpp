// SPDX-License-Identifier: Apache-2.0
#include "check/groups/session.h"

namespace vellum::check
{
namespace
{

Outcome skipped(const std::string &why)
{
    return {.status = Status::Skip, .cause = why};
}

// A run whose failed calls of Vulkan are verdicts, except for a lost device.
Verdict verdictOf(Session &session, const Case &c)
{
    (void)session.takeErrors();
    Verdict verdict;
    try {
        verdict = run(session.device(c.memory), c);
    } catch (const VulkanError &error) {
        if (error.result() == VK_ERROR_DEVICE_LOST)
            throw;
        verdict.cause = verdict.detail = error.what();
    }
    if (verdict.skipped)
        return verdict;
    // What a layer takes for an error in a valid program is a failure too, of whichever of the two is wrong.
    for (const std::string &error : session.takeErrors()) {
        verdict.detail += (verdict.detail.empty() ? "" : "\n") + error;
        if (verdict.cause.empty())
            verdict.cause = "a layer reports " + error.substr(0, error.find(':'));
    }
    return verdict;
}

} // namespace

Outcome runAndShrink(Session &session, const Case &c, double)
{
    Outcome outcome;
    try {
        const Verdict verdict = verdictOf(session, c);
        if (verdict.skipped)
            return skipped(verdict.cause);
        outcome.rays = verdict.rays;
        if (verdict.failed()) {
            outcome.status = Status::Fail;
            outcome.cause = verdict.cause;
            outcome.detail = verdict.detail;
        }
    } catch (const VulkanError &error) {
        outcome.status = Status::DeviceLost;
        outcome.cause = outcome.detail = error.what();
    }
    return outcome;
}

Outcome replay(Session &, const std::string &)
{
    return {};
}

} // namespace vellum::check
