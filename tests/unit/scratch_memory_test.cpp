// SPDX-License-Identifier: Apache-2.0
// Scratch memory of command buffers: how much of it stays allocated.
#include "layer/memory/scratch_memory.h"
#include "memory_device.h"

#include <gtest/gtest.h>

#include <vector>

namespace vellum::test
{
namespace
{

using layer::MemoryPool;
using layer::ScratchMemory;

constexpr size_t kCommandBuffers = 50;

class ScratchMemories : public testing::Test
{
protected:
    ScratchMemories()
    {
        for (size_t i = 0; i < kCommandBuffers; ++i)
            buffers_.push_back(std::make_unique<ScratchMemory>(pool_));
    }
    void record(VkDeviceSize bytes)
    {
        for (const auto &buffer : buffers_) {
            buffer->reset();
            buffer->restart();
            EXPECT_NE(buffer->allocate(bytes), 0u);
        }
    }
    [[nodiscard]] static VkDeviceSize allocated() { return MemoryDevice::allocatedBytes(); }

    MemoryDevice device_;
    MemoryPool pool_{device_.context(), layer::kScratchAlignment, layer::scratchUsage,
                     layer::GpuBuffer::Content::DevicesOnly};
    std::vector<std::unique_ptr<ScratchMemory>> buffers_;
};

TEST_F(ScratchMemories, ResetsReturnLargePieces)
{
    record(16 * kMiB);
    EXPECT_GE(allocated(), kCommandBuffers * 16 * kMiB);
    for (const auto &buffer : buffers_)
        buffer->reset();
    EXPECT_LE(allocated(), 512 * kMiB);
    record(1000);
    EXPECT_LE(allocated(), 512 * kMiB);
}

TEST_F(ScratchMemories, TrimmedPoolsHaveNoUnusedBlock)
{
    record(16 * kMiB);
    for (const auto &buffer : buffers_)
        buffer->release();
    pool_.trim();
    EXPECT_EQ(allocated(), 0u);
    record(16 * kMiB); // it goes on working
    EXPECT_GE(allocated(), kCommandBuffers * 16 * kMiB);
}

// Drivers may report that a build needs no scratch memory.
TEST_F(ScratchMemories, NoBytes)
{
    EXPECT_NE(buffers_.front()->allocate(0), 0u);
}

// A command buffer that may be executed on two queues at once.
TEST_F(ScratchMemories, CommandsHaveTheirOwnMemoryUnlessTheyShareIt)
{
    ScratchMemory &buffer = *buffers_.front();
    for (const bool shared : {true, false}) {
        buffer.reset();
        buffer.setShared(shared);
        const VkDeviceAddress first = buffer.allocate(256);
        buffer.restart();
        EXPECT_EQ(buffer.allocate(256) == first, shared);
    }
}

// Command buffers are recorded again in turn, as in a program with several in flight.
TEST_F(ScratchMemories, RecordingAgainAllocatesNothing)
{
    record(16 * kMiB);
    const long allocations = MemoryDevice::allocations();
    for (int frame = 0; frame < 5; ++frame)
        record(16 * kMiB);
    EXPECT_EQ(MemoryDevice::allocations(), allocations);
}

} // namespace
} // namespace vellum::test
