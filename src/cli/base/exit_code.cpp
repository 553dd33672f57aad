// SPDX-License-Identifier: Apache-2.0
#include "cli/base/exit_code.h"

#include <algorithm>

namespace vellum::cli
{

std::span<const ExitCodeMeaning> exitCodes()
{
    static constexpr ExitCodeMeaning kCodes[] = {
        {ExitCode::Success, "success, and nothing to report"},
        {ExitCode::Failed, "failed: something cannot be read, baked, verified or written, or no device has micromaps; "
                           "spirv --lint: findings; check: failures, or cases better than the baseline"},
        {ExitCode::Usage, "usage error: nothing was done"},
        {ExitCode::InvalidMicromaps, "info, verify: micromaps that break a rule of the glTF extension"},
        {ExitCode::WrongClaims, "verify: states that contradict the texture"},
        {ExitCode::UncertainClaims, "verify --strict: states outside the margins, undecided claims, or cautions"},
        {ExitCode::NeedlesslyUnknown, "verify --strict: states that are unknown without need"},
        {ExitCode::NoMicromaps, "verify --strict or --require-micromaps, bake --require-micromaps: no micromaps"},
        {ExitCode::MessagesFailed,
         "run: the program succeeded, but there were messages of the severity of --fail-on, or "
         "nothing was checked (--require-checks)"},
        {ExitCode::NotRun,
         "run: the program was not run, for example because the layer is not found; check: nothing was "
         "tested, because no device has micromaps or all cases were skipped"},
        {ExitCode::NotExecutable, "run: the program cannot be executed"},
        {ExitCode::NoProgram, "run: there is no such program"},
    };
    return kCodes;
}

ExitCode worse(ExitCode a, ExitCode b)
{
    if (a == ExitCode::Success || b == ExitCode::Success)
        return std::max(a, b);
    return std::min(a, b);
}

} // namespace vellum::cli
