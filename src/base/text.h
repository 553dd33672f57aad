// SPDX-License-Identifier: Apache-2.0
// Text: UTF-8, patterns of names, numbers, and what people read.
#pragma once

#include <charconv>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace vellum
{

// The length of the character at the beginning of a text, or 0 if it is not well-formed (the Unicode Standard, table
// 3-7).
size_t utf8Sequence(std::string_view text);

// The code point at the beginning of a text, which loses it; U+FFFD for a byte that does not belong to one.
char32_t takeCodePoint(std::string_view &text);

// Replaces each control character (of ASCII, and U+0080 to U+009F in UTF-8) by "?": a name must not break a table into
// lines, or control a terminal.
std::string printable(std::string text);

// A name as messages and reports show it: printable, and only the beginning of one that is longer than 128 bytes.
std::string shownName(std::string_view name);

// Returns whether the whole name matches. Both are UTF-8.
bool matchesPattern(std::string_view name, std::string_view pattern);

// 1234567 -> 1,234,567
std::string grouped(uint64_t number);
// "1 mesh", "2,000 meshes"; without `many`, the plural is `one` with an s.
std::string counted(uint64_t number, const char *one, const char *many = nullptr);
// 0.125 -> 12.5 %
std::string percent(double share);

// A line for each row, with its columns aligned: the first `left` to the left, the others to the right. Rows have as
// many cells as the first, or fewer.
std::string alignedRows(std::span<const std::vector<std::string>> rows, size_t left, std::string_view indent);

// A word of a shell's command.
std::string shellWord(const std::string &text);

// The parts of a list that are not empty.
std::vector<std::string> partsOf(const std::string &list, char separator);

inline constexpr std::string_view kBase64Alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
std::string base64Encoded(std::span<const uint8_t> bytes);

// Text of an element of HTML or XML, or of an attribute in double quotes. What XML cannot have becomes U+FFFD: invalid
// UTF-8, and control characters except tabs and line breaks.
std::string markupText(std::string_view text);

// The number that all of a text is.
template <typename Number>
std::optional<Number> parseNumber(std::string_view text)
{
    Number number{};
    const char *end = text.data() + text.size();
    const auto [last, error] = std::from_chars(text.data(), end, number);
    return error == std::errc() && last == end ? std::optional(number) : std::nullopt;
}

// "0x0123456789abcdef": numbers of 64 bits are strings in JSON.
std::string hexadecimal(uint64_t number);
std::optional<uint64_t> parseHexadecimal(std::string_view text);
// "00ff": two digits for each byte.
std::string hexOf(std::span<const uint8_t> bytes);

// The shortest text that is read as the same number, which must be finite; in the shorter of both notations.
std::string shortestText(double number);
std::string shortestText(float number);

// The number that all of a text is, in the grammar of JSON. 0 where it is closer to 0 than any other double; nothing
// where it is none, or larger than all of them.
std::optional<double> parseReal(std::string_view text);

// The library of clang 14 has neither std::to_chars nor std::from_chars for these. The functions of this namespace give
// the same results by those of C, and need the locale "C".
namespace plain
{
std::string shortestText(double number);
std::string shortestText(float number);
std::optional<double> parseReal(std::string_view text);
} // namespace plain

} // namespace vellum
