#include "gltf/file/json_tree.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <rapidjson/error/en.h>
#include <rapidjson/memorystream.h>
#include <rapidjson/reader.h>

#include "gltf/file/gltf_error.h"

namespace vellum
{
namespace
{

constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";

// Takes one string.
struct StringEvents : rapidjson::BaseReaderHandler<rapidjson::UTF8<>, StringEvents> {
    std::string value;
    bool String(const char *text, rapidjson::SizeType length, bool)
    {
        value.assign(text, length);
        return true;
    }
};

} // namespace

// The parser calls these functions at the end of what they are named for, but for the two that start.
struct JsonEvents : rapidjson::BaseReaderHandler<rapidjson::UTF8<>, JsonEvents> {
    JsonEvents(JsonTree &toFill, const rapidjson::MemoryStream &from) : tree(toFill), stream(from) {}

    [[nodiscard]] std::uint32_t here() const { return static_cast<std::uint32_t>(stream.Tell()); }

    bool scalar(JsonTree::Kind kind, std::uint32_t end)
    {
        const auto next = static_cast<std::uint32_t>(tree.m_nodes.size() + 1);
        tree.m_nodes.push_back({firstAfter(last), end, next, kind});
        last = end;
        return true;
    }
    bool start(JsonTree::Kind kind)
    {
        open.push_back(tree.m_nodes.size());
        const std::uint32_t begin = firstAfter(last);
        tree.m_nodes.push_back({begin, 0, 0, kind});
        last = begin + 1;
        return true;
    }
    bool finish()
    {
        JsonTree::Node &node = tree.m_nodes[open.back()];
        open.pop_back();
        node.end = last = here();
        node.next = static_cast<std::uint32_t>(tree.m_nodes.size());
        return true;
    }
    // Where the next value begins.
    [[nodiscard]] std::uint32_t firstAfter(std::uint32_t place) const
    {
        return static_cast<std::uint32_t>(tree.m_text.find_first_not_of(" \t\r\n,:", place));
    }

    bool Default() { return scalar(JsonTree::Kind::Scalar, here()); }
    bool RawNumber(const char *, rapidjson::SizeType length, bool)
    {
        return scalar(JsonTree::Kind::Scalar, firstAfter(last) + length);
    }
    bool String(const char *, rapidjson::SizeType, bool) { return scalar(JsonTree::Kind::String, here()); }
    bool Key(const char *, rapidjson::SizeType, bool) { return scalar(JsonTree::Kind::String, here()); }
    bool StartObject() { return start(JsonTree::Kind::Object); }
    bool EndObject(rapidjson::SizeType) { return finish(); }
    bool StartArray() { return start(JsonTree::Kind::Array); }
    bool EndArray(rapidjson::SizeType) { return finish(); }

