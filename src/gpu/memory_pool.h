// SPDX-License-Identifier: Apache-2.0
// Memory for buffers.
#pragma once

#include <memory>
#include <vector>
#include <vulkan/vulkan.h>

namespace vellum::gpu
{

// Gives out memory of a device. Small pieces share allocations: a device may allow no more than 4,096 of them
// (maxMemoryAllocationCount).
class MemoryPool
{
public:
    class Block;
    struct Piece {
        VkDeviceMemory memory = VK_NULL_HANDLE;
        VkDeviceSize offset = 0;
        Block *block = nullptr;
    };

    explicit MemoryPool(VkDevice device);
    // When all is freed, before the device is destroyed.
    ~MemoryPool();
    MemoryPool(const MemoryPool &) = delete;
    MemoryPool &operator=(const MemoryPool &) = delete;

    // Memory for buffers with a device address. Throws VulkanError.
    Piece allocate(const VkMemoryRequirements &requirements, uint32_t type);
    void free(const Piece &piece);

private:
    VkDevice device_;
    std::vector<std::unique_ptr<Block>> blocks_;
};

} // namespace vellum::gpu
