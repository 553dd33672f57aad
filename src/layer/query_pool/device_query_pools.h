// SPDX-License-Identifier: Apache-2.0
// The subsystem of query pools on a device: pools whose results the layer writes or corrects.
#pragma once

#include <memory>

#include <vulkan/vulkan.h>

#include "layer/memory/memory_pool.h"
#include "layer/structures/device_structures.h"

namespace vellum::layer
{

// A pool of micromap sizes has the handle of a driver's pool of a type that every driver supports, and which is never
// used: names, private data and destruction of the handle then need no special treatment. A pool of acceleration
// structure sizes is the driver's. Each answer of the driver is copied and corrected (structures/structure_size.comp),
// because the records of micromaps are in the structure's memory, and the driver does not know them. Values and
// availability of both kinds of pools are in host-visible memory.
//
// If micromaps are the driver's by VK_EXT_opacity_micromap (subsystem khr_over_ext), a pool of acceleration structure
// sizes also takes queries of micromaps, which the driver only answers in pools of another type: the layer creates such
// a pool as well, and copies the answers of both.
struct QueryPool {
    VkQueryType type = VK_QUERY_TYPE_MAX_ENUM;
    uint32_t count = 0;
    // If micromaps are translated: the driver's pool for the same size of micromaps.
    VkQueryPool micromaps = VK_NULL_HANDLE;
    PooledMemory memory; // 64-bit values, then 32-bit availability, then a word that is always zero

    [[nodiscard]] VkDeviceAddress valueAddress(uint32_t query) const { return memory.address() + query * 8ull; }
    [[nodiscard]] VkDeviceSize availabilityOffset(uint32_t query) const { return count * 8ull + query * 4ull; }
    // The offset in the buffer that contains the memory.
    [[nodiscard]] VkDeviceSize valueInBuffer(uint32_t query) const { return memory.offset() + query * 8ull; }
    [[nodiscard]] VkDeviceSize availabilityInBuffer(uint32_t query) const
    {
        return memory.offset() + availabilityOffset(query);
    }
    [[nodiscard]] VkDeviceSize zeroInBuffer() const { return availabilityInBuffer(count); }
    [[nodiscard]] uint64_t value(uint32_t query) const;
    [[nodiscard]] bool available(uint32_t query) const;
};

struct DeviceQueryPools {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceState &objects;
    DeviceCommandBuffers &commands;
    DeviceStructures &structures;
    // Pools do not share pages: the host may reset one while the device writes another, and layers below that guard
    // pages would not distinguish them.
    MemoryPool memory{buffers.gpu, 4096,
                      [](const GpuContext &) -> VkBufferUsageFlags {
                          return VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
                      },
                      GpuBuffer::Content::Undefined};
    HandleMap<VkQueryPool, std::shared_ptr<QueryPool>> pools{};
};

} // namespace vellum::layer