    JsonTree &tree;
    const rapidjson::MemoryStream &stream;
    std::uint32_t last = 0; // the end of what was read
    std::vector<std::size_t> open;
};

JsonTree::JsonTree(std::string_view text) : m_text(text)
{
    rapidjson::MemoryStream stream(text.data(), text.size());
    JsonEvents events(*this, stream);
    if (text.starts_with(kByteOrderMark)) {
        events.last = kByteOrderMark.size();
        for (std::size_t i = 0; i < kByteOrderMark.size(); ++i)
            stream.Take();
    }
    rapidjson::Reader reader;
    constexpr unsigned kFlags = rapidjson::kParseNumbersAsStringsFlag | rapidjson::kParseStopWhenDoneFlag;
    if (const rapidjson::ParseResult result = reader.Parse<kFlags>(stream, events); !result)
        throw GltfError("the JSON is wrong at byte " + std::to_string(result.Offset()) + ": " +
                        rapidjson::GetParseError_En(result.Code()));
}

JsonValue JsonTree::root() const
{
    return {*this, 0};
}

JsonValue JsonValue::operator[](std::string_view name) const
{
    JsonValue found;
    for (std::uint32_t i = m_index + 1; isObject() && i < node().next; i = m_tree->m_nodes[i + 1].next)
        if (JsonValue(*m_tree, i).is(name))
            found = {*m_tree, i + 1};
    return found;
}

std::size_t JsonValue::count(std::string_view name) const
{
    std::size_t count = 0;
    for (std::uint32_t i = m_index + 1; isObject() && i < node().next; i = m_tree->m_nodes[i + 1].next)
        count += JsonValue(*m_tree, i).is(name) ? 1u : 0u;
    return count;
}

// Without a copy of the text where it has no escapes.
bool JsonValue::is(std::string_view name) const
{
    const std::string_view quoted = text();
    if (quoted.find('\\') != std::string_view::npos)
        return string() == name;
    return quoted.substr(1, quoted.size() - 2) == name;
}

std::vector<JsonValue> JsonValue::children() const
{
    std::vector<JsonValue> values;
    if (!isArray() && !isObject())
        return values;
    for (std::uint32_t i = m_index + 1; i < node().next; i = m_tree->m_nodes[i].next) {
        if (isObject())
            ++i;
        values.push_back({*m_tree, i});
    }
    return values;
}

std::vector<std::pair<JsonValue, JsonValue>> JsonValue::members() const
{
    std::vector<std::pair<JsonValue, JsonValue>> members;
    for (std::uint32_t i = m_index + 1; isObject() && i < node().next; i = m_tree->m_nodes[i + 1].next)
        members.push_back({JsonValue(*m_tree, i), JsonValue(*m_tree, i + 1)});
    return members;
}

void JsonTree::checkNames() const
{
    std::vector<std::string> names;
    for (std::uint32_t object = 0; object < m_nodes.size(); ++object) {
        if (m_nodes[object].kind != Kind::Object || m_nodes[object].next <= object + 3)
            continue;
        names.clear();
        for (std::uint32_t i = object + 1; i < m_nodes[object].next; i = m_nodes[i + 1].next)
            names.push_back(JsonValue(*this, i).string().value_or(""));
        std::sort(names.begin(), names.end());
        if (const auto twice = std::adjacent_find(names.begin(), names.end()); twice != names.end())
            throw GltfError("the JSON has an object with two members \"" + *twice + "\"");
    }
}

std::optional<std::int64_t> JsonValue::integer() const
{
    if (!exists() || node().kind != JsonTree::Kind::Scalar)
        return std::nullopt;
    const std::string_view digits = text();
    const char *last = digits.data() + digits.size();
    std::int64_t value = 0;
    if (const auto read = std::from_chars(digits.data(), last, value); read.ec == std::errc() && read.ptr == last)
        return value;
    // 2.0 and 2e3 are integers, too.
    const auto real = number();
    if (!real || *real != std::floor(*real) || std::abs(*real) > 9e15)
        return std::nullopt;
    return static_cast<std::int64_t>(*real);
}

std::optional<double> JsonValue::number() const
{
    if (!exists() || node().kind != JsonTree::Kind::Scalar)
        return std::nullopt;
    const std::string_view digits = text();
    const char *last = digits.data() + digits.size();
    double value = 0;
    const auto read = std::from_chars(digits.data(), last, value);
    return read.ec == std::errc() && read.ptr == last ? std::optional(value) : std::nullopt;
}

std::optional<std::string> JsonValue::string() const
{
    if (!exists() || node().kind != JsonTree::Kind::String)
        return std::nullopt;
    const std::string_view quoted = text();
    if (quoted.find('\\') == std::string_view::npos)
        return std::string(quoted.substr(1, quoted.size() - 2));
    rapidjson::MemoryStream stream(quoted.data(), quoted.size());
    StringEvents events;
    rapidjson::Reader().Parse(stream, events);
    return events.value;
}

} // namespace vellum
