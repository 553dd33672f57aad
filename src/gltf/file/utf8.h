// SPDX-License-Identifier: Apache-2.0
// Names of files are bytes, and JSON is UTF-8.
#pragma once

#include <cstddef>
#include <string_view>

namespace vellum
{

// The length of the character at the beginning of a text, or 0 where there is none that is well-formed (the Unicode
// Standard, table 3-7).
size_t utf8Sequence(std::string_view text);

// The code point at the beginning of a text, which loses it; U+FFFD for a byte that does not belong to one.
char32_t takeCodePoint(std::string_view &text);

} // namespace vellum
