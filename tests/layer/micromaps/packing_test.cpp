// SPDX-License-Identifier: Apache-2.0
// Micromaps of an application with its own allocator: side by side in one buffer, by handles that reach to the end of
// the buffer, and so overlap and are far larger than their content. vkd3d-proton does so.
#include <algorithm>

#include "check/oracle/outcome.h"
#include "core/micromap_memory.h"
#include "harness/harness.h"
#include "harness/program/labels.h"
#include "harness/states.h"

namespace
{

const vt::Labels kPackingLabels{{"Packing.*", "forcing"}};

using namespace vt;

constexpr uint8_t kGuard = 0xa5;
constexpr VkDeviceSize kArenaBytes = 65536;

// All objects are in one buffer. Handles begin at an offset and reach to its end.
class Packing : public GpuTest
{
protected:
    Packing()
        : GpuTest({.maintenance = true}), arena_(gpu(), kArenaBytes, 256, micromapStorageUsage(gpu())),
          source_(gpu(), input(), VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT)
    {
        std::memset(arena_.bytes(), kGuard, kArenaBytes);
        source_.build();
        used_ = vellum::micromapMemoryInUse(source_.memory());
        compacted_ = compactedMemory(source_.memory());
    }
    ~Packing() override
    {
        for (const MicromapHandle &handle : handles_)
            destroyMicromap(gpu(), handle);
        EXPECT_TRUE(arena_.intact());
    }

    static MicromapInput input()
    {
        Random random(23);
        MicromapInput input;
        for (uint32_t t = 0; t < 60; ++t) {
            const uint32_t level = t % 6;
            const uint16_t format = t % 2 == 0 ? kFourState : kTwoState;
            input.add(level, format, randomStates(random, level, format));
        }
        return input;
    }
    MicromapHandle place(VkDeviceSize offset) { return place(offset, kArenaBytes - offset); }
    MicromapHandle place(VkDeviceSize offset, VkDeviceSize size)
    {
        handles_.push_back(
            createMicromap(gpu(), arena_.buffer(), arena_.address() - arena_.offset(), arena_.offset() + offset, size));
        return handles_.back();
    }
    void copy(const MicromapHandle &from, const MicromapHandle &to,
              VkCopyMicromapModeEXT mode = VK_COPY_MICROMAP_MODE_CLONE_EXT)
    {
        gpu().submit([&](VkCommandBuffer commands) { recordMicromapCopy(gpu(), commands, from, to, mode); });
    }
    [[nodiscard]] bool holdsCopy(VkDeviceSize offset) const
    {
        return std::memcmp(arena_.bytes() + offset, source_.memory(), used_) == 0;
    }
    [[nodiscard]] bool holdsCompacted(VkDeviceSize offset) const
    {
        return std::memcmp(arena_.bytes() + offset, compacted_.data(), compacted_.size()) == 0;
    }
    [[nodiscard]] bool untouched(VkDeviceSize begin, VkDeviceSize end) const
    {
        return std::all_of(arena_.bytes() + begin, arena_.bytes() + end, [](uint8_t b) { return b == kGuard; });
    }

    Guarded arena_;
    Micromap source_;
    VkDeviceSize used_ = 0;
    std::vector<uint8_t> compacted_; // copy of it
    std::vector<MicromapHandle> handles_;
};

TEST_F(Packing, CopiesMoveBytesInUse)
{
    ASSERT_GT(used_, 512u);
    ASSERT_LT(used_, 4096u);
    const MicromapHandle first = place(256), second = place(8192), third = place(4096);
    copy(source_.handle(), first);
    copy(first, second);
    copy(second, third, VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    for (const VkDeviceSize offset : {VkDeviceSize{256}, VkDeviceSize{8192}})
        EXPECT_TRUE(holdsCopy(offset)) << offset;
    EXPECT_TRUE(holdsCompacted(4096));
    EXPECT_TRUE(untouched(0, 256));
    EXPECT_TRUE(untouched(256 + used_, 4096));
    EXPECT_TRUE(untouched(4096 + compacted_.size(), 8192));
    EXPECT_TRUE(untouched(8192 + used_, kArenaBytes));
}

// Of handles that are too large for a compaction to have tables for all triangles that they could have.
TEST_F(Packing, CompactionInLargeHandles)
{
    const Buffer large(gpu(), VkDeviceSize{64} << 20, micromapStorageUsage(gpu()));
    const MicromapHandle from = createMicromap(gpu(), large.handle(), large.address(), 0, large.size());
    const MicromapHandle to = createMicromap(gpu(), large.handle(), large.address(), 8192, large.size() - 8192);
    copy(source_.handle(), from);
    copy(from, to, VK_COPY_MICROMAP_MODE_COMPACT_EXT);
    EXPECT_EQ(std::memcmp(large.bytes() + 8192, compacted_.data(), compacted_.size()), 0);
    destroyMicromap(gpu(), from);
    destroyMicromap(gpu(), to);
}

TEST_F(Packing, SizesCountBytesInUse)
{
    const MicromapHandle handle = place(0);
    copy(source_.handle(), handle);
    std::vector<VkQueryType> types{micromapQueryType(gpu(), VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT)};
    if (gpu().khr())
        types.push_back(VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR);
    for (const VkQueryType type : types) {
        const VkDeviceSize bytes = type == types[0] ? compacted_.size() : used_;
        EXPECT_EQ(queryMicromap(gpu(), handle, type), reportedSize(gpu(), bytes)) << type;
    }
}

TEST_F(Packing, BytesInUseMustNotOverlap)
{
    const MicromapHandle first = place(256);
    copy(source_.handle(), first);
    // The last one is also too small, and part of the source.
    for (const MicromapHandle &target : {place(0), place(512), place(512, 256)}) {
        copy(first, target);
        gpu().submit([](VkCommandBuffer) {}); // findings of shaders are reported with the next commands
        const auto messages = gpu().takeUnexpectedMessages();
        ASSERT_EQ(messages.size(), 1u);
        EXPECT_EQ(messages[0].id, "VELLUM-micromap-copy-overlap");
    }
    EXPECT_TRUE(holdsCopy(256));
    EXPECT_TRUE(untouched(0, 256));
    EXPECT_TRUE(untouched(256 + used_, kArenaBytes));
}

} // namespace
