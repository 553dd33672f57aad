// SPDX-License-Identifier: Apache-2.0
// JSON text, written from front to back.
#pragma once

#include <concepts>
#include <cstdint>
#include <string>
#include <string_view>

namespace vellum
{

enum class JsonStyle : uint8_t {
    Lines,   // indented, an element a line
    Compact, // in one line without spaces
    Html,    // like Compact, with ASCII characters only, and none that has a meaning in HTML
};

// A text in quotes. What is not UTF-8 becomes U+FFFD.
std::string quotedJson(std::string_view text, JsonStyle style = JsonStyle::Compact);

// Writes JSON. Every begin needs its end, and a member of an object needs a key.
class JsonWriter
{
public:
    explicit JsonWriter(JsonStyle style = JsonStyle::Lines) : style_(style) {}

    JsonWriter &beginObject() { return begin('{', '}'); }
    JsonWriter &beginArray() { return begin('[', ']'); }
    JsonWriter &end(); // of the innermost object or array
    JsonWriter &key(std::string_view name);
    JsonWriter &value(std::string_view text) { return json(quotedJson(text, style_)); }
    JsonWriter &value(const char *text) { return value(std::string_view(text)); }
    JsonWriter &value(const std::string &text) { return value(std::string_view(text)); }
    JsonWriter &value(bool boolean) { return json(boolean ? "true" : "false"); }
    JsonWriter &value(std::integral auto number) { return json(std::to_string(number)); }
    // null for what is not finite.
    JsonWriter &value(std::floating_point auto number) { return real(static_cast<double>(number), sizeof number == 4); }
    JsonWriter &null() { return json("null"); }
    // A value that is JSON already.
    JsonWriter &json(std::string_view text);

    template <typename Value>
    JsonWriter &member(std::string_view name, const Value &content)
    {
        return key(name).value(content);
    }
    // An array of what add(element) writes.
    template <typename List, typename Add>
    JsonWriter &list(std::string_view name, const List &elements, Add &&add)
    {
        key(name).beginArray();
        for (const auto &element : elements)
            add(element);
        return end();
    }
    template <typename List>
    JsonWriter &values(std::string_view name, const List &elements)
    {
        return list(name, elements, [this](const auto &element) { this->value(element); });
    }

    [[nodiscard]] const std::string &text() const { return text_; }

private:
    void separate(); // from what is before it
    void startLine();
    JsonWriter &begin(char opening, char closing);
    JsonWriter &real(double number, bool single);

    JsonStyle style_;
    std::string text_;
    std::string open_; // the closing brackets of what is open
    bool first_ = true;
    bool afterKey_ = false;
};

} // namespace vellum
