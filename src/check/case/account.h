// SPDX-License-Identifier: Apache-2.0
// Cases in words.
#pragma once

#include <string>

#include "check/case/case.h"

namespace vellum::check
{

// Describes, in lines of text, what is built by which commands, what is then done, how the wrong ray is traced (the
// first one if the verdict names none), what it must meet and by which rules, and what was found.
std::string accountOf(const Case &c, const Verdict &verdict, Api api);

} // namespace vellum::check
