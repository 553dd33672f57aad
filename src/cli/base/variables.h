// SPDX-License-Identifier: Apache-2.0
// Variables of the environment that look like settings.
#pragma once

#include <string>
#include <vector>

namespace vellum::cli
{

// Why nothing reads some of the variables: "there is no setting VELLUM_VALIDTE; did you mean VELLUM_VALIDATE?".
std::vector<std::string> problemsOfVariables();

} // namespace vellum::cli
