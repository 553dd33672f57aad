// SPDX-License-Identifier: Apache-2.0
// The location of a structure of vkCreateAccelerationStructure2KHR: the part of a buffer that its address range covers.
#pragma once

#include "layer/memory/address_map.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct DeviceState;
struct Driver;

struct BufferRange {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceSize offset = 0;
    VkDeviceSize size = 0;     // of the part of the range that is in the buffer
    AddressMap::Owner owner{}; // of the buffer, if it was found by an address
};
// Checks the creation. An empty range if it is rejected.
BufferRange rangeOf(const DeviceState &device, const VkAccelerationStructureCreateInfo2KHR &info);

// Creates the driver's structure: by the same command if the driver has it, and otherwise in the buffer.
VkResult createInRange(const Driver &driver, const VkAccelerationStructureCreateInfo2KHR &info,
                       const BufferRange &range, const VkAllocationCallbacks *allocator,
                       VkAccelerationStructureKHR &result);

} // namespace vellum::layer
