// SPDX-License-Identifier: Apache-2.0
// Micromap builds and compacting copies, bit for bit: the device's result is compared with the host's
// writeMicromapMemory and CompactedMicromap, for every level and format, all build flags, shared and unaligned
// data, and input that breaks every rule.
#include <algorithm>

#include "core/micromap_memory.h"
#include "harness/program/labels.h"
#include "harness/states.h"
#include "micromaps/build_flags.h"

namespace
{

const vt::Labels kMicromapBuildLabels{{"MicromapBuild.*", "stacked"}};

using namespace vt;

// A micromap's memory as the host model writes it; bytes that the device leaves alone are the guard byte.
std::vector<uint8_t> modelOf(const Micromap &micromap, VkBuildMicromapFlagsEXT flags)
{
    const MicromapInput &in = micromap.input();
    std::vector<uint8_t> triangles(in.stride * in.triangles.size() + 8);
    for (size_t i = 0; i < in.triangles.size(); ++i)
        std::memcpy(triangles.data() + i * in.stride, &in.triangles[i], 8);
    vellum::MicromapBuildInput input;
    input.triangles = triangles.data();
    input.stride = in.stride;
    input.data = in.data.data();
    input.dataBytes = in.data.size();
    input.buildFlags = flags;
    input.copiedAhead = in.data.size();
    uint32_t inlineBytes = 0;
    for (const VkMicromapUsageEXT &u : in.usage()) {
        const uint32_t bytes = std::max(1u, (u.format == kTwoState ? 1u : 2u) << (2 * u.subdivisionLevel) >> 3);
        input.triangleCount += u.count;
        if (u.subdivisionLevel > 2)
            input.capacityUnits += u.count * ((bytes + 15) / 16);
        else
            inlineBytes += u.count * bytes;
        input.maxLevel = std::max(input.maxLevel, u.subdivisionLevel);
    }
    if (input.capacityUnits > 0)
        input.capacityUnits += (inlineBytes + 15) / 16;
    input.readable = static_cast<uint32_t>(in.triangles.size());
    std::vector<uint8_t> memory(vellum::micromapMemoryBytes(input.triangleCount, input.capacityUnits), 0xa5);
    vellum::writeMicromapMemory(input, memory.data());
    return memory;
}

class MicromapBuild : public GpuTest
{
protected:
    MicromapBuild() : GpuTest({.shared = true}) {}

