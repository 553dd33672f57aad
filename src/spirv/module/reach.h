// SPDX-License-Identifier: Apache-2.0
// The functions that an entry point reaches.
#pragma once

#include <set>
#include <vector>

#include "spirv/module/module.h"

namespace vellum::spirv
{

// The functions, and all that they call, directly or through others.
std::set<Id> reachedFrom(const Module &module, std::vector<Id> functions);

} // namespace vellum::spirv
