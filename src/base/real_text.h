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

// The number that all of a text is, in the grammar of JSON. Nothing where it is none, or none that a double can hold.
std::optional<double> parseReal(std::string_view text);

namespace plain
{
std::string shortestText(double number);
std::string shortestText(float number);
std::optional<double> parseReal(std::string_view text);
} // namespace plain

} // namespace vellum
