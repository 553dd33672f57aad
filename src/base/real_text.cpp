// SPDX-License-Identifier: Apache-2.0
#include "base/real_text.h"

#include <array>
#include <charconv>
#include <clocale>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <version>

namespace vellum
{
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
