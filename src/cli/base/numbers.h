// Numbers as people read them.
#pragma once

#include <cstdint>
#include <string>

namespace vellum::cli
{

// 1234567 -> 1,234,567
std::string grouped(std::uint64_t number);
// 0.125 -> 12.5 %
std::string percent(double share);

} // namespace vellum::cli
