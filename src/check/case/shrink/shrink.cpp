// SPDX-License-Identifier: Apache-2.0
#include "check/case/shrink/shrink.h"

#include "check/case/json.h"
#include "check/case/shrink/passes.h"

namespace vellum::check
{

Shrunk shrink(const Case &c, const StillFails &stillFails, const ShrinkLimits &limits)
{
    Attempts attempts(c, stillFails, limits);
    Shrunk result;
    for (std::string before; !result.complete && !attempts.exhausted();) {
        before = toJson(attempts.best());
        const bool first = attempts.runs() == 0;
        removeRays(attempts, first ? limits.ray : std::nullopt);
        if (first)
            lowerAllLevels(attempts);
        removeParts(attempts);
        simplifyMicromaps(attempts);
        simplifyUses(attempts);
        simplifyPlans(attempts);
        simplifyScene(attempts);
        result.complete = toJson(attempts.best()) == before;
    }
    attempts.confirm(result);
    result.runs = attempts.runs();
    return result;
}

} // namespace vellum::check
