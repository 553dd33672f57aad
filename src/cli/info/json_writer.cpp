#include "cli/info/json_writer.h"

#include <cstdio>

namespace vellum::cli
{
namespace
{

// Bytes of the UTF-8 sequence that `text` begins with; 0 where it begins with none (RFC 3629, 4).
std::size_t sequenceAt(std::string_view text)
{
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
    const unsigned char first = byte(0);
    const std::size_t length = first < 0x80   ? 1
                               : first < 0xc2 ? 0
                               : first < 0xe0 ? 2
                               : first < 0xf0 ? 3
                               : first < 0xf5 ? 4
                                              : 0;
    if (length > text.size())
        return 0;
    for (std::size_t i = 1; i < length; ++i)
        if ((byte(i) & 0xc0) != 0x80)
            return 0;
    if ((first == 0xe0 && byte(1) < 0xa0) || (first == 0xed && byte(1) > 0x9f) || (first == 0xf0 && byte(1) < 0x90) ||
        (first == 0xf4 && byte(1) > 0x8f))
        return 0;
    return length;
}

} // namespace

void JsonWriter::separate()
{
    if (!m_afterKey && !m_open.empty()) {
        m_text += m_first ? "\n" : ",\n";
        m_text.append(2 * m_open.size(), ' ');
    }
    m_first = false;
    m_afterKey = false;
}

JsonWriter &JsonWriter::begin(char opening, char closing)
{
    separate();
    m_text += opening;
    m_open += closing;
    m_first = true;
    return *this;
}

JsonWriter &JsonWriter::beginObject()
{
    return begin('{', '}');
}

JsonWriter &JsonWriter::beginArray()
{
    return begin('[', ']');
}

JsonWriter &JsonWriter::end()
{
    const char closing = m_open.back();
    m_open.pop_back();
    if (!m_first) {
        m_text += '\n';
        m_text.append(2 * m_open.size(), ' ');
    }
    m_text += closing;
    m_first = false;
    return *this;
}

JsonWriter &JsonWriter::key(std::string_view name)
{
    value(name);
    m_text += ": ";
    m_afterKey = true;
    return *this;
}

JsonWriter &JsonWriter::value(std::string_view text)
{
    separate();
    m_text += '"';
    while (!text.empty()) {
        const std::size_t length = sequenceAt(text);
        const auto first = static_cast<unsigned char>(text.front());
        if (length == 0) {
            m_text += "\\ufffd";
        } else if (first == '"' || first == '\\') {
            m_text += '\\';
            m_text += text.front();
        } else if (first < 0x20 || first == 0x7f) {
            char escaped[7];
            std::snprintf(escaped, sizeof escaped, "\\u%04x", first);
            m_text += escaped;
        } else {
            m_text += text.substr(0, length);
        }
        text.remove_prefix(length == 0 ? 1 : length);
    }
    m_text += '"';
    return *this;
}

JsonWriter &JsonWriter::value(std::uint64_t number)
{
    separate();
    m_text += std::to_string(number);
    return *this;
}

JsonWriter &JsonWriter::value(bool boolean)
{
    separate();
    m_text += boolean ? "true" : "false";
    return *this;
}

} // namespace vellum::cli