    void expectModel(Micromap &micromap, VkBuildMicromapFlagsEXT flags)
    {
        micromap.build();
        const std::vector<uint8_t> built = modelOf(micromap, flags);
        ASSERT_GE(micromap.size(), built.size());
        expectEqual(micromap, built);
        if ((flags & kAllow) == 0)
            return;
        const std::vector<uint8_t> compacted = compactedMemory(built.data());
        ASSERT_LE(compacted.size(), built.size());
        EXPECT_EQ(compactedSize(micromap), reportedSize(gpu(), compacted.size()));
        const Micromap copy(gpu(), micromap, compacted.size());
        gpu().submit([&](VkCommandBuffer commands) {
            recordMicromapCopy(gpu(), commands, micromap.handle(), copy.handle(), VK_COPY_MICROMAP_MODE_COMPACT_EXT);
        });
        SCOPED_TRACE("compacted");
        expectEqual(copy, compacted);
        EXPECT_EQ(compactedSize(copy), reportedSize(gpu(), compacted.size()));
        expectEqual(micromap, built); // which others may use at the same time
    }
    VkDeviceSize compactedSize(const Micromap &micromap)
    {
        return queryMicromap(gpu(), micromap.handle(), VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT);
    }
    static void expectEqual(const Micromap &micromap, const std::vector<uint8_t> &expected)
    {
        const std::vector<uint8_t> actual(micromap.memory(), micromap.memory() + expected.size());
        if (actual == expected)
            return;
        const auto at =
            static_cast<size_t>(std::mismatch(actual.begin(), actual.end(), expected.begin()).first - actual.begin());
        uint32_t words[2][2];
        std::memcpy(words[0], actual.data() + at / 8 * 8, 8);
        std::memcpy(words[1], expected.data() + at / 8 * 8, 8);
        ADD_FAILURE() << "byte " << at << " of " << expected.size() << ": " << std::hex << words[0][0] << ' '
                      << words[0][1] << ", expected " << words[1][0] << ' ' << words[1][1];
    }
    static constexpr std::array<VkBuildMicromapFlagsEXT, 5> kFlags{0, kAllow, kTrace, kFast | kAllow, kTrace | kAllow};
};

TEST_F(MicromapBuild, EveryLevelAndFormat)
{
    for (const VkBuildMicromapFlagsEXT flags : kFlags) {
        SCOPED_TRACE(testing::Message() << "flags " << flags);
        Random random(7);
        MicromapInput input;
        for (uint32_t level = 0; level <= 12; ++level) {
            for (const uint16_t format : {kTwoState, kFourState})
                input.add(level, format, randomStates(random, level, format));
        }
        Micromap micromap(gpu(), std::move(input), flags);
        expectModel(micromap, flags);
    }
}

// Many triangles, over the borders of blocks: repeated, uniform, and sharing the same bytes of data.
TEST_F(MicromapBuild, ManyTriangles)
{
    for (const VkBuildMicromapFlagsEXT flags : kFlags) {
        for (const size_t count : {1u, 2u, 255u, 256u, 257u, 3001u}) {
            SCOPED_TRACE(testing::Message() << "flags " << flags << ", " << count << " triangles");
            Random random(static_cast<uint32_t>(count));
            std::vector<std::vector<uint8_t>> patterns;
            MicromapInput input;
            for (size_t i = 0; i < count; ++i) {
                const uint32_t level = random() % 6;
                const uint16_t format = random() % 2 == 0 ? kTwoState : kFourState;
                if (!input.triangles.empty() && random() % 4 == 0)
                    input.triangles.push_back(input.triangles[random() % input.triangles.size()]);
                else if (random() % 3 == 0)
                    input.add(level, format, std::vector<uint8_t>(size_t{1} << (2 * level), random() % 2 == 0 ? 0 : 1));
                else
                    input.add(level, format, randomStates(random, level, format));
            }
            Micromap micromap(gpu(), std::move(input), flags);
            expectModel(micromap, flags);
        }
    }
}

TEST_F(MicromapBuild, LargeTrianglesRepeated)
{
    Random random(3);
    MicromapInput input;
    for (const uint32_t level : {7u, 8u, 9u, 8u, 7u}) {
        const std::vector<uint8_t> states = randomStates(random, level, kFourState);
        for (int copy = 0; copy < 3; ++copy) {
            input.add(level, kFourState, states);
            input.add(level, kTwoState, std::vector<uint8_t>(size_t{1} << (2 * level), 1));
        }
    }
    for (const VkBuildMicromapFlagsEXT flags : kFlags) {
        SCOPED_TRACE(testing::Message() << "flags " << flags);
        Micromap micromap(gpu(), input, flags);
        expectModel(micromap, flags);
    }
}

// Data at every byte offset, and triangles with strides that are multiples of 4 and not.
TEST_F(MicromapBuild, UnalignedInput)
{
    // A rule of VK_KHR_opacity_micromap's; the layer takes any stride.
    gpu().breaks("VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11647");
    for (const VkDeviceSize stride : {8u, 9u, 12u, 24u, 31u}) {
        Random random(static_cast<uint32_t>(stride));
        MicromapInput input;
        input.stride = stride;
        for (int i = 0; i < 100; ++i) {
            input.data.push_back(0x77);
            const uint32_t level = random() % 8;
            const uint16_t format = random() % 2 == 0 ? kTwoState : kFourState;
            input.add(level, format, randomStates(random, level, format));
        }
        for (const VkBuildMicromapFlagsEXT flags : {VkBuildMicromapFlagsEXT{0}, kAllow}) {
            SCOPED_TRACE(testing::Message() << "stride " << stride << ", flags " << flags);
            Micromap micromap(gpu(), input, flags);
            expectModel(micromap, flags);
        }
    }
}

// Data with gaps, which cannot stay: over the borders of blocks, and of every size.
TEST_F(MicromapBuild, DataWithGaps)
{
    for (const int count : {3, 255, 257, 1000}) {
        Random random(static_cast<uint32_t>(count));
        MicromapInput input;
        for (int i = 0; i < count; ++i) {
            input.data.resize(input.data.size() + random() % 50, 0x77);
            const uint32_t level = i % 100 == 0 ? 9 : random() % 7;
            const uint16_t format = random() % 2 == 0 ? kTwoState : kFourState;
            input.add(level, format, randomStates(random, level, format));
        }
        SCOPED_TRACE(testing::Message() << count << " triangles");
        Micromap micromap(gpu(), input, 0);
        expectModel(micromap, 0);
        // One triangle more than declared gets no memory.
        input.declared = input.usage();
        input.triangles[0].subdivisionLevel = 9;
        input.triangles[1].subdivisionLevel = 9;
        Micromap other(gpu(), input, 0);
        expectModel(other, 0);
    }
}

// A pattern for every byte of the last triangle: nothing beyond the buffer may be needed to read it.
TEST_F(MicromapBuild, SharedOffsets)
{
    Random random(5);
    MicromapInput input;
    input.add(6, kFourState, randomStates(random, 6, kFourState));
    const VkMicromapTriangleEXT whole = input.triangles[0];
    for (uint32_t offset = 0; offset < 1024 - 64; offset += 5) {
        VkMicromapTriangleEXT part = whole;
        part.dataOffset = offset;
        part.subdivisionLevel = 4;
        input.triangles.push_back(part);
        input.triangles.push_back(whole);
    }
    for (const VkBuildMicromapFlagsEXT flags : kFlags) {
        Micromap micromap(gpu(), input, flags);
        expectModel(micromap, flags);
    }
}

// Data that can stay as it lies: all triangles alike or not, some with the same data; and then one triangle that
// forbids it.
TEST_F(MicromapBuild, DataThatStays)
{
    for (const VkBuildMicromapFlagsEXT flags : {VkBuildMicromapFlagsEXT{0}, kFast, kTrace}) {
        for (const uint32_t level : {3u, 4u, 7u, 99u}) { // 99: of all kinds
            for (const uint16_t format : {kTwoState, kFourState}) {
                SCOPED_TRACE(testing::Message() << "flags " << flags << ", level " << level << ", format " << format);
                Random random(level * 2 + format);
                MicromapInput input;
                const int count = level == 7 ? 40 : 1501;
                for (int i = 0; i < count; ++i) {
                    const uint32_t own = level == 99 ? random() % 6 : level;
                    if (level == 99 && own != 3)
                        input.data.resize((input.data.size() + 15) / 16 * 16);
                    if (i % 5 == 4)
                        input.triangles.push_back(input.triangles[random() % input.triangles.size()]);
                    else
                        input.add(own, format, randomStates(random, own, format));
                    if (level == 99 && own == 3)
                        input.data.resize((input.data.size() + 7) / 8 * 8);
                }
                input.declared = input.usage();
                Micromap micromap(gpu(), input, flags);
                expectModel(micromap, flags);
                const size_t which = input.triangles.size() / 2;
                const VkMicromapTriangleEXT good = input.triangles[which];
                VkMicromapTriangleEXT bad[4] = {good, good, good, good};
                bad[0].dataOffset += 4;
                bad[1].dataOffset = 0xfffffff0;
                bad[2].format = 7;
                bad[3].subdivisionLevel = 1;
                for (const VkMicromapTriangleEXT &triangle : bad) {
                    input.triangles[which] = triangle;
                    Micromap other(gpu(), input, flags);
                    expectModel(other, flags);
                }
                // Only the device knows whether a triangle uses bytes behind the others' data.
                input.triangles[which] = good;
                input.data.resize(input.data.size() + 64, 0x77);
                Micromap behind(gpu(), input, flags);
                expectModel(behind, flags);
                const uint32_t bytes = std::max(1u, uint32_t{format} << (2u * good.subdivisionLevel) >> 3);
                input.triangles[which].dataOffset = static_cast<uint32_t>(input.data.size()) - bytes;
                Micromap moved(gpu(), input, flags);
                expectModel(moved, flags);
            }
        }
    }
}

// So many triangles that each invocation processes several, in parallel and in sequence, whatever the device's subgroup
// size.
TEST_F(MicromapBuild, ManyTrianglesThatStay)
{
    Random random(31);
    MicromapInput input;
    for (int i = 0; i < 1000; ++i)
        input.add(3, kTwoState, randomStates(random, 3, kTwoState));
    while (input.triangles.size() < 1'200'003)
        input.triangles.push_back(input.triangles[(random() >> 8) % 1000]);
    Micromap micromap(gpu(), input, 0);
    expectModel(micromap, 0);
    // The last one's data end behind all others'.
    input.add(3, kTwoState, randomStates(random, 3, kTwoState));
    Micromap other(gpu(), input, kTrace);
    expectModel(other, kTrace);
}

// Sizes as the project promises them: packed data plus 16 bytes a triangle plus 1 KiB.
TEST_F(MicromapBuild, SizesAreTight)
{
    for (uint32_t level = 0; level <= 12; ++level) {
        for (const uint32_t format : {kTwoState, kFourState}) {
            for (const uint32_t count : {1u, 7u, 1000u}) {
                const VkMicromapUsageEXT usage{count, level, format};
                auto info = vkInit<VkMicromapBuildInfoEXT>({.flags = kAllow,
                                                            .usageCountsCount = 1,
                                                            .pUsageCounts = &usage,
                                                            .triangleArrayStride = sizeof(VkMicromapTriangleEXT)});
                const VkMicromapBuildSizesInfoEXT sizes = micromapSizes(gpu(), info);
                const VkDeviceSize bits = VkDeviceSize{format == kTwoState ? 1u : 2u} << (2 * level);
                const VkDeviceSize packed = (bits + 7) / 8;
                EXPECT_LE(sizes.micromapSize, count * (packed + 16) + 1024) << "level " << level;
                EXPECT_GE(sizes.micromapSize, level > 2 ? count * packed : 1);
                EXPECT_LE(sizes.buildScratchSize, count * (24 + packed / 16) + 1024);
            }
        }
    }
}

// Wrong input of every kind: the model says what becomes of it.
TEST_F(MicromapBuild, WrongInput)
{
    for (const VkBuildMicromapFlagsEXT flags : kFlags) {
        SCOPED_TRACE(testing::Message() << "flags " << flags);
        Random random(11);
        MicromapInput input;
        for (int i = 0; i < 40; ++i)
            input.add(3 + random() % 4, kFourState, randomStates(random, 6, kFourState));
        input.declared = input.usage();
        input.triangles[3].subdivisionLevel = 13;
        input.triangles[5].subdivisionLevel = 12; // not declared
        input.triangles[7].format = 0;
        input.triangles[9].format = 0xffff;
        input.triangles[11].dataOffset = 0xffffffff;
        input.triangles[13].dataOffset = 0x7fffffff;
        for (size_t i = 20; i < 30; ++i)
            input.triangles[i].subdivisionLevel = 6; // more data than declared
        Micromap micromap(gpu(), input, flags);
        expectModel(micromap, flags);
    }
}

// Several large triangles that share data, where the usage counts declare only one.
TEST_F(MicromapBuild, MoreLargeTrianglesThanDeclared)
{
    Random random(11);
    MicromapInput input;
    const std::vector<uint8_t> states = randomStates(random, 8, kFourState);
    input.add(8, kFourState, states);
    for (int i = 0; i < 3; ++i)
        input.triangles.push_back(input.triangles[0]);
    for (int i = 0; i < 4; ++i)
        input.add(8, kFourState, randomStates(random, 8, kFourState));
    input.add(2, kFourState, std::vector<uint8_t>(16, 1));
    input.declared = {{1, 8, kFourState}, {8, 2, kFourState}};
    for (const VkBuildMicromapFlagsEXT flags : {kAllow, kTrace | kAllow}) {
        Micromap micromap(gpu(), input, flags);
        expectModel(micromap, flags);
    }
}

} // namespace
