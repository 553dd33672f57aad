// SPDX-License-Identifier: Apache-2.0
#include "gltf/file/json_tree.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <new>
#include <rapidjson/error/en.h>
#include <rapidjson/memorystream.h>
#include <rapidjson/reader.h>

#include "base/json_writer.h"
#include "base/text.h"
#include "gltf/file/gltf_error.h"

namespace vellum
{
namespace
{

constexpr rapidjson::SizeType kMostUnsorted = 32;
constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";

// Where memory runs out, RapidJSON's own allocator returns null, which is then written to. This one throws.
struct Allocator {
    static void *Malloc(size_t size) { return ::operator new(size); }
    static void *Realloc(void *old, size_t oldSize, size_t size)
    {
        void *moved = Malloc(size);
        if (old != nullptr)
            std::memcpy(moved, old, std::min(oldSize, size));
        Free(old);
        return moved;
    }
    static void Free(void *memory) { ::operator delete(memory); }
};
using Reader = rapidjson::GenericReader<rapidjson::UTF8<>, rapidjson::UTF8<>, Allocator>;

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

// The parser calls these functions at the end of what they are named for, except the two that start.
struct JsonEvents : rapidjson::BaseReaderHandler<rapidjson::UTF8<>, JsonEvents> {
    JsonEvents(JsonTree &toFill, const rapidjson::MemoryStream &from) : tree(toFill), stream(from) {}

    [[nodiscard]] uint32_t here() const { return static_cast<uint32_t>(stream.Tell()); }

    bool scalar(JsonTree::Kind kind, uint32_t end)
    {
        const auto next = static_cast<uint32_t>(tree.nodes_.size() + 1);
        tree.nodes_.push_back({firstAfter(last), end, next, kind});
        last = end;
        return true;
    }
    bool start(JsonTree::Kind kind)
    {
        open.push_back(static_cast<uint32_t>(tree.nodes_.size()));
        const uint32_t begin = firstAfter(last);
        tree.nodes_.push_back({begin, 0, 0, kind});
        last = begin + 1;
        return true;
    }
    bool finish()
    {
        JsonTree::Node &node = tree.nodes_[open.back()];
        open.pop_back();
        node.end = last = here();
        node.next = static_cast<uint32_t>(tree.nodes_.size());
        return true;
    }
    // The beginning of the next value.
    [[nodiscard]] uint32_t firstAfter(uint32_t place) const
    {
        return static_cast<uint32_t>(tree.text_.find_first_not_of(" \t\r\n,:", place));
    }

    bool Default() { return scalar(JsonTree::Kind::Scalar, here()); }
    bool RawNumber(const char *, rapidjson::SizeType length, bool)
    {
        return scalar(JsonTree::Kind::Scalar, firstAfter(last) + length);
    }
    bool String(const char *, rapidjson::SizeType, bool) { return scalar(JsonTree::Kind::String, here()); }
    bool Key(const char *, rapidjson::SizeType, bool) { return scalar(JsonTree::Kind::String, here()); }
    bool StartObject() { return start(JsonTree::Kind::Object); }
    bool EndObject(rapidjson::SizeType count)
    {
        const uint32_t object = open.back();
        finish();
        if (count > kMostUnsorted)
            tree.sortNames(object, count);
        return true;
    }
    bool StartArray() { return start(JsonTree::Kind::Array); }
    bool EndArray(rapidjson::SizeType) { return finish(); }

