// SPDX-License-Identifier: Apache-2.0
// A device that consists of memory: what the layer's buffers need of a driver. A buffer's address is that of its bytes.
#pragma once

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <new>

#include "layer/memory/gpu_memory.h"

namespace vellum::test
{

inline constexpr VkDeviceSize kMiB = 1024 * 1024;

class MemoryDevice
{
public:
    MemoryDevice()
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
    [[nodiscard]] const layer::GpuContext &context() const { return context_; }
    // Buffers and pieces of memory that exist, of all such devices.
    static long alive() { return alive_; }
    // The memory that exists, and how often some was allocated.
    static VkDeviceSize allocatedBytes() { return allocatedBytes_; }
    static long allocations() { return allocations_; }

private:
    struct BufferState {
        VkDeviceSize size;
        void *bytes;
    };
    static constexpr size_t kPage = 65536; // of any processor

    static VKAPI_ATTR VkResult VKAPI_CALL createBuffer(VkDevice, const VkBufferCreateInfo *info,
                                                       const VkAllocationCallbacks *, VkBuffer *buffer)
    {
        auto *state = static_cast<BufferState *>(std::malloc(sizeof(BufferState)));
        *state = {info->size, nullptr};
        *buffer = reinterpret_cast<VkBuffer>(state);
        ++alive_;
        return VK_SUCCESS;
    }
    static VKAPI_ATTR void VKAPI_CALL destroyBuffer(VkDevice, VkBuffer buffer, const VkAllocationCallbacks *)
    {
        std::free(reinterpret_cast<BufferState *>(buffer));
        --alive_;
    }
    static VKAPI_ATTR void VKAPI_CALL getRequirements(VkDevice, VkBuffer buffer, VkMemoryRequirements *requirements)
    {
        const VkDeviceSize size = reinterpret_cast<BufferState *>(buffer)->size;
        *requirements = {(size + kPage - 1) / kPage * kPage, kPage, 1};
    }
    static VKAPI_ATTR VkResult VKAPI_CALL allocateMemory(VkDevice, const VkMemoryAllocateInfo *info,
                                                         const VkAllocationCallbacks *, VkDeviceMemory *memory)
    {
        // The size is in the page before it.
        void *bytes = ::operator new (kPage + info->allocationSize, std::align_val_t{kPage});
        *static_cast<VkDeviceSize *>(bytes) = info->allocationSize;
        *memory = reinterpret_cast<VkDeviceMemory>(static_cast<std::byte *>(bytes) + kPage);
        ++alive_;
        ++allocations_;
        allocatedBytes_ += info->allocationSize;
        return VK_SUCCESS;
    }
    static VKAPI_ATTR void VKAPI_CALL freeMemory(VkDevice, VkDeviceMemory memory, const VkAllocationCallbacks *)
    {
        if (!memory)
            return;
        void *bytes = reinterpret_cast<std::byte *>(memory) - kPage;
        allocatedBytes_ -= *static_cast<VkDeviceSize *>(bytes);
        ::operator delete (bytes, std::align_val_t{kPage});
        --alive_;
    }
    static VKAPI_ATTR VkResult VKAPI_CALL bindBufferMemory(VkDevice, VkBuffer buffer, VkDeviceMemory memory,
                                                           VkDeviceSize)
    {
        reinterpret_cast<BufferState *>(buffer)->bytes = reinterpret_cast<void *>(memory);
        return VK_SUCCESS;
    }
    static VKAPI_ATTR VkResult VKAPI_CALL mapMemory(VkDevice, VkDeviceMemory memory, VkDeviceSize, VkDeviceSize,
                                                    VkMemoryMapFlags, void **data)
    {
        *data = reinterpret_cast<void *>(memory);
        return VK_SUCCESS;
    }
    static VKAPI_ATTR VkDeviceAddress VKAPI_CALL getAddress(VkDevice, const VkBufferDeviceAddressInfo *info)
    {
        return reinterpret_cast<VkDeviceAddress>(reinterpret_cast<BufferState *>(info->buffer)->bytes);
    }

    inline static std::atomic<long> alive_{0}, allocations_{0};
    inline static std::atomic<VkDeviceSize> allocatedBytes_{0};
    layer::DeviceTable table_{};
    layer::GpuContext context_{};
};

} // namespace vellum::test
