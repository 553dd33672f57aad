// SPDX-License-Identifier: Apache-2.0
// Flushes and invalidations of memory that is not coherent, and mappings that end.
#include <array>

#include <gtest/gtest.h>

#include "layer/base/commands.h"
#include "layer/memory/device_buffers.h"
#include "layer/memory/host_memory.h"

namespace
{

using namespace vellum::layer;

void expectAtoms(VkDeviceSize memory, VkDeviceSize begin, VkDeviceSize bytes, VkDeviceSize atom, VkDeviceSize first,
                 VkDeviceSize size)
{
    const VkMappedMemoryRange range = vellum::layer::atomsOf(VK_NULL_HANDLE, memory, begin, bytes, atom);
    EXPECT_EQ(range.sType, VK_STRUCTURE_TYPE_MAPPED_MEMORY_RANGE);
    EXPECT_EQ(range.offset, first);
    EXPECT_EQ(range.size, size);
}

TEST(HostMemory, AtomsOfABuffer)
{
    expectAtoms(4096, 256, 512, 64, 256, 512);
    expectAtoms(4096, 300, 1, 64, 256, 64);
    expectAtoms(4096, 300, 20, 64, 256, 64);
    expectAtoms(4096, 300, 21, 64, 256, 128);
    expectAtoms(4096, 0, 4096, 256, 0, 4096);
    expectAtoms(4000, 3900, 100, 64, 3840, 160); // ends with the memory, whose size is not a multiple of an atom
    expectAtoms(4096, 17, 5, 1, 17, 5);
}

// A driver that looks whether anybody could still read the mapping.
class Unmapping : public testing::Test
{
protected:
    Unmapping()
    {
        current_ = this;
        driver_.next.UnmapMemory = [](VkDevice, VkDeviceMemory) { current_->expectUnreadable(); };
        driver_.next.UnmapMemory2KHR = [](VkDevice, const VkMemoryUnmapInfoKHR *) {
            current_->expectUnreadable();
            return current_->result_;
        };
        buffers_.host.allocated(kMemory, sizeof bytes_, VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT);
        buffers_.host.bound(kBuffer, kMemory, 16);
        buffers_.host.mappedByDriver(kMemory, 16, 32, bytes_.data() + 16);
    }
    bool readable(VkDeviceSize offset)
    {
        uint32_t word = 0;
        const bool can = buffers_.host.peek(kBuffer, offset, &word, 4);
        EXPECT_TRUE(!can || word == 0x5a5a5a5a);
        return can;
    }
    void expectUnreadable() { EXPECT_FALSE(readable(0)); }
    VkResult unmap2()
    {
        VkMemoryUnmapInfoKHR info{};
        info.memory = kMemory;
        return unmapMemory2(buffers_, VK_NULL_HANDLE, &info);
    }

    inline static Unmapping *current_ = nullptr;
    inline static const auto kMemory = reinterpret_cast<VkDeviceMemory>(uintptr_t{8});
    inline static const auto kBuffer = reinterpret_cast<VkBuffer>(uintptr_t{16});
    VkResult result_ = VK_SUCCESS;
    std::array<uint8_t, 64> bytes_ = [] {
        std::array<uint8_t, 64> bytes{};
        bytes.fill(0x5a);
        return bytes;
    }();
    Driver driver_;
    DeviceBuffers buffers_{driver_};
};

TEST_F(Unmapping, EndsBeforeTheDriverUnmaps)
{
    EXPECT_TRUE(readable(0));
    unmapMemory(buffers_, VK_NULL_HANDLE, kMemory);
    EXPECT_FALSE(readable(0));
}

TEST_F(Unmapping, EndsBeforeTheDriverUnmaps2)
{
    EXPECT_EQ(unmap2(), VK_SUCCESS);
    EXPECT_FALSE(readable(0));
    EXPECT_EQ(unmap2(), VK_SUCCESS);
}

TEST_F(Unmapping, ThatFailsLeavesTheMapping)
{
    result_ = VK_ERROR_MEMORY_MAP_FAILED;
    EXPECT_EQ(unmap2(), VK_ERROR_MEMORY_MAP_FAILED);
    EXPECT_TRUE(readable(0));
    EXPECT_TRUE(readable(28));
    EXPECT_FALSE(readable(29));
}

} // namespace
