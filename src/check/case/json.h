// SPDX-License-Identifier: Apache-2.0
// Cases as files.
#pragma once

#include <string>
#include <string_view>

#include "check/case/case.h"

namespace vellum::check
{

// Fields with their default value are omitted. Floating-point numbers are read back as they were.
std::string toJson(const Case &c);

// Throws std::runtime_error, whose what() is one line: where the text is wrong, and what is wrong there. What it
// returns is valid (validity.h).
Case caseFromJson(std::string_view text);

} // namespace vellum::check
