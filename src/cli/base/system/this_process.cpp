// SPDX-License-Identifier: Apache-2.0
#include "cli/base/system/this_process.h"

#include <algorithm>

namespace vellum::cli
{

std::vector<std::string> listOf(const std::string &value)
{
    std::vector<std::string> parts;
    for (size_t begin = 0; begin < value.size();) {
        const size_t end = std::min(value.find(kListSeparator, begin), value.size());
        if (end != begin)
            parts.push_back(value.substr(begin, end - begin));
        begin = end + 1;
    }
    return parts;
}

} // namespace vellum::cli
