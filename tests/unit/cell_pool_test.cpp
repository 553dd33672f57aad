// Cells on memory that the host may only write while nothing on the same page is in use.
#include <cstdlib>
#include <map>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "core/records.h"
#include "layer/objects/cell_pool.h"

namespace
{

using namespace vellum::layer;
using namespace vellum::shared;

constexpr std::uintptr_t kPage = 4096;

// A device that consists of memory.
template <typename Handle>
Handle newHandle()
{
    static std::uint64_t next = 1;
    return reinterpret_cast<Handle>(next++);
}

struct Memory {
    void *bytes = nullptr;
};
std::map<VkDeviceMemory, Memory> memories;

VKAPI_ATTR VkResult VKAPI_CALL createBuffer(VkDevice, const VkBufferCreateInfo *info, const VkAllocationCallbacks *,
                                            VkBuffer *buffer)
{
    *buffer = reinterpret_cast<VkBuffer>(info->size); // the size is all that is asked of it
    return VK_SUCCESS;
}
VKAPI_ATTR void VKAPI_CALL destroyBuffer(VkDevice, VkBuffer, const VkAllocationCallbacks *) {}
VKAPI_ATTR void VKAPI_CALL getRequirements(VkDevice, VkBuffer buffer, VkMemoryRequirements *requirements)
{
    *requirements = {reinterpret_cast<VkDeviceSize>(buffer), kPage, 1};
}
VKAPI_ATTR VkResult VKAPI_CALL allocateMemory(VkDevice, const VkMemoryAllocateInfo *info, const VkAllocationCallbacks *,
                                              VkDeviceMemory *memory)
{
    *memory = newHandle<VkDeviceMemory>();
    memories[*memory] = {std::aligned_alloc(kPage, info->allocationSize)};
    return VK_SUCCESS;
}
VKAPI_ATTR void VKAPI_CALL freeMemory(VkDevice, VkDeviceMemory memory, const VkAllocationCallbacks *)
{
    std::free(memories[memory].bytes);
    memories.erase(memory);
}
VKAPI_ATTR VkResult VKAPI_CALL bindBufferMemory(VkDevice, VkBuffer, VkDeviceMemory, VkDeviceSize)
{
    return VK_SUCCESS;
}
VKAPI_ATTR VkResult VKAPI_CALL mapMemory(VkDevice, VkDeviceMemory memory, VkDeviceSize, VkDeviceSize, VkMemoryMapFlags,
                                         void **data)
{
    *data = memories[memory].bytes;
    return VK_SUCCESS;
}
VKAPI_ATTR VkDeviceAddress VKAPI_CALL getAddress(VkDevice, const VkBufferDeviceAddressInfo *)
{
    return 65536;
}

class CellPools : public ::testing::Test
{
protected:
    CellPools()
    {
        table_.CreateBuffer = createBuffer;
        table_.DestroyBuffer = destroyBuffer;
        table_.GetBufferMemoryRequirements = getRequirements;
        table_.AllocateMemory = allocateMemory;
        table_.FreeMemory = freeMemory;
        table_.BindBufferMemory = bindBufferMemory;
        table_.MapMemory = mapMemory;
        table_.GetBufferDeviceAddress = getAddress;
        context_.next = &table_;
        context_.memory.memoryHeapCount = 1;
        context_.memory.memoryHeaps[0].size = 1u << 30;
        context_.memory.memoryTypeCount = 1;
        context_.memory.memoryTypes[0].propertyFlags =
            VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    }
    // As the device: all words of a cell.
    void write(std::uint32_t cell, std::uint32_t value) { std::fill_n(pool_.words(cell), kCellWords, value); }
    [[nodiscard]] bool holds(std::uint32_t cell, std::uint32_t value) const
    {
        return std::count(pool_.words(cell), pool_.words(cell) + kCellWords, value) == kCellWords;
    }
    static std::uintptr_t pageOf(const std::uint32_t *words) { return reinterpret_cast<std::uintptr_t>(words) / kPage; }

    DeviceTable table_{};
    GpuContext context_{};
    CellPool pool_;
};

// The host has written to a page if cells that were in use before are of zeroes again.
TEST_F(CellPools, PagesAreOnlyWrittenWhileNoneOfTheirCellsIsInUse)
{
    std::vector<std::uint32_t> live;
    std::uint32_t random = 1;
    for (int step = 0; step < 20000; ++step) {
        random = random * 1664525u + 1013904223u;
        if (live.empty() || (random >> 16) % 100 < (step / 2500 % 2 == 0 ? 70u : 30u)) {
            // What is given out is of zeroes, and what is in use beside it is as it was.
            const std::uint32_t cell = pool_.acquire(context_);
            ASSERT_NE(cell, CellPool::kNone);
            ASSERT_TRUE(holds(cell, 0)) << "step " << step;
            for (const std::uint32_t other : live) {
                ASSERT_NE(other, cell);
                if (pageOf(pool_.words(other)) == pageOf(pool_.words(cell))) {
                    ASSERT_TRUE(holds(other, other + 1)) << "step " << step;
                }
            }
            write(cell, cell + 1);
            live.push_back(cell);
        } else {
            const std::size_t i = (random >> 8) % live.size();
            pool_.release(live[i]);
            live[i] = live.back();
            live.pop_back();
        }
    }
    for (const std::uint32_t cell : live)
        EXPECT_TRUE(holds(cell, cell + 1));
}

TEST_F(CellPools, ACellIsNotGivenOutAgainWhileItsPageIsInUse)
{
    const std::uint32_t first = pool_.acquire(context_);
    const std::uint32_t kept = pool_.acquire(context_);
    ASSERT_EQ(pageOf(pool_.words(first)), pageOf(pool_.words(kept)));
    pool_.release(first);
    std::set<std::uint32_t> others;
    for (int i = 0; i < 10000; ++i)
        others.insert(pool_.acquire(context_));
    EXPECT_EQ(others.size(), 10000u);
    EXPECT_FALSE(others.contains(first));
    // And then it is: memory does not grow for ever.
    pool_.release(kept);
    for (const std::uint32_t cell : others)
        pool_.release(cell);
    const std::size_t allocations = memories.size();
    for (int round = 0; round < 5; ++round) {
        std::vector<std::uint32_t> cells;
        for (int i = 0; i < 10000; ++i)
            cells.push_back(pool_.acquire(context_));
        for (const std::uint32_t cell : cells)
            pool_.release(cell);
    }
    EXPECT_EQ(memories.size(), allocations);
}

} // namespace
