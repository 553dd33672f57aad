// SPDX-License-Identifier: Apache-2.0
// What commands at device addresses leave in memory, computed by hand.
#include "check/case/address_copies.h"

#include <gtest/gtest.h>
#include <map>
#include <numeric>

#include "check/case/names.h"
#include "random_case.h"

namespace
{

using namespace vellum::check;
using CommandKind = AddressCommand::Kind;

// Two buffers of 32 bytes, whose bytes are their offsets, the second one's plus 100; and an image of 4 x 3 texels of a
// byte, of two layers and two levels, whose bytes are their offsets plus 200.
struct HandMade {
    AddressPlan plan{
        .buffers = {32, 32}, .format = VK_FORMAT_R8_UINT, .width = 4, .height = 3, .levels = 2, .layers = 2};
    AddressMemory memory{std::vector<uint8_t>(32), std::vector<uint8_t>(32), std::vector<uint8_t>(28)};

    HandMade()
    {
        for (size_t i = 0; i < memory.size(); ++i)
            std::iota(memory[i].begin(), memory[i].end(), static_cast<uint8_t>(100 * i));
    }
    // The bytes that the command changes: of which memory, at which offset, to what.
    std::map<std::pair<size_t, size_t>, int> changedBy(const AddressCommand &command)
    {
        EXPECT_EQ(brokenRule(plan, command), "");
        const AddressMemory before = memory;
        carryOut(plan, command, memory);
        std::map<std::pair<size_t, size_t>, int> changed;
        for (size_t m = 0; m < memory.size(); ++m)
            for (size_t i = 0; i < memory[m].size(); ++i)
                if (memory[m][i] != before[m][i])
                    changed[{m, i}] = memory[m][i];
        return changed;
    }
};
using Changed = std::map<std::pair<size_t, size_t>, int>;

TEST(AddressMemory, CopiesAsManyBytesAsTheSourceHas)
{
    HandMade m;
    EXPECT_EQ(m.changedBy({.regions = {{.buffer = 0, .offset = 29, .size = 2, .spare = 1, .from = 1, .fromOffset = 5},
                                       {.buffer = 1, .offset = 0, .size = 1, .from = 0, .fromOffset = 0}}}),
              (Changed{{{0, 29}, 105}, {{0, 30}, 106}, {{1, 0}, 0}}));
}

TEST(AddressMemory, FillsWithWordsAndUpdatesWithData)
{
    HandMade m;
    EXPECT_EQ(m.changedBy({.kind = CommandKind::Fill, .regions = {{.offset = 4, .size = 8}}, .value = 0xfffefdfc}),
              (Changed{{{0, 4}, 0xfc},
                       {{0, 5}, 0xfd},
                       {{0, 6}, 0xfe},
                       {{0, 7}, 0xff},
                       {{0, 8}, 0xfc},
                       {{0, 9}, 0xfd},
                       {{0, 10}, 0xfe},
                       {{0, 11}, 0xff}}));
    const AddressCommand update{
        .kind = CommandKind::Update, .regions = {{.buffer = 1, .offset = 8, .spare = 3}}, .value = 1};
    const std::vector<uint8_t> data = updateData(update);
    ASSERT_EQ(data.size(), 4u);
    EXPECT_EQ(m.changedBy(update),
              (Changed{{{1, 8}, data[0]}, {{1, 9}, data[1]}, {{1, 10}, data[2]}, {{1, 11}, data[3]}}));
}

// Level 1 has 2 x 1 texels, which begin behind the 2 x 12 bytes of level 0.
TEST(AddressMemory, ImagesHaveRowsAndSlices)
{
    HandMade m;
    EXPECT_EQ(m.changedBy({.kind = CommandKind::CopyFromImage,
                           .regions = {{.offset = 1,
                                        .layers = 2,
                                        .x = 2,
                                        .y = 1,
                                        .width = 2,
                                        .height = 2,
                                        .rowLength = 3,
                                        .imageHeight = 4}}}),
              (Changed{{{0, 1}, 206},
                       {{0, 2}, 207},
                       {{0, 4}, 210},
                       {{0, 5}, 211},
                       {{0, 13}, 218},
                       {{0, 14}, 219},
                       {{0, 16}, 222},
                       {{0, 17}, 223}}));
    EXPECT_EQ(m.changedBy({.kind = CommandKind::CopyToImage,
                           .regions = {{.buffer = 1, .offset = 7, .level = 1, .layer = 1, .width = 2},
                                       {.buffer = 1, .offset = 20, .x = 1, .width = 1, .height = 3}}}),
              (Changed{{{2, 26}, 107}, {{2, 27}, 108}, {{2, 1}, 120}, {{2, 5}, 121}, {{2, 9}, 122}}));
}

TEST(AddressMemory, VolumesHaveSlicesOfTheirOwn)
{
    HandMade m;
    m.plan = {.buffers = {32, 32}, .format = VK_FORMAT_R8G8_UINT, .volume = true, .width = 2, .height = 2, .depth = 3};
    m.memory[2] = {200, 201, 202, 203, 204, 205, 206, 207, 208, 209, 210, 211,
                   212, 213, 214, 215, 216, 217, 218, 219, 220, 221, 222, 223};
    EXPECT_EQ(m.changedBy({.kind = CommandKind::CopyFromImage,
                           .regions = {{.buffer = 1, .offset = 2, .x = 1, .z = 1, .height = 2, .depth = 2}}}),
              (Changed{{{1, 2}, 210},
                       {{1, 3}, 211},
                       {{1, 4}, 214},
                       {{1, 5}, 215},
                       {{1, 6}, 218},
                       {{1, 7}, 219},
                       {{1, 8}, 222},
                       {{1, 9}, 223}}));
}

TEST(AddressMemory, FaultsNameTheCommandAndTheByte)
{
    HandMade m;
    m.plan.commands = {{.regions = {{.buffer = 1, .offset = 3, .size = 2, .fromOffset = 9}}},
                       {.kind = CommandKind::CopyFromImage, .regions = {{.level = 1, .layer = 1, .x = 1}}}};
    const AddressMemory expected = m.memory;
    EXPECT_EQ(addressFault(m.plan, 0, expected, expected), "");
    AddressMemory found = expected;
    found[1][4] = 1;
    found[1][5] = 2;
    EXPECT_EQ(
        addressFault(m.plan, 0, expected, found),
        "vkCmdCopyMemoryKHR writes a wrong byte (command 0, region 0: byte 4 of buffer 1 is 0x01, not 0x68 as byte "
        "10 of buffer 0; 2 bytes differ)");
    found = expected;
    found[0][5] = 7;
    EXPECT_EQ(addressFault(m.plan, 0, expected, found),
              "vkCmdCopyMemoryKHR changes a byte that it must not (command 0: byte 5 of buffer 0 is 0x07, not 0x05 as "
              "before)");
    found = expected;
    found[0][0] = 7;
    EXPECT_EQ(
        addressFault(m.plan, 1, expected, found),
        "vkCmdCopyImageToMemoryKHR writes a wrong byte (command 1, region 0: byte 0 of buffer 0 is 0x07, not 0x00 "
        "as byte 0 of texel (1, 0, 0) of level 1, layer 1 of the image)");
}

// Each allowed command at its limits, and what is one step beyond.
TEST(AddressMemory, Rules)
{
    AddressPlan plan{.buffers = {70000, 64}, .format = VK_FORMAT_R8G8B8A8_UNORM, .width = 4, .height = 3};
    const auto broken = [&](CommandKind kind, std::vector<AddressRegion> regions) {
        return brokenRule(plan, {.kind = kind, .regions = std::move(regions)});
    };
    EXPECT_EQ(brokenRule(plan), "");
    EXPECT_EQ(broken(CommandKind::Copy, {{.buffer = 1, .offset = 61, .size = 2, .spare = 1}}), "");
    EXPECT_EQ(broken(CommandKind::Copy, {{.buffer = 1, .offset = 62, .size = 2, .spare = 1}}),
              "a range exceeds its buffer");
    EXPECT_EQ(broken(CommandKind::Copy, {{.size = 2, .from = 1, .fromOffset = 63}}), "reads more than the buffer has");
    EXPECT_EQ(broken(CommandKind::Copy, {{.buffer = 2}}), "a buffer does not exist");
    EXPECT_EQ(broken(CommandKind::Copy, {{.size = 0, .from = 1, .fromOffset = 63}}), "");
    EXPECT_EQ(broken(CommandKind::Copy, {{.size = 0, .from = 1, .fromOffset = 64}}), "an address is behind its buffer");
    EXPECT_EQ(broken(CommandKind::Copy, {}), "has no region, or too many");
    // A source must not be in a target's range, or in another source.
    const char *const overlap = "a range that is read overlaps another one";
    EXPECT_EQ(broken(CommandKind::Copy, {{.offset = 10, .size = 4, .fromOffset = 14}}), "");
    EXPECT_EQ(broken(CommandKind::Copy, {{.offset = 10, .size = 4, .fromOffset = 13}}), overlap);
    EXPECT_EQ(broken(CommandKind::Copy, {{.offset = 10, .size = 4, .spare = 1, .fromOffset = 14}}), overlap);
    EXPECT_EQ(broken(CommandKind::Copy, {{.offset = 10, .from = 1}, {.offset = 20, .from = 1, .fromOffset = 4}}), "");
    EXPECT_EQ(broken(CommandKind::Copy, {{.offset = 10, .from = 1}, {.offset = 20, .from = 1, .fromOffset = 3}}),
              overlap);
    EXPECT_EQ(broken(CommandKind::Copy, {{.offset = 10, .from = 1}, {.offset = 13, .from = 1, .fromOffset = 4}}),
              "two regions write the same byte");
    EXPECT_EQ(broken(CommandKind::Update, {{.size = 65532, .spare = 4}}), "");
    EXPECT_NE(broken(CommandKind::Update, {{.size = 65532, .spare = 5}}), "");
    EXPECT_NE(broken(CommandKind::Update, {{.offset = 2}}), "");
    EXPECT_NE(broken(CommandKind::Update, {{.size = 0}}), "");
    EXPECT_NE(broken(CommandKind::Update, {{}, {.offset = 4}}), "");
    EXPECT_EQ(broken(CommandKind::Fill, {{.offset = 4, .size = 0}}), "");
    EXPECT_NE(broken(CommandKind::Fill, {{.offset = 4, .size = 6}}), "");
    // 2 rows of 5 texels, and 4 texels of the third one.
    const AddressRegion all{.buffer = 1, .offset = 8, .width = 4, .height = 3, .rowLength = 5};
    EXPECT_EQ(broken(CommandKind::CopyToImage, {all}), "");
    const auto with = [&](uint32_t AddressRegion::*member, uint32_t value) {
        AddressRegion region = all;
        region.*member = value;
        return broken(CommandKind::CopyToImage, {region});
    };
    EXPECT_EQ(with(&AddressRegion::spare, 1), "a range exceeds its buffer");
    EXPECT_EQ(with(&AddressRegion::offset, 6), "offset is no multiple of the texel size");
    EXPECT_EQ(with(&AddressRegion::rowLength, 3), "rowLength or imageHeight is below the extent");
    EXPECT_EQ(with(&AddressRegion::imageHeight, 2), "rowLength or imageHeight is below the extent");
    EXPECT_EQ(with(&AddressRegion::x, 1), "exceeds the image");
    EXPECT_EQ(with(&AddressRegion::depth, 0), "exceeds the image");
    EXPECT_EQ(with(&AddressRegion::level, 1), "level or layers do not exist");
    EXPECT_EQ(broken(CommandKind::CopyToImage, {all, {.x = 1}}), "two regions write the same byte");
    EXPECT_EQ(broken(CommandKind::CopyFromImage, {all, {.x = 1}}), "");
    plan.layers = 2;
    plan.volume = true;
    EXPECT_NE(brokenRule(plan), "");
    plan.volume = false;
    plan.levels = 4;
    EXPECT_EQ(brokenRule(plan), "the image has too many levels");
}

// Random plans have every command, several regions, and ranges that are larger and end with the buffer.
TEST(AddressMemory, RandomPlansVary)
{
    std::map<CommandKind, uint32_t> commands;
    uint32_t several = 0, larger = 0, atTheEnd = 0, rows = 0, large = 0;
    for (uint32_t seed = 0; seed < 200; ++seed) {
        const AddressPlan plan = randomCase(seed, 3).addressCopies;
        for (const AddressCommand &command : plan.commands) {
            ++commands[command.kind];
            several += command.regions.size() > 1 ? 1u : 0u;
            for (const AddressRegion &region : command.regions) {
                larger += region.spare > 0 ? 1u : 0u;
                atTheEnd += region.offset + rangeSize(plan, command, region) == plan.buffers[region.buffer] ? 1u : 0u;
                rows += region.rowLength > region.width && region.height > 1 ? 1u : 0u;
                large += command.kind == CommandKind::Update && region.size == 65536 ? 1u : 0u;
            }
        }
    }
    EXPECT_EQ(commands.size(), kAddressCommandNames.size());
    for (const auto &[kind, count] : commands)
        EXPECT_GT(count, 20u) << nameOf(kAddressCommandNames, kind);
    for (const uint32_t count : {several, larger, atTheEnd, rows})
        EXPECT_GT(count, 50u);
    EXPECT_GT(large, 0u);
}

} // namespace
