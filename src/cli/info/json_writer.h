// JSON text, written from front to back.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace vellum::cli
{

// What is begun must be ended, and a member of an object needs a key. Strings may hold anything: what is no UTF-8
// becomes U+FFFD.
class JsonWriter
{
public:
    JsonWriter &beginObject();
    JsonWriter &beginArray();
    JsonWriter &end(); // of the innermost object or array
    JsonWriter &key(std::string_view name);
    JsonWriter &value(std::string_view text);
    JsonWriter &value(const char *text) { return value(std::string_view(text)); }
    JsonWriter &value(std::uint64_t number);
    JsonWriter &value(bool boolean);
    template <typename Value>
    JsonWriter &member(std::string_view name, const Value &content)
    {
        return key(name).value(content);
    }

    [[nodiscard]] const std::string &text() const { return m_text; }

private:
    void separate(); // from what is before it, on a line of its own
    JsonWriter &begin(char opening, char closing);

    std::string m_text;
    std::string m_open; // the closing brackets of what is open
    bool m_first = true;
    bool m_afterKey = false;
};

} // namespace vellum::cli
