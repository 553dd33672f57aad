// SPDX-License-Identifier: Apache-2.0
// The execution mode OpacityMicromapIdKHR, put into compiled shaders: compilers are older than it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace vellum::check
{

enum class Mode { Absent, False, True, Specialized };

// The module with the execution mode; Specialized: by the constant with id 0, which is false. It must have one entry
// point, a bool type and debug names.
std::vector<uint32_t> withMode(std::span<const uint32_t> words, Mode mode);

// With the mode, true, where the module has ray queries.
std::vector<uint32_t> withModeWhereNeeded(std::span<const uint32_t> words);

} // namespace vellum::check
