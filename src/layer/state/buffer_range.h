// Where vkCreateAccelerationStructure2KHR wants a structure: the part of a buffer that an address range is.
#pragma once

#include "layer/base/vulkan_newer.h"

namespace vellum::layer
{

struct DeviceState;
struct Driver;

struct BufferRange {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceSize offset = 0;
    VkDeviceSize size = 0; // as much of the range as lies in the buffer
};
// Null after a message. `micromapAlignment`: that addresses of micromaps need at least.
BufferRange rangeOf(const DeviceState &device, const VkAccelerationStructureCreateInfo2KHR &info,
                    VkDeviceSize micromapAlignment);

// Lets the driver make the structure: by the same command where it has it, and otherwise in the buffer.
VkResult createInRange(const Driver &driver, const VkAccelerationStructureCreateInfo2KHR &info,
                       const BufferRange &range, const VkAllocationCallbacks *allocator,
                       VkAccelerationStructureKHR &result);

} // namespace vellum::layer
