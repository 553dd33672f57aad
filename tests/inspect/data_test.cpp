// SPDX-License-Identifier: Apache-2.0
// The numbers that the page and the picture are made of.
#include <cmath>
#include <cstring>

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/json_writer.h"
#include "base/picture.h"
#include "base/text.h"
#include "gltf/file/uri.h"
#include "inspect/inspected_file.h"
#include "inspect/page.h"
#include "made_up_file.h"

using namespace vellum;
using namespace vellum::inspect;
using namespace vellum::test;

namespace
{

std::string jsonString(std::string_view text)
{
    return quotedJson(text, JsonStyle::Html);
}

} // namespace

TEST(InspectTally, CountsStatesLevelsAndBytes)
{
    const InspectedFile file = madeUpFile();
    const Tally tally = tallyOf(file);
    EXPECT_EQ(tally.triangles, 5u);
    EXPECT_EQ(tally.levels[2][1], 1u);
    EXPECT_EQ(tally.levels[3][0], 2u);
    EXPECT_EQ(tally.special, (std::array<uint64_t, 4>{0, 1, 1, 0}));
    EXPECT_EQ(tally.recordsUsed, 2u);
    EXPECT_EQ(tally.dataBytes, 4u + 8u);
    EXPECT_EQ(tally.indexBytes, 10u);
    EXPECT_DOUBLE_EQ(tally.states[1], (0.25 + 0.5 + 0.5 + 1) / 5);
    EXPECT_DOUBLE_EQ(tally.states[2], (0.25 + 1) / 5);
    EXPECT_DOUBLE_EQ(tally.uvArea[1], 0.5 * (0.25 + 0.5 + 0.5 + 1));
    EXPECT_DOUBLE_EQ(tally.uvArea[2], 0.5 * 0.25) << "no area where coordinates are no numbers";
}

TEST(PageData, EqualTrianglesAreOneShape)
{
    const PageData data = makePageData(madeUpFile(), {});
    ASSERT_EQ(data.shapes.size(), 4u);
    EXPECT_EQ(data.shapeOf, (std::vector<uint32_t>{0, 1, 1, 2, 3}));
    EXPECT_EQ(data.shapes[2].record, -2);
    EXPECT_EQ(data.firstShape, (std::vector<uint32_t>{0, 4}));
    EXPECT_EQ(data.firstTriangle, (std::vector<uint32_t>{0, 5}));
    ASSERT_EQ(data.records.size(), 2u);
    for (uint32_t i = 0; i < 16; ++i)
        EXPECT_EQ(readState(data.states.data() + data.records[0].firstByte, i, Format::FourState),
                  static_cast<State>(i % 4));
    for (uint32_t i = 0; i < 64; ++i)
        EXPECT_EQ(readState(data.states.data() + data.records[1].firstByte, i, Format::FourState),
                  i < 32 ? State::Opaque : State::Transparent);
}

TEST(PageData, BytesAreThoseThatThePageReads)
{
    const PageData data = makePageData(madeUpFile(), {});
    const std::vector<uint8_t> bytes = data.bytes();
    ASSERT_EQ(bytes.size(), 2u * 24 + 4 * 28 + 5 * 4 + 5 * 4 + data.states.size());
    EXPECT_EQ(bytes[0], 2);
    EXPECT_EQ(bytes[1], 2);
    EXPECT_EQ(bytes[2], 2) << "4 states";
    EXPECT_EQ(bytes[24 + 2], 1) << "2 states";
    float u = 0;
    std::memcpy(&u, bytes.data() + 48 + 8, sizeof u);
    EXPECT_EQ(u, 1.0f) << "u of the second corner of the first shape";
    EXPECT_EQ(bytes[48 + 3 * 28 + 24], 0xfd) << "special index -3 of the fourth shape";
    EXPECT_EQ(bytes[48 + 4 * 28 + 4], 1) << "the shape of the second triangle";
}

TEST(PageData, StatesAreCoarserWhereTheyWouldBeTooMany)
{
    PageLimits limits;
    limits.stateBytes = 5; // 4 for level 2, 16 for level 3: both fit at level 1, with a byte each
    const PageData data = makePageData(madeUpFile(), limits);
    EXPECT_LE(data.states.size(), limits.stateBytes);
    EXPECT_EQ(data.records[1].level, 3);
    ASSERT_EQ(data.records[1].pageLevel, 1);
    const uint8_t *states = data.states.data() + data.records[1].firstByte;
    for (uint32_t i = 0; i < 4; ++i)
        EXPECT_EQ(readState(states, i, Format::FourState), i < 2 ? State::Opaque : State::Transparent);
    EXPECT_EQ(data.records[1].states, (StateCounts{32, 32, 0, 0})) << "counted at its own level";
}

