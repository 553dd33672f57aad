// SPDX-License-Identifier: Apache-2.0
// The SPIR-V numbers, with those that installed headers may be too old to have (numbers.h).
#pragma once

#define SPV_ENABLE_UTILITY_CODE
#include <spirv/unified1/spirv.hpp>
#undef SPV_ENABLE_UTILITY_CODE

#include "spirv/module/numbers.h"
