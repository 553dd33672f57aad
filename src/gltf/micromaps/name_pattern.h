// SPDX-License-Identifier: Apache-2.0
// Shell patterns: * for any characters, ? for one, [abc], [a-z] and [!abc] for one of a set or not of it, and a
// backslash before a character that is meant itself.
#pragma once

#include <string_view>

namespace vellum
{

// Whether the whole name matches. Both are UTF-8.
bool matchesPattern(std::string_view name, std::string_view pattern);

} // namespace vellum
