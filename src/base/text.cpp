// SPDX-License-Identifier: Apache-2.0
#include "base/text.h"

#include <algorithm>
#include <array>
#include <clocale>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <version>

namespace vellum
{

size_t utf8Sequence(std::string_view text)
{
    const auto byteAt = [&](size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u; };
    const auto isTail = [&](size_t i) { return byteAt(i) >= 0x80 && byteAt(i) <= 0xbf; };
    const unsigned first = byteAt(0);
    const unsigned second = byteAt(1);
    if (text.empty() || (first >= 0x80 && first < 0xc2) || first > 0xf4)
        return 0;
    if (first < 0x80)
        return 1;
    if (!isTail(1))
        return 0;
    if (first < 0xe0)
        return 2;
    // Rejects overlong encodings, surrogates, and code points above U+10FFFF.
    const bool outside = (first == 0xe0 && second < 0xa0) || (first == 0xed && second > 0x9f) ||
                         (first == 0xf0 && second < 0x90) || (first == 0xf4 && second > 0x8f);
    if (outside || !isTail(2))
        return 0;
    if (first < 0xf0)
        return 3;
    return isTail(3) ? 4 : 0;
}

char32_t takeCodePoint(std::string_view &text)
{
    constexpr char32_t kReplacement = 0xfffd;
    const size_t length = utf8Sequence(text);
    const auto first = static_cast<unsigned char>(text[0]);
    char32_t point = length == 0 ? kReplacement : length == 1 ? first : first & (0x7fu >> length);
    for (size_t i = 1; i < length; ++i)
        point = point << 6 | (static_cast<unsigned char>(text[i]) & 0x3fu);
    text.remove_prefix(length == 0 ? 1 : length);
    return point;
}

std::string printable(std::string text)
{
    std::string clean;
    clean.reserve(text.size());
    for (size_t i = 0; i < text.size(); ++i) {
        const auto byte = static_cast<unsigned char>(text[i]);
        const auto next = static_cast<unsigned char>(i + 1 < text.size() ? text[i + 1] : 0);
        const bool longControl = byte == 0xc2 && next >= 0x80 && next < 0xa0;
        clean += byte < 0x20 || byte == 0x7f || longControl ? '?' : text[i];
        i += longControl ? 1 : 0;
    }
    return clean;
}

std::string shownName(std::string_view name)
{
    constexpr size_t kMostBytes = 128;
    if (name.size() <= kMostBytes)
        return printable(std::string(name));
    size_t end = kMostBytes; // not inside of a character
    while (end > kMostBytes - 4 && (static_cast<unsigned char>(name[end]) & 0xc0) == 0x80)
        --end;
    return printable(std::string(name.substr(0, end))) + "...";
}

namespace
{

std::u32string codePoints(std::string_view text)
{
    std::u32string points;
    while (!text.empty())
        points += takeCodePoint(text);
    return points;
}

// A character, after the backslash if there is one.
char32_t takeCharacter(std::u32string_view &pattern)
{
    if (pattern[0] == U'\\' && pattern.size() > 1)
        pattern.remove_prefix(1);
    const char32_t character = pattern[0];
    pattern.remove_prefix(1);
    return character;
}

// `pattern` begins after the bracket, and loses the set. A bracket that none closes is a character.
bool matchesSet(char32_t character, std::u32string_view &pattern)
{
    std::u32string_view set = pattern;
    const bool inverted = !set.empty() && (set[0] == U'!' || set[0] == U'^');
    if (inverted)
        set.remove_prefix(1);
    bool found = false;
    for (bool first = true; !set.empty() && (first || set[0] != U']'); first = false) {
        const char32_t low = takeCharacter(set);
        char32_t high = low;
        if (set.size() > 1 && set[0] == U'-' && set[1] != U']') {
            set.remove_prefix(1);
            high = takeCharacter(set);
        }
        found = found || (low <= character && character <= high);
    }
    if (set.empty())
        return character == U'[';
    pattern = set.substr(1);
    return found != inverted;
}

// Matches a character against the beginning of the pattern, which is not *.
bool matchesOne(char32_t character, std::u32string_view &pattern)
{
    if (pattern[0] != U'?' && pattern[0] != U'[')
        return takeCharacter(pattern) == character;
    const bool any = pattern[0] == U'?';
    pattern.remove_prefix(1);
    return any || matchesSet(character, pattern);
}

} // namespace

bool matchesPattern(std::string_view name, std::string_view pattern)
{
    const std::u32string namePoints = codePoints(name);
    const std::u32string patternPoints = codePoints(pattern);
    std::u32string_view rest = namePoints;
    std::u32string_view ahead = patternPoints;
    // After the last *: the pattern, and where in the name it has been tried.
    std::u32string_view afterStar;
    std::u32string_view tried;
    bool star = false;
    while (!rest.empty() || !ahead.empty()) {
        if (!ahead.empty() && ahead[0] == U'*') {
            ahead.remove_prefix(1);
            star = true;
            afterStar = ahead;
            tried = rest;
            continue;
        }
        if (!rest.empty() && !ahead.empty() && matchesOne(rest[0], ahead)) {
            rest.remove_prefix(1);
            continue;
        }
        if (!star || tried.empty())
            return false;
        tried.remove_prefix(1);
        rest = tried;
        ahead = afterStar;
    }
    return true;
}

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
    char text[32];
    std::snprintf(text, sizeof text, "%.1f %%", 100 * share);
    return text;
}