    JsonTree &tree;
    const rapidjson::MemoryStream &stream;
    uint32_t last = 0; // the end of what was read
    std::vector<uint32_t> open;
};

JsonTree::JsonTree(std::string_view text) : text_(text)
{
    rapidjson::MemoryStream stream(text.data(), text.size());
    JsonEvents events(*this, stream);
    if (text.starts_with(kByteOrderMark)) {
        events.last = kByteOrderMark.size();
        for (size_t i = 0; i < kByteOrderMark.size(); ++i)
            stream.Take();
    }
    Reader reader;
    constexpr unsigned kFlags = rapidjson::kParseNumbersAsStringsFlag | rapidjson::kParseStopWhenDoneFlag;
    if (const rapidjson::ParseResult result = reader.Parse<kFlags>(stream, events); !result)
        throw GltfError("the JSON is wrong at byte " + std::to_string(result.Offset()) + ": " +
                        rapidjson::GetParseError_En(result.Code()));
}

void JsonTree::sortNames(uint32_t object, size_t count)
{
    std::vector<std::pair<std::string, uint32_t>> &names = sorted_[object];
    names.reserve(count);
    for (uint32_t i = object + 1; i < nodes_[object].next; i = nodes_[i + 1].next)
        names.emplace_back(JsonValue(*this, i).string().value_or(""), i);
    std::sort(names.begin(), names.end());
}

JsonValue JsonTree::root() const
{
    return {*this, 0};
}

JsonValue JsonValue::operator[](std::string_view name) const
{
    if (!isObject())
        return {};
    if (const auto sorted = tree_->sorted_.find(index_); sorted != tree_->sorted_.end()) {
        const auto &names = sorted->second;
        const auto behind =
            std::upper_bound(names.begin(), names.end(), name,
                             [](std::string_view wanted, const auto &other) { return wanted < other.first; });
        return behind != names.begin() && (behind - 1)->first == name ? JsonValue(*tree_, (behind - 1)->second + 1)
                                                                      : JsonValue();
    }
    JsonValue found;
    for (uint32_t i = index_ + 1; i < node().next; i = tree_->nodes_[i + 1].next)
        if (JsonValue(*tree_, i).is(name))
            found = {*tree_, i + 1};
    return found;
}

size_t JsonValue::count(std::string_view name) const
{
    size_t count = 0;
    for (uint32_t i = index_ + 1; isObject() && i < node().next; i = tree_->nodes_[i + 1].next)
        count += JsonValue(*tree_, i).is(name) ? 1u : 0u;
    return count;
}

// Does not copy the text if it has no escapes.
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
    for (uint32_t i = index_ + 1; i < node().next; i = tree_->nodes_[i].next) {
        if (isObject())
            ++i;
        values.push_back({*tree_, i});
    }
    return values;
}

std::vector<std::pair<JsonValue, JsonValue>> JsonValue::members() const
{
    std::vector<std::pair<JsonValue, JsonValue>> members;
    for (uint32_t i = index_ + 1; isObject() && i < node().next; i = tree_->nodes_[i + 1].next)
        members.push_back({JsonValue(*tree_, i), JsonValue(*tree_, i + 1)});
    return members;
}

void JsonTree::checkNames() const
{
    std::vector<std::string> names;
    for (uint32_t object = 0; object < nodes_.size(); ++object) {
        if (nodes_[object].kind != Kind::Object || nodes_[object].next <= object + 3)
            continue;
        names.clear();
        for (uint32_t i = object + 1; i < nodes_[object].next; i = nodes_[i + 1].next)
            names.push_back(JsonValue(*this, i).string().value_or(""));
        std::sort(names.begin(), names.end());
        if (const auto twice = std::adjacent_find(names.begin(), names.end()); twice != names.end())
            throw GltfError("the JSON has an object with two members \"" + *twice + "\"");
    }
}

std::optional<int64_t> JsonValue::integer() const
{
    if (!exists() || node().kind != JsonTree::Kind::Scalar)
        return std::nullopt;
    if (const auto whole = parseNumber<int64_t>(text()))
        return whole;
    // 2.0 and 2e3 are integers as well.
    const auto real = number();
    if (!real || *real != std::floor(*real) || std::abs(*real) > 9e15)
        return std::nullopt;
    return static_cast<int64_t>(*real);
}

std::optional<double> JsonValue::number() const
{
    if (!exists() || node().kind != JsonTree::Kind::Scalar)
        return std::nullopt;
    return parseReal(text());
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
    Reader().Parse(stream, events);
    return events.value;
}

JsonEdit::Changes &JsonEdit::changesOf(const JsonValue &container)
{
    Changes &changes = changes_[container.begin()];
    changes.container = container;
    return changes;
}

void JsonEdit::replace(const JsonValue &value, std::string text)
{
    replaced_.insert({value.begin(), {value.end(), std::move(text)}});
}

void JsonEdit::append(const JsonValue &array, std::string text)
{
    changesOf(array).appended.push_back(std::move(text));
}

void JsonEdit::set(const JsonValue &object, std::string_view name, const std::string &text)
{
    const size_t count = object.count(name);
    if (count > 1)
        throw GltfError("an object of the JSON has " + std::to_string(count) + " members named " + quotedJson(name));
    if (count == 1)
        replace(object[name], text);
    else
        append(object, quotedJson(name) + ":" + text);
}

void JsonEdit::remove(const JsonValue &container, std::string_view name)
{
    for (const auto &[key, value] : container.members())
        if (key.string() == name)
            changesOf(container).removed.insert(key.begin());
    for (const JsonValue &element : container.children())
        if (container.isArray() && element.string() == name)
            changesOf(container).removed.insert(element.begin());
}

void JsonEdit::spliceContainer(const Changes &changes, std::multimap<size_t, Splice> &splices)
{
    const JsonValue &container = changes.container;
    std::vector<std::pair<size_t, size_t>> children; // from their name on
    for (const auto &[key, value] : container.members())
        children.emplace_back(key.begin(), value.end());
    if (container.isArray())
        for (const JsonValue &element : container.children())
            children.emplace_back(element.begin(), element.end());
    constexpr size_t kNone = ~size_t{0};
    size_t lastKept = container.begin() + 1; // the end of it
    bool anyKept = false;
    size_t removing = kNone; // the beginning of the first of those that are removed in a row
    for (const auto &[begin, end] : children) {
        if (changes.removed.contains(begin)) {
            removing = removing == kNone ? begin : removing;
            continue;
        }
        if (removing != kNone)
            splices.insert({removing, {begin, ""}});
        removing = kNone;
        lastKept = end;
        anyKept = true;
    }
    std::string text;
    for (const std::string &added : changes.appended) {
        text += anyKept ? "," : "";
        text += added;
        anyKept = true;
    }
    splices.insert({lastKept, {removing != kNone ? children.back().second : lastKept, text}});
}

std::string JsonEdit::apply() const
{
    std::multimap<size_t, Splice> splices = replaced_;
    for (const auto &[begin, changes] : changes_)
        spliceContainer(changes, splices);
    const std::string_view text = tree_.text();
    std::string result;
    size_t done = 0;
    for (const auto &[begin, splice] : splices) {
        if (begin < done) // inside of what is replaced, or replaced again
            continue;
        result += text.substr(done, begin - done);
        result += splice.text;
        done = splice.end;
    }
    const size_t end = tree_.root().end();
    result += text.substr(done, end - done);
    return result;
}

} // namespace vellum
