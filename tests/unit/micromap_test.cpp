// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "core/micromap.h"
#include "test_random.h"

using namespace vellum;

TEST(States, PackedAsTheSpecificationOrdersThem)
{
    std::vector<uint8_t> data(2);
    writeState(data.data(), 0, Format::FourState, State::UnknownOpaque);
    writeState(data.data(), 1, Format::FourState, State::Opaque);
    writeState(data.data(), 4, Format::FourState, State::UnknownTransparent);
    EXPECT_EQ(data, (std::vector<uint8_t>{0b00000111, 0b00000010}));
    data = {0, 0};
    writeState(data.data(), 0, Format::TwoState, State::Opaque);
    writeState(data.data(), 9, Format::TwoState, State::UnknownOpaque);
    writeState(data.data(), 10, Format::TwoState, State::UnknownTransparent);
    EXPECT_EQ(data, (std::vector<uint8_t>{0b00000001, 0b00000010}));
}

TEST(States, WriteThenReadAtRandom)
{
    for (const Format format : {Format::TwoState, Format::FourState}) {
        for (uint32_t level = 0; level <= 4; ++level) {
            test::TestRandom random(level);
            std::vector<uint8_t> data(packedBytes(level, format), 0xa5);
            std::vector<unsigned> wanted(microTriangleCount(level));
            for (int i = 0; i < 2000; ++i) {
                const uint32_t index = random() % microTriangleCount(level);
                wanted[index] = random() & 3;
                writeState(data.data(), index, format, static_cast<State>(wanted[index]));
                const unsigned expected = format == Format::TwoState ? wanted[index] & 1 : wanted[index];
                ASSERT_EQ(static_cast<unsigned>(readState(data.data(), index, format)), expected);
            }
        }
    }
}

TEST(States, Sizes)
{
    EXPECT_EQ(packedBytes(0, Format::TwoState), 1u);
    EXPECT_EQ(packedBytes(0, Format::FourState), 1u);
    EXPECT_EQ(packedBytes(1, Format::TwoState), 1u);
    EXPECT_EQ(packedBytes(2, Format::TwoState), 2u);
    EXPECT_EQ(packedBytes(2, Format::FourState), 4u);
    EXPECT_EQ(packedBytes(12, Format::TwoState), 2u << 20);
    EXPECT_EQ(packedBytes(12, Format::FourState), 4u << 20);
}

TEST(SpecialIndices, AreThoseOfTheSpecification)
{
    EXPECT_EQ(specialIndex(State::Transparent), -1);
    EXPECT_EQ(specialIndex(State::Opaque), -2);
    EXPECT_EQ(specialIndex(State::UnknownTransparent), -3);
    EXPECT_EQ(specialIndex(State::UnknownOpaque), -4);
    for (int i = -4; i < 0; ++i)
        EXPECT_EQ(specialIndex(specialState(i).value()), i);
    EXPECT_FALSE(specialState(0));
    EXPECT_FALSE(specialState(-5));
    EXPECT_FALSE(specialState(-2147483647 - 1));
}

namespace
{

// A micromap of two triangles, one of each format, and four geometry triangles.
Micromap example()
{
    Micromap m;
    m.data = {0xff, 0xff, 0xff, 0xff, 0x02};
    m.triangles = {{0, 2, Format::FourState}, {4, 1, Format::TwoState}};
    m.indices = {0, -1, 1, 1};
    return m;
}

} // namespace

TEST(MicromapModel, CountsItsUsage)
{
    const Micromap m = example();
    EXPECT_EQ(usageOf(m.triangles), (std::vector<MicromapUsage>{{1, 1, Format::TwoState}, {1, 2, Format::FourState}}));
    EXPECT_EQ(usageOf(m.triangles, m.indices, m.baseTriangle),
              (std::vector<MicromapUsage>{{2, 1, Format::TwoState}, {1, 2, Format::FourState}}));
}

TEST(MicromapModel, BaseTriangleMovesIndices)
{
    Micromap m = example();
    m.baseTriangle = 1;
    m.indices = {0, -4};
    EXPECT_EQ(m.validate(), std::nullopt);
    EXPECT_EQ(usageOf(m.triangles, m.indices, m.baseTriangle), (std::vector<MicromapUsage>{{1, 1, Format::TwoState}}));
    EXPECT_EQ(m.stateAt(0, 0.3f, 0.3f), State::Opaque);
    EXPECT_EQ(m.stateAt(0, 0.1f, 0.1f), State::Transparent);
    EXPECT_EQ(m.stateAt(1, 0.1f, 0.1f), State::UnknownOpaque);
}

TEST(MicromapModel, ValidationNamesTheFirstViolation)
{
    const auto violation = [](auto change) {
        Micromap m = example();
        change(m);
        return m.validate().value_or("");
    };
    EXPECT_EQ(example().validate(), std::nullopt);
    EXPECT_NE(violation([](Micromap &m) { m.triangles[1].subdivisionLevel = 13; }).find("triangle 1"),
              std::string::npos);
    EXPECT_NE(violation([](Micromap &m) { m.triangles[0].format = static_cast<Format>(3); }).find("format 3"),
              std::string::npos);
    EXPECT_NE(violation([](Micromap &m) { m.triangles[1].dataOffset = 5; }).find("byte 6 of 5"), std::string::npos);
    EXPECT_NE(violation([](Micromap &m) { m.triangles[0].dataOffset = 0xffffffff; }).find("triangle 0"),
              std::string::npos);
    EXPECT_NE(violation([](Micromap &m) { m.indices[3] = 2; }).find("geometry triangle 3"), std::string::npos);
    EXPECT_NE(violation([](Micromap &m) { m.indices[2] = -5; }).find("geometry triangle 2"), std::string::npos);
    EXPECT_NE(violation([](Micromap &m) { m.baseTriangle = 0xffffffff; }).find("base triangle"), std::string::npos);
}
