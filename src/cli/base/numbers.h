// SPDX-License-Identifier: Apache-2.0
// Numbers as people read them.
#pragma once

#include <cstdint>
#include <string>

namespace vellum::cli
{

// 1234567 -> 1,234,567
std::string grouped(uint64_t number);
// "1 mesh", "2,000 meshes"; the plural is `one` with an s where there is none.
std::string counted(uint64_t number, const char *one, const char *many = nullptr);
// 0.125 -> 12.5 %
std::string percent(double share);

} // namespace vellum::cli
