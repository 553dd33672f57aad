// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bake/bake.h"

namespace vellum::test
{

inline BakeOptions atLevel(uint32_t level)
{
    BakeOptions options;
    options.level = level;
    return options;
}

} // namespace vellum::test
