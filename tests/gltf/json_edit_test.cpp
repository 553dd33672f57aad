// SPDX-License-Identifier: Apache-2.0
#include "gltf/file/json_tree.h"

#include <gtest/gtest.h>

#include "gltf/file/gltf_error.h"

using namespace vellum;

namespace
{

template <typename Change>
std::string edited(const std::string &text, Change &&change)
{
    const JsonTree tree(text);
    JsonEdit edit(tree);
    change(edit, tree.root());
    return edit.apply();
}

} // namespace

TEST(JsonEdit, NoChangesKeepTheText)
{
    EXPECT_EQ(edited(" {\"a\" : [1 ,2 ]}", [](JsonEdit &, const JsonValue &) {}), " {\"a\" : [1 ,2 ]}");
}

TEST(JsonEdit, AppendsBehindTheLastElement)
{
    const auto append = [](JsonEdit &edit, const JsonValue &root) {
        edit.append(root["a"], "7");
        edit.append(root["a"], "8");
    };
    EXPECT_EQ(edited("{\"a\":[ 1,\n  2 \n]}", append), "{\"a\":[ 1,\n  2,7,8 \n]}");
    EXPECT_EQ(edited("{\"a\":[ ]}", append), "{\"a\":[7,8 ]}");
    EXPECT_EQ(edited("{\"a\":[[]]}", append), "{\"a\":[[],7,8]}");
}

TEST(JsonEdit, SetsMembers)
{
    const auto set = [](JsonEdit &edit, const JsonValue &root) { edit.set(root, "x\"", "{}"); };
    EXPECT_EQ(edited("{}", set), "{\"x\\\"\":{}}");
    EXPECT_EQ(edited("{\"a\": 1 }", set), "{\"a\": 1,\"x\\\"\":{} }");
    EXPECT_EQ(edited("{\"x\\\"\" : [1, 2], \"a\": 1 }", set), "{\"x\\\"\" : {}, \"a\": 1 }");
    EXPECT_THROW(edited("{\"x\\\"\": 1, \"x\\u0022\": 2}", set), GltfError);
}

TEST(JsonEdit, RemovesWithTheRightComma)
{
    const auto removed = [](const std::string &text) {
        return edited(text, [](JsonEdit &edit, const JsonValue &root) { edit.remove(root, "x"); });
    };
    EXPECT_EQ(removed("{ \"x\": 1 }"), "{ }");
    EXPECT_EQ(removed("{ \"x\": 1 , \"a\": 2 }"), "{ \"a\": 2 }");
    EXPECT_EQ(removed("{ \"a\": 2, \"x\": 1 }"), "{ \"a\": 2 }");
    EXPECT_EQ(removed("{\"a\":1, \"x\": 1, \"b\":2, \"x\":[], \"x\":0}"), "{\"a\":1, \"b\":2}");
    EXPECT_EQ(removed("[\"x\", \"a\", \"x\"]"), "[\"a\"]");
    EXPECT_EQ(removed("[\"a\"]"), "[\"a\"]");
}

TEST(JsonEdit, RemovesAndAppendsAtOnce)
{
    EXPECT_EQ(edited("[\"x\"]",
                     [](JsonEdit &edit, const JsonValue &root) {
                         edit.remove(root, "x");
                         edit.append(root, "\"y\"");
                     }),
              "[\"y\"]");
    EXPECT_EQ(edited("{\"a\":{\"b\":1},\"x\":2}",
                     [](JsonEdit &edit, const JsonValue &root) {
                         edit.remove(root, "x");
                         edit.set(root, "y", "3");
                         edit.set(root["a"], "b", "4");
                         edit.set(root["a"], "c", "5");
                     }),
              "{\"a\":{\"b\":4,\"c\":5},\"y\":3}");
}