// The size of a page depends on the numbers of different triangles and of different data, not on the number of
// triangles in the file.
TEST(PageData, AHundredThousandTriangles)
{
    InspectedFile file = madeUpFile();
    InspectedPrimitive &primitive = file.primitives[0];
    primitive.numbers.clear();
    primitive.uvs.clear();
    primitive.records.clear();
    for (uint32_t t = 0; t < 100'000; ++t) {
        const auto u = static_cast<float>(t % 1000) / 1000;
        primitive.numbers.push_back(t);
        primitive.uvs.push_back({{{u, 0}, {u, 1}, {u + 0.001f, 0}}});
        primitive.records.push_back(static_cast<int32_t>(t % 2));
    }
    const PageData data = makePageData(file, {});
    EXPECT_EQ(data.shapes.size(), 1000u);
    EXPECT_EQ(data.states.size(), 4u + 16u);
    EXPECT_EQ(data.bytes().size(), 2u * 24 + 1000 * 28 + 2 * 4 * 100'000 + data.states.size());
    EXPECT_LT(deflated(data.bytes()).size(), 400'000u);
    PageLimits limits;
    limits.triangles = 70'000;
    const PageData less = makePageData(file, limits);
    EXPECT_EQ(less.shapeOf.size(), 70'000u);
    EXPECT_EQ(less.leftOut, 30'000u);
}

TEST(InspectEncoding, Base64)
{
    const auto of = [](std::string_view text) {
        return base64Encoded({reinterpret_cast<const uint8_t *>(text.data()), text.size()});
    };
    EXPECT_EQ(of(""), "");
    EXPECT_EQ(of("f"), "Zg==");
    EXPECT_EQ(of("fo"), "Zm8=");
    EXPECT_EQ(of("foo"), "Zm9v");
    EXPECT_EQ(of("foob"), "Zm9vYg==");
    EXPECT_EQ(of("\xff\xfe\xfd"), "//79");
}

TEST(InspectEncoding, TextIsHarmlessInPages)
{
    EXPECT_EQ(jsonString("leaf"), "\"leaf\"");
    EXPECT_EQ(jsonString("</script>"), R"("\u003c/script\u003e")");
    EXPECT_EQ(jsonString("a\"b\\c\n&'"), R"("a\u0022b\u005cc\u000a\u0026\u0027")");
    EXPECT_EQ(jsonString("\xc3\xa9\xf0\x9f\x8d\x82"), R"("\u00e9\ud83c\udf42")");
    EXPECT_EQ(jsonString("\xe2\x80\xa8"), R"("\u2028")");
    EXPECT_EQ(markupText("<b> & \"x\""), "&#60;b&#62; &#38; &#34;x&#34;");
    EXPECT_EQ(markupText("\xc3\xa9"), "&#233;");
    EXPECT_EQ(markupText("a\tb\nc\rd"), "a&#9;b&#10;c&#65533;d");
}

TEST(InspectEncoding, InvalidUtf8IsReplaced)
{
    for (const char *text : {"\xff", "\xc3", "\xe2\x80", "\xf0\x9f\x8d", "\x80"})
        EXPECT_EQ(jsonString(text).substr(0, 7), "\"\\ufffd") << text;
    EXPECT_EQ(jsonString("\xc0\xaf"), R"("\ufffd\ufffd")") << "too long a form of /";
    EXPECT_EQ(jsonString("\xed\xa0\x80").substr(0, 7), "\"\\ufffd") << "half of a pair";
    EXPECT_EQ(jsonString("\xf7\xbf\xbf\xbf").substr(0, 7), "\"\\ufffd") << "above U+10FFFF";
    EXPECT_EQ(markupText(std::string_view("\0", 1)), "&#65533;");
    EXPECT_EQ(markupText("\xef\xbf\xbf"), "&#65533;") << "U+FFFF";
}

TEST(InspectSelection, Ranges)
{
    const std::vector<NumberRange> ranges = parseRanges("1,4-6", "--mesh");
    for (const uint32_t number : {1u, 4u, 5u, 6u})
        EXPECT_TRUE(contains(ranges, number));
    for (const uint32_t number : {0u, 2u, 3u, 7u})
        EXPECT_FALSE(contains(ranges, number));
    EXPECT_TRUE(contains({}, 7));
    for (const char *wrong : {"", "x", "1,", "3-", "-3", "5-4", "1 2", "4294967296", "1;2"})
        EXPECT_THROW(parseRanges(wrong, "--mesh"), Error) << wrong;
}
