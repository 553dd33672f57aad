// Which functions a shader consists of.
#pragma once

#include <set>

#include "spirv/module/module.h"

namespace vellum::spirv
{

// The function, and all that it calls, directly or through others.
std::set<Id> reachedFrom(const Module &module, Id function);

} // namespace vellum::spirv