std::string alignedRows(std::span<const std::vector<std::string>> rows, size_t left, std::string_view indent)
{
    std::vector<size_t> widths(rows.empty() ? 0 : rows.front().size());
    for (const std::vector<std::string> &row : rows)
        for (size_t i = 0; i < row.size(); ++i)
            widths[i] = std::max(widths[i], row[i].size());
    std::string text;
    for (const std::vector<std::string> &row : rows) {
        std::string line(indent);
        for (size_t i = 0; i < row.size(); ++i) {
            const std::string gap(widths[i] - row[i].size(), ' ');
            line += i == 0 ? "" : i < left ? " " : "  ";
            line += i < left ? row[i] + gap : gap + row[i];
        }
        text += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
    }
    return text;
}

std::string shellWord(const std::string &text)
{
    constexpr const char *kPlain = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+-./:=@_,%";
    if (!text.empty() && text.find_first_not_of(kPlain) == std::string::npos)
        return text;
    std::string word = "'";
    for (const char c : text)
        word += c == '\'' ? "'\\''" : std::string(1, c);
    return word + "'";
}

std::vector<std::string> partsOf(const std::string &list, char separator)
{
    std::vector<std::string> parts;
    for (size_t begin = 0; begin < list.size();) {
        const size_t end = std::min(list.find(separator, begin), list.size());
        if (end != begin)
            parts.push_back(list.substr(begin, end - begin));
        begin = end + 1;
    }
    return parts;
}

std::string base64Encoded(std::span<const uint8_t> bytes)
{
    std::string text;
    text.reserve((bytes.size() + 2) / 3 * 4);
    for (size_t i = 0; i < bytes.size(); i += 3) {
        uint32_t word = 0;
        for (size_t k = 0; k < 3; ++k)
            word = word << 8 | (i + k < bytes.size() ? bytes[i + k] : 0u);
        for (size_t k = 0; k < 4; ++k)
            text += i + k <= bytes.size() ? kBase64Alphabet[word >> (18 - 6 * k) & 63] : '=';
    }
    return text;
}

std::string markupText(std::string_view text)
{
    std::string result;
    while (!text.empty()) {
        const char32_t point = takeCodePoint(text);
        const bool excluded = (point < 0x20 && point != '\t' && point != '\n') || (point >= 0x7f && point < 0xa0) ||
                              (point & 0xfffe) == 0xfffe;
        if (point < 0x20 || point >= 0x7f ||
            std::string_view("\"<>&'").find(static_cast<char>(point)) != std::string_view::npos)
            // Parsers replace or reject references to control characters and noncharacters.
            result += "&#" + std::to_string(static_cast<uint32_t>(excluded ? 0xfffd : point)) + ";";
        else
            result += static_cast<char>(point);
    }
    return result;
}

std::string hexadecimal(uint64_t number)
{
    char text[19];
    std::snprintf(text, sizeof text, "0x%016llx", static_cast<unsigned long long>(number));
    return text;
}

std::string hexOf(std::span<const uint8_t> bytes)
{
    constexpr std::string_view kDigits = "0123456789abcdef";
    std::string text;
    text.reserve(2 * bytes.size());
    for (const uint8_t byte : bytes) {
        text += kDigits[byte >> 4];
        text += kDigits[byte & 15];
    }
    return text;
}

