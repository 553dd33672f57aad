// SPDX-License-Identifier: Apache-2.0
// Makes cases that fail smaller.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "check/case/case.h"

namespace vellum::check
{

struct ShrinkLimits {
    double seconds = 60;
    uint32_t runs = 3000;
    std::optional<uint32_t> ray; // the ray that fails in the first case (Verdict::ray)
};

struct Shrunk {
    Case smallest;
    uint32_t runs = 0;
    bool complete = false; // nothing more can be removed; false: a limit was reached
    // How often the smallest case failed in that many runs at the end. A case that does not fail each time is chosen
    // only if the first case does not either.
    uint32_t failures = 0;
    uint32_t confirmations = 0;
};

// What is left of `seconds` for attempts, if a run takes that long: about six runs follow them, which confirm and
// explain the smallest case. A case of a slow device is not made smaller until it is taken for one that hangs.
constexpr double secondsForAttempts(double seconds, double secondsOfRun)
{
    return seconds - 6 * secondsOfRun;
}

using StillFails = std::function<bool(const Case &)>;

// The smallest case found for which stillFails is true, which must be so for c. Every case that stillFails gets is
// valid (case.h).
Shrunk shrink(const Case &c, const StillFails &stillFails, const ShrinkLimits &limits);

} // namespace vellum::check
