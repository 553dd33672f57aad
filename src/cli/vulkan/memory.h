// SPDX-License-Identifier: Apache-2.0
// Memory for buffers.
#pragma once

#include <memory>
#include <vector>
#include <vulkan/vulkan.h>

namespace vellum::cli
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
        void *mapped = nullptr; // the piece's first byte, if it was requested
        Block *block = nullptr;
    };

    explicit MemoryPool(VkDevice device);
    // When all is freed, before the device is destroyed.
    ~MemoryPool();
    MemoryPool(const MemoryPool &) = delete;
    MemoryPool &operator=(const MemoryPool &) = delete;

    // Memory for buffers with a device address. Mapped memory must be of a host-coherent type. Throws
    // Error.
    Piece allocate(const VkMemoryRequirements &requirements, uint32_t type, bool mapped);
    void free(const Piece &piece);

private:
    VkDevice device_;
    std::vector<std::unique_ptr<Block>> blocks_;
};

} // namespace vellum::cli
