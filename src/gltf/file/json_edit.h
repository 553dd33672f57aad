// SPDX-License-Identifier: Apache-2.0
// Changes to a JSON text that leave every other byte of it as it is.
#pragma once

#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "gltf/file/json_tree.h"

namespace vellum
{

class JsonEdit
{
public:
    explicit JsonEdit(const JsonTree &tree) : tree_(tree) {}

    void replace(const JsonValue &value, std::string text);
    // A new last element of an array.
    void append(const JsonValue &array, std::string text);
    // A member of an object: its value is replaced, or it becomes the last one. Throws GltfError where there are
    // several of that name.
    void set(const JsonValue &object, std::string_view name, const std::string &text);
    // Elements of an array that are this string, or the members of an object that have this name.
    void remove(const JsonValue &container, std::string_view name);

    // The changed text, up to the end of the root. Of a value that is replaced twice the first one counts, and of
    // values in one another the outer one; where a container is removed, what is in it must not be changed.
    [[nodiscard]] std::string apply() const;

private:
    struct Changes {
        JsonValue container;
        std::vector<std::string> appended;
        std::set<size_t> removed; // where the element, or the member's name, begins
    };
    // Instead of the bytes from `begin` to `end`.
    struct Splice {
        size_t end;
        std::string text;
    };
    Changes &changesOf(const JsonValue &container);
    static void spliceContainer(const Changes &changes, std::multimap<size_t, Splice> &splices);

    const JsonTree &tree_;
    std::map<size_t, Changes> changes_; // by where the container begins
    std::multimap<size_t, Splice> replaced_;
};

} // namespace vellum
