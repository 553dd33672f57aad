#include "cli/inspect/encoding.h"

#include <fmt/format.h>
#include <zlib.h>

#include "cli/base/error.h"

namespace vellum::cli
{
namespace
{

constexpr char32_t kReplacement = 0xfffd;

// The code point at the front of `text`, which loses it.
char32_t takeCodePoint(std::string_view &text)
{
    const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
    const std::uint8_t first = byte(0);
    std::size_t length = 1;
    char32_t point = first;
    char32_t least = 0;
    if (first >= 0xf0 && first < 0xf8) {
        length = 4;
        point = first & 0x07u;
        least = 0x10000;
    } else if (first >= 0xe0 && first < 0xf0) {
        length = 3;
        point = first & 0x0fu;
        least = 0x800;
    } else if (first >= 0xc0 && first < 0xe0) {
        length = 2;
        point = first & 0x1fu;
        least = 0x80;
    } else if (first >= 0x80) {
        point = kReplacement;
    }
    bool good = length <= text.size();
    for (std::size_t i = 1; good && i < length; ++i) {
        good = (byte(i) & 0xc0u) == 0x80;
        point = (point << 6) | (byte(i) & 0x3fu);
    }
    if (!good || point < least || point > 0x10ffff || (point >= 0xd800 && point < 0xe000)) {
        text.remove_prefix(1);
        return kReplacement;
    }
    text.remove_prefix(length);
    return point;
}

void appendEscape(std::string &to, char32_t unit)
{
    to += fmt::format("\\u{:04x}", static_cast<std::uint32_t>(unit));
}

} // namespace

std::string base64(std::span<const std::uint8_t> bytes)
{
    constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    text.reserve((bytes.size() + 2) / 3 * 4);
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        std::uint32_t three = 0;
        for (std::size_t k = 0; k < 3; ++k)
            three = (three << 8) | (i + k < bytes.size() ? bytes[i + k] : 0u);
        for (std::size_t k = 0; k < 4; ++k)
            text += i + k > bytes.size() ? '=' : kDigits[(three >> (18 - 6 * k)) & 63];
    }
    return text;
}

std::vector<std::uint8_t> deflated(std::span<const std::uint8_t> bytes)
{
    uLongf size = compressBound(static_cast<uLong>(bytes.size()));
    std::vector<std::uint8_t> result(size);
    if (compress2(result.data(), &size, bytes.data(), static_cast<uLong>(bytes.size()), 6) != Z_OK)
        throw Error("the data of the page cannot be compressed");
    result.resize(size);
    return result;
}

std::string jsonString(std::string_view text)
{
    std::string result = "\"";
    while (!text.empty()) {
        const char32_t point = takeCodePoint(text);
        if (point >= 0x10000) {
            appendEscape(result, 0xd800 + ((point - 0x10000) >> 10));
            appendEscape(result, 0xdc00 + ((point - 0x10000) & 0x3ff));
        } else if (point < 0x20 || point >= 0x7f ||
                   std::string_view("\"\\<>&'").find(static_cast<char>(point)) != std::string_view::npos) {
            appendEscape(result, point);
        } else {
            result += static_cast<char>(point);
        }
    }
    return result + '"';
}

std::string htmlText(std::string_view text)
{
    std::string result;
    while (!text.empty()) {
        const char32_t point = takeCodePoint(text);
        if (point < 0x20 || point >= 0x7f ||
            std::string_view("\"<>&'").find(static_cast<char>(point)) != std::string_view::npos)
            // No control characters: a parser takes these references for others or for errors.
            result += fmt::format("&#{};", static_cast<std::uint32_t>(
                                               point < 0x20 || (point >= 0x7f && point < 0xa0) ? kReplacement : point));
        else
            result += static_cast<char>(point);
    }
    return result;
}

} // namespace vellum::cli
