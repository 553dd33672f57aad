// SPDX-License-Identifier: Apache-2.0
// Variables of the environment that were meant to be settings.
#pragma once

#include <string>
#include <vector>

namespace vellum::cli
{

// "there is no setting VELLUM_VALIDTE; did you mean VELLUM_VALIDATE?" for each whose name is nearly that of a setting,
// also if it is the prefix that is wrong (VELUM_VALIDATE). Others may be another program's.
std::vector<std::string> misspeltVariables();

} // namespace vellum::cli