std::optional<uint64_t> parseHexadecimal(std::string_view text)
{
    if (!text.starts_with("0x"))
        return std::nullopt;
    uint64_t number = 0;
    const auto [end, error] = std::from_chars(text.data() + 2, text.data() + text.size(), number, 16);
    return error == std::errc() && end == text.data() + text.size() ? std::optional(number) : std::nullopt;
}

namespace
{

template <typename Real>
Real realOf(const char *text)
{
    return sizeof(Real) == sizeof(float) ? static_cast<Real>(std::strtof(text, nullptr))
                                         : static_cast<Real>(std::strtod(text, nullptr));
}

// Without a point: digits of a number below 1 begin after it, and those of an integer may need zeros.
std::string fixedText(const std::string &digits, int exponent, double number)
{
    const int count = static_cast<int>(digits.size());
    if (exponent < 0)
        return "0." + std::string(static_cast<size_t>(-exponent - 1), '0') + digits;
    if (exponent + 1 < count)
        return digits.substr(0, static_cast<size_t>(exponent) + 1) + "." +
               digits.substr(static_cast<size_t>(exponent) + 1);
    std::array<char, 400> exact{};
    std::snprintf(exact.data(), exact.size(), "%.0f", std::abs(number));
    return exact.data();
}

template <typename Real>
std::string shortest(Real number)
{
    if (number == 0)
        return std::signbit(number) ? "-0" : "0";
    constexpr int kMostDigits = 17;
    std::array<char, 40> text{};
    for (int digits = 1; digits <= kMostDigits; ++digits) {
        std::snprintf(text.data(), text.size(), "%.*e", digits - 1, static_cast<double>(number));
        if (realOf<Real>(text.data()) == number)
            break;
        // Powers of two are farther from the next number than from the one before: the next digit may do. After a 9 it
        // has fewer digits, which were tried.
        char &last = *(std::strchr(text.data(), 'e') - 1);
        if (last != '9' && (++last, realOf<Real>(text.data()) == number))
            break;
    }
    // -1.25e-07: a sign, digits, an exponent of two digits or more, as std::to_chars writes it. The point is that of
    // the program's locale.
    const std::string_view printed = text.data();
    const size_t e = printed.find('e');
    std::string digits;
    for (const char c : printed.substr(0, e))
        if (c >= '0' && c <= '9')
            digits += c;
    const std::string sign = number < 0 ? "-" : "";
    const std::string fixed = sign + fixedText(digits, std::atoi(text.data() + e + 1), static_cast<double>(number));
    const std::string scientific =
        sign + digits.substr(0, 1) + (digits.size() > 1 ? "." + digits.substr(1) : "") + std::string(printed.substr(e));
    return fixed.size() <= scientific.size() ? fixed : scientific;
}

template <typename Real>
std::string byLibrary(Real number)
{
#ifdef __cpp_lib_to_chars
    std::array<char, 32> digits{};
    const auto written = std::to_chars(digits.data(), digits.data() + digits.size(), number);
    return {digits.data(), written.ptr};
#else
    return shortest(number);
#endif
}

} // namespace

std::string plain::shortestText(double number)
{
    return shortest(number);
}

std::string plain::shortestText(float number)
{
    return shortest(number);
}

std::optional<double> plain::parseReal(std::string_view text)
{
    // strtod() also takes space, a plus, hexadecimal numbers and words.
    if (text.empty() || text.find_first_not_of("0123456789+-.eE") != std::string_view::npos || text[0] == '+')
        return std::nullopt;
    std::string terminated(text);
    if (const size_t point = text.find('.'); point != std::string_view::npos) // strtod() goes by the program's locale
        terminated.replace(point, 1, std::localeconv()->decimal_point);
    char *end = nullptr;
    const double value = std::strtod(terminated.c_str(), &end);
    if (end != terminated.c_str() + terminated.size() || std::isinf(value))
        return std::nullopt;
    return value;
}

std::string shortestText(double number)
{
    return byLibrary(number);
}

std::string shortestText(float number)
{
    return byLibrary(number);
}

std::optional<double> parseReal(std::string_view text)
{
#ifdef __cpp_lib_to_chars
    double value = 0;
    const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
    if (read.ec == std::errc::result_out_of_range) // too small or too large
        return plain::parseReal(text);
    return read.ec == std::errc() && read.ptr == text.data() + text.size() ? std::optional(value) : std::nullopt;
#else
    return plain::parseReal(text);
#endif
}

} // namespace vellum
