// SPDX-License-Identifier: Apache-2.0
#include "cli/base/numbers.h"

#include <fmt/format.h>

namespace vellum::cli
{

std::string grouped(uint64_t number)
{
    std::string text = std::to_string(number);
    for (size_t i = text.size(); i > 3;) {
        i -= 3;
        text.insert(i, 1, ',');
    }
    return text;
}

std::string counted(uint64_t number, const char *one, const char *many)
{
    const std::string plural = many != nullptr ? many : std::string(one) + "s";
    return grouped(number) + " " + (number == 1 ? one : plural);
}

std::string percent(double share)
{
    return fmt::format("{:.1f} %", 100 * share);
}

} // namespace vellum::cli
