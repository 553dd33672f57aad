// SPDX-License-Identifier: Apache-2.0
#include "gltf/file/json_edit.h"

#include "base/json_writer.h"
#include "gltf/file/gltf_error.h"

namespace vellum
{

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
