// SPDX-License-Identifier: Apache-2.0
// Copies of hit tables: when one serves further traces, and how much memory they have.
#include "layer/command_buffer/hit_table_copies.h"
#include "layer/memory/scratch_memory.h"
#include "memory_device.h"

#include <gtest/gtest.h>

#include <set>

namespace vellum::test
{
namespace
{

using layer::HitTableCopies;
using layer::MemoryPool;

class HitTableCopiesOfACommandBuffer : public testing::Test
{
protected:
    static HitTableCopies::Table table(VkDeviceAddress source, VkDeviceSize size = kMiB)
    {
        return {.source = source, .size = size, .stride = 64, .standIn = 0x100, .reach = 15};
    }
    // True if a trace with the table would find its copy.
    bool isCurrent(const HitTableCopies::Table &of, VkDeviceSize bytes = 2 * kMiB)
    {
        const HitTableCopies::Copy copy = copies_.get(of, bytes);
        EXPECT_NE(copy.address, 0u);
        EXPECT_GE(copy.bytes, bytes);
        return copy.isCurrent;
    }

    MemoryDevice device_;
    MemoryPool pool_{device_.context(), layer::kScratchAlignment, layer::scratchUsage,
                     layer::GpuBuffer::Content::DevicesOnly};
    HitTableCopies copies_{pool_};
};

TEST_F(HitTableCopiesOfACommandBuffer, MadeOnce)
{
    EXPECT_FALSE(isCurrent(table(0x1000)));
    EXPECT_TRUE(isCurrent(table(0x1000)));
    EXPECT_TRUE(isCurrent(table(0x1000), kMiB)) << "a larger one serves as well";
    EXPECT_FALSE(isCurrent(table(0x1000), 3 * kMiB));
    EXPECT_TRUE(isCurrent(table(0x1000), 3 * kMiB));
}

TEST_F(HitTableCopiesOfACommandBuffer, OfOneTable)
{
    const HitTableCopies::Table first = table(0x1000);
    EXPECT_FALSE(isCurrent(first));
    for (auto member : {&HitTableCopies::Table::source, &HitTableCopies::Table::size, &HitTableCopies::Table::stride,
                        &HitTableCopies::Table::standIn}) {
        HitTableCopies::Table other = first;
        other.*member += 64;
        EXPECT_FALSE(isCurrent(other));
        EXPECT_TRUE(isCurrent(other));
    }
    HitTableCopies::Table further = first;
    further.reach += 1;
    EXPECT_FALSE(isCurrent(further));
    EXPECT_TRUE(isCurrent(first));
}

TEST_F(HitTableCopiesOfACommandBuffer, Forgotten)
{
    EXPECT_FALSE(isCurrent(table(0x1000)));
    copies_.forget();
    EXPECT_FALSE(isCurrent(table(0x1000)));
    EXPECT_TRUE(isCurrent(table(0x1000)));
    copies_.reset();
    EXPECT_FALSE(isCurrent(table(0x1000)));
}

// Memory of forgotten copies is used again, unless two executions may be in different commands at once.
TEST_F(HitTableCopiesOfACommandBuffer, ReuseMemory)
{
    for (const bool shared : {true, false}) {
        copies_.reset();
        copies_.setShared(shared);
        std::set<VkDeviceAddress> addresses;
        for (int i = 0; i < 100; ++i) {
            addresses.insert(copies_.get(table(0x1000), kMiB).address);
            copies_.forget();
        }
        EXPECT_EQ(addresses.size(), shared ? 1u : 100u);
    }
}

// Many tables that are all current: the oldest copies give way.
TEST_F(HitTableCopiesOfACommandBuffer, HaveALimit)
{
    for (uint64_t i = 1; i <= 1000; ++i) {
        EXPECT_FALSE(isCurrent(table(i * 0x1000, 10 * kMiB), 10 * kMiB));
        EXPECT_TRUE(isCurrent(table(i * 0x1000, 10 * kMiB), 10 * kMiB));
    }
    EXPECT_TRUE(isCurrent(table(999 * 0x1000, 10 * kMiB), 10 * kMiB));
    EXPECT_LE(MemoryDevice::allocatedBytes(), 256 * kMiB);
    // A table beyond the limit has a copy nevertheless.
    EXPECT_FALSE(isCurrent(table(0x1000, 100 * kMiB), 100 * kMiB));
    EXPECT_TRUE(isCurrent(table(0x1000, 100 * kMiB), 100 * kMiB));
}

// A frame after the other, with a table of 256 MiB, and other memory that is unused.
TEST_F(HitTableCopiesOfACommandBuffer, LargeMemoryStays)
{
    for (const VkDeviceSize size : {VkDeviceSize{1}, VkDeviceSize{80}, VkDeviceSize{100}}) {
        layer::PooledMemory first(pool_, size * kMiB), second(pool_, size * kMiB);
    }
    long allocations = 0;
    for (int frame = 0; frame < 4; ++frame) {
        copies_.reset();
        EXPECT_FALSE(isCurrent(table(0x1000, 256 * kMiB), 256 * kMiB));
        if (frame == 0)
            allocations = MemoryDevice::allocations();
    }
    EXPECT_EQ(MemoryDevice::allocations(), allocations);
}

} // namespace
} // namespace vellum::test
