// Query pools whose results the driver cannot give, or not alone.
//
// A pool of micromap sizes has the handle of a driver pool of a type that every driver knows (so that names, private
// data and the handle's destruction need no care) and that is never used. A pool of acceleration structure sizes is the
// driver's; each answer of the driver is taken over and corrected (structure_size.h), because the records of micromaps
// lie in the structure's own memory but the driver knows nothing of them. Values and availability of both lie in
// host-visible memory.
//
// Where micromaps are the driver's by VK_EXT_opacity_micromap (room of translation), a pool of acceleration structure
// sizes may be asked for sizes of micromaps, too, which the driver gives to pools of another type only: the layer has
// one of them beside, and takes the answers of both over.
#pragma once

#include <memory>

#include <vulkan/vulkan.h>

#include "layer/memory/memory_pool.h"

namespace vellum::layer
{

struct DeviceQueryPools;

struct QueryPool {
    VkQueryType type = VK_QUERY_TYPE_MAX_ENUM;
    uint32_t count = 0;
    // Where micromaps are translated: a pool of the driver's of the same size of micromaps.
    VkQueryPool micromaps = VK_NULL_HANDLE;
    PooledMemory memory; // 64-bit values, then 32-bit availability, then a word that is always zero

    [[nodiscard]] VkDeviceAddress valueAddress(uint32_t query) const { return memory.address() + query * 8ull; }
    [[nodiscard]] VkDeviceSize availabilityOffset(uint32_t query) const { return count * 8ull + query * 4ull; }
    // In the buffer that the memory is a part of.
    [[nodiscard]] VkDeviceSize valueInBuffer(uint32_t query) const { return memory.offset() + query * 8ull; }
    [[nodiscard]] VkDeviceSize availabilityInBuffer(uint32_t query) const
    {
        return memory.offset() + availabilityOffset(query);
    }
    [[nodiscard]] VkDeviceSize zeroInBuffer() const { return availabilityInBuffer(count); }
    [[nodiscard]] uint64_t value(uint32_t query) const;
    [[nodiscard]] bool available(uint32_t query) const;
};

VkResult createQueryPool(DeviceQueryPools &, VkDevice, const VkQueryPoolCreateInfo *, const VkAllocationCallbacks *,
                         VkQueryPool *);
void destroyQueryPool(DeviceQueryPools &, VkDevice, VkQueryPool, const VkAllocationCallbacks *);
void resetQueryPool(DeviceQueryPools &, VkDevice, VkQueryPool, uint32_t, uint32_t);
void cmdResetQueryPool(DeviceQueryPools &, VkCommandBuffer, VkQueryPool, uint32_t, uint32_t);
VkResult getQueryPoolResults(DeviceQueryPools &, VkDevice, VkQueryPool, uint32_t, uint32_t, size_t, void *,
                             VkDeviceSize, VkQueryResultFlags);
void cmdCopyQueryPoolResults(DeviceQueryPools &, VkCommandBuffer, VkQueryPool, uint32_t, uint32_t, VkBuffer,
                             VkDeviceSize, VkDeviceSize, VkQueryResultFlags);

void cmdWriteMicromapsProperties(DeviceQueryPools &, VkCommandBuffer, uint32_t, const VkMicromapEXT *, VkQueryType,
                                 VkQueryPool, uint32_t);
void cmdWriteAccelerationStructuresProperties(DeviceQueryPools &, VkCommandBuffer, uint32_t,
                                              const VkAccelerationStructureKHR *, VkQueryType, VkQueryPool, uint32_t);
// On the host: reports that it is not there, as for the other host commands of acceleration structures.
VkResult writeAccelerationStructuresProperties(DeviceQueryPools &, VkDevice, uint32_t,
                                               const VkAccelerationStructureKHR *, VkQueryType, size_t, void *, size_t);

} // namespace vellum::layer
