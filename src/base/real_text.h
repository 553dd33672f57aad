// SPDX-License-Identifier: Apache-2.0
// Numbers of floating point as text, by std::to_chars and std::from_chars where the library has them. That of clang 14
// does not; the functions of namespace `plain` give the same results by those of C, and need the locale "C".
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace vellum
{

// The shortest text that is read as the same number, which must be finite; in the shorter of both notations.
std::string shortestText(double number);
std::string shortestText(float number);

// The number that all of a text is, in the grammar of JSON. 0 where it is closer to 0 than any
// other double; nothing where it is none, or larger than all of them.
std::optional<double> parseReal(std::string_view text);

namespace plain
{
std::string shortestText(double number);
std::string shortestText(float number);
std::optional<double> parseReal(std::string_view text);
} // namespace plain

} // namespace vellum
