// SPDX-License-Identifier: Apache-2.0
// JSON with the place of everything in the text, so that parts can be replaced and the rest stays byte for byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace vellum
{

class JsonValue;

class JsonTree
{
public:
    // Parses `text`, which must outlive the tree. A byte order mark in front and anything behind the value (the padding
    // of a GLB's chunk) are left alone. Nesting must be bounded (findContainer sees to that). Throws GltfError.
    explicit JsonTree(std::string_view text);

    [[nodiscard]] std::string_view text() const { return text_; }
    [[nodiscard]] JsonValue root() const;

    // Throws GltfError where an object has two members of one name (glTF 2.0, 2.6, "JSON Encoding").
    void checkNames() const;

private:
    friend class JsonValue;
    friend struct JsonEvents;
    enum class Kind : uint8_t { Scalar, String, Array, Object };
    // In the order of the text. In an object a name, which is a string, is followed by its value.
    struct Node {
        uint32_t begin = 0;
        uint32_t end = 0;  // behind the last byte
        uint32_t next = 0; // the node behind this one and all that is in it
        Kind kind = Kind::Scalar;
    };

    void sortNames(uint32_t object, size_t count);

    std::string_view text_;
    std::vector<Node> nodes_;
    // Of objects with many members: their names in order, and the nodes of these. Without it, looking something up in
    // such an object again and again would take quadratic time.
    std::map<uint32_t, std::vector<std::pair<std::string, uint32_t>>> sorted_;
};

// A value in a tree, or nothing: what is looked for in nothing is nothing. Valid as long as its tree.
class JsonValue
{
public:
    JsonValue() = default;

    [[nodiscard]] bool exists() const { return tree_ != nullptr; }
    [[nodiscard]] bool isArray() const { return exists() && node().kind == JsonTree::Kind::Array; }
    [[nodiscard]] bool isObject() const { return exists() && node().kind == JsonTree::Kind::Object; }

    // The range of its text.
    [[nodiscard]] size_t begin() const { return node().begin; }
    [[nodiscard]] size_t end() const { return node().end; }
    [[nodiscard]] std::string_view text() const { return tree_->text_.substr(begin(), end() - begin()); }

    // A member of an object; the last one where there are several of that name.
    [[nodiscard]] JsonValue operator[](std::string_view name) const;
    // The number of members of an object with that name.
    [[nodiscard]] size_t count(std::string_view name) const;
    // The elements of an array, or the values of an object's members; empty for anything else.
    [[nodiscard]] std::vector<JsonValue> children() const;

    // The names, which are strings, and values of an object's members; empty for anything else.
    [[nodiscard]] std::vector<std::pair<JsonValue, JsonValue>> members() const;

    // A number without a fraction that 64 bits hold.
    [[nodiscard]] std::optional<int64_t> integer() const;
    [[nodiscard]] std::optional<double> number() const;
    [[nodiscard]] std::optional<std::string> string() const;
    [[nodiscard]] bool isTrue() const { return exists() && text() == "true"; }

private:
    friend class JsonTree;
    JsonValue(const JsonTree &tree, uint32_t index) : tree_(&tree), index_(index) {}
    [[nodiscard]] const JsonTree::Node &node() const { return tree_->nodes_[index_]; }
    [[nodiscard]] bool is(std::string_view name) const;

    const JsonTree *tree_ = nullptr;
    uint32_t index_ = 0;
};

// Changes to a JSON text that leave every other byte of it as it is.
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
