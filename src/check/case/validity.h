// SPDX-License-Identifier: Apache-2.0
// Checks whether a case is a valid use of Vulkan.
#pragma once

#include <string>

#include "check/case/case.h"

namespace vellum::check
{

// The first rule that the case breaks, as "where: what", or nothing. Running a valid case makes no invalid call and
// reads nothing out of range, whatever file it comes from.
std::string invalid(const Case &c);

} // namespace vellum::check
