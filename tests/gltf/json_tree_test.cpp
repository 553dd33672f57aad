// SPDX-License-Identifier: Apache-2.0
#include "gltf/file/json_tree.h"

#include <gtest/gtest.h>

#include "gltf/file/gltf_error.h"

using namespace vellum;

TEST(JsonTree, KnowsWhereEverythingIs)
{
    const std::string text = "\n { \"a\" : [ 1 , -2.5e3,\"x:,y\", true ,null,{},[ ] ] ,\"b\":{\"c\" : false}}  ";
    const JsonTree tree(text);
    const JsonValue root = tree.root();
    EXPECT_EQ(root.text(), text.substr(2, text.rfind('}') - 1));
    EXPECT_EQ(root["a"].text(), "[ 1 , -2.5e3,\"x:,y\", true ,null,{},[ ] ]");
    std::vector<std::string> texts;
    for (const JsonValue &element : root["a"].children())
        texts.emplace_back(element.text());
    EXPECT_EQ(texts, (std::vector<std::string>{"1", "-2.5e3", "\"x:,y\"", "true", "null", "{}", "[ ]"}));
    EXPECT_EQ(root["b"]["c"].text(), "false");
    EXPECT_EQ(root.children().size(), 2u);
    EXPECT_FALSE(root["c"].exists());
    EXPECT_FALSE(root["c"]["d"].exists());
    EXPECT_FALSE(root["a"]["d"].exists());
    EXPECT_TRUE(root["c"].children().empty());
}

TEST(JsonTree, ReadsIntegersAndNothingElse)
{
    const JsonTree tree("[0, -7, 9007199254740993, 2.0, 3e2, 2.5, 1e300, 99999999999999999999, \"1\", true, [1]]");
    std::vector<int64_t> integers;
    for (const JsonValue &element : tree.root().children())
        integers.push_back(element.integer().value_or(-1));
    EXPECT_EQ(integers, (std::vector<int64_t>{0, -7, 9007199254740993, 2, 300, -1, -1, -1, -1, -1, -1}));
}

TEST(JsonTree, NumbersThatAreTooSmallAreZero)
{
    const JsonTree tree("[1e-400, -0.5e-999, 0e-400, 5e-324, null]");
    std::vector<double> numbers;
    for (const JsonValue &element : tree.root().children())
        numbers.push_back(element.number().value_or(-1));
    EXPECT_EQ(numbers, (std::vector<double>{0, 0, 0, 5e-324, -1}));
}

TEST(JsonTree, FindsEscapedNamesAndTheLastOfSeveral)
{
    const JsonTree tree(R"({"\u0061b": 1, "x": 2, "ab": 3, "\"q\\": "\n\u00e4"})");
    EXPECT_EQ(tree.root()["ab"].integer(), 3);
    EXPECT_EQ(tree.root().count("ab"), 2u);
    EXPECT_EQ(tree.root()["\"q\\"].string(), "\n\xc3\xa4");
    EXPECT_FALSE(tree.root()["x"].string().has_value());
}

// Objects with many members have a sorted index.
TEST(JsonTree, LargeObjectsAreAsSmallOnes)
{
    std::string text = R"({"\u0061b": 1, "x": {"ab": 4}, "ab": 3)";
    for (int i = 0; i < 1000; ++i)
        text += ",\"" + std::to_string(i) + "\":" + std::to_string(i);
    text += "}";
    const JsonTree tree(text);
    EXPECT_EQ(tree.root()["ab"].integer(), 3);
    EXPECT_EQ(tree.root()["x"]["ab"].integer(), 4);
    EXPECT_EQ(tree.root().count("ab"), 2u);
    for (int i = 0; i < 1000; ++i)
        EXPECT_EQ(tree.root()[std::to_string(i)].integer(), i);
    EXPECT_FALSE(tree.root()["1000"].exists());
    EXPECT_FALSE(tree.root()[""].exists());
    EXPECT_FALSE(tree.root()["zzz"].exists());
}

TEST(JsonTree, KeepsAByteOrderMarkAndPadding)
{
    const JsonTree marked("\xef\xbb\xbf{\"a\": 1}");
    EXPECT_EQ(marked.root().begin(), 3u);
    EXPECT_EQ(marked.root()["a"].text(), "1");
    const JsonTree padded(std::string_view("{\"a\": 1}\0\0\0", 11));
    EXPECT_EQ(padded.root().text(), "{\"a\": 1}");
}

TEST(JsonTree, ReportsErrors)
{
    for (const char *text : {"", "{", "[1,]", "{\"a\" 1}", "{a: 1}", "[01]", "\"\\ud800\"", "nul"})
        EXPECT_THROW(JsonTree tree(text), GltfError) << text;
}
