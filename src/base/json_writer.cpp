// SPDX-License-Identifier: Apache-2.0
#include "base/json_writer.h"

#include <array>
#include <cmath>
#include <cstdio>

#include "base/text.h"

namespace vellum
{
namespace
{

void appendEscape(std::string &to, char32_t unit)
{
    std::array<char, 7> escape{};
    std::snprintf(escape.data(), escape.size(), "\\u%04x", static_cast<unsigned>(unit & 0xffff));
    to += escape.data();
}

void appendForHtml(std::string &to, char32_t point)
{
    constexpr std::string_view kSpecial = "\"\\<>&'";
    const bool plain = point >= 0x20 && point < 0x7f && kSpecial.find(static_cast<char>(point)) == kSpecial.npos;
    if (plain) {
        to += static_cast<char>(point);
    } else if (point < 0x10000) {
        appendEscape(to, point);
    } else {
        appendEscape(to, 0xd800 + ((point - 0x10000) >> 10));
        appendEscape(to, 0xdc00 + ((point - 0x10000) & 0x3ff));
    }
}

} // namespace

std::string quotedJson(std::string_view text, JsonStyle style)
{
    std::string quoted = "\"";
    while (!text.empty()) {
        const std::string_view rest = text;
        const char32_t point = takeCodePoint(text);
        if (style == JsonStyle::Html) {
            appendForHtml(quoted, point);
        } else if (point == U'"' || point == U'\\') {
            quoted += {'\\', static_cast<char>(point)};
        } else if (point < 0x20 || point == 0x7f) {
            appendEscape(quoted, point);
        } else if (utf8Sequence(rest) == 0) {
            quoted += "\xef\xbf\xbd";
        } else {
            quoted += rest.substr(0, rest.size() - text.size());
        }
    }
    return quoted + '"';
}

void JsonWriter::startLine()
{
    if (style_ != JsonStyle::Lines)
        return;
    text_ += '\n';
    text_.append(2 * open_.size(), ' ');
}

void JsonWriter::separate()
{
    if (!afterKey_ && !open_.empty()) {
        text_ += first_ ? "" : ",";
        startLine();
    }
    first_ = false;
    afterKey_ = false;
}

JsonWriter &JsonWriter::begin(char opening, char closing)
{
    separate();
    text_ += opening;
    open_ += closing;
    first_ = true;
    return *this;
}

JsonWriter &JsonWriter::end()
{
    const char closing = open_.back();
    open_.pop_back();
    if (!first_)
        startLine();
    text_ += closing;
    first_ = false;
    return *this;
}

JsonWriter &JsonWriter::key(std::string_view name)
{
    value(name);
    text_ += style_ == JsonStyle::Lines ? ": " : ":";
    afterKey_ = true;
    return *this;
}

JsonWriter &JsonWriter::json(std::string_view text)
{
    separate();
    text_ += text;
    return *this;
}

JsonWriter &JsonWriter::real(double number, bool single)
{
    if (!std::isfinite(number))
        return null();
    return json(single ? shortestText(static_cast<float>(number)) : shortestText(number));
}

} // namespace vellum
