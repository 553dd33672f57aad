// SPDX-License-Identifier: Apache-2.0
// The host commands of micromaps (feature micromapHostCommands). They write what the device would
// (core/micromap_memory.h). A deferred operation is carried out at once, and the commands return
// VK_OPERATION_NOT_DEFERRED_KHR.
#pragma once

#include <cstddef>
#include <cstdint>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct DeviceMicromaps;

VkResult buildMicromaps(DeviceMicromaps &, VkDevice, VkDeferredOperationKHR, uint32_t, const VkMicromapBuildInfoEXT *);
VkResult copyMicromap(DeviceMicromaps &, VkDevice, VkDeferredOperationKHR, const VkCopyMicromapInfoEXT *);
VkResult copyMicromapToMemory(DeviceMicromaps &, VkDevice, VkDeferredOperationKHR,
                              const VkCopyMicromapToMemoryInfoEXT *);
VkResult copyMemoryToMicromap(DeviceMicromaps &, VkDevice, VkDeferredOperationKHR,
                              const VkCopyMemoryToMicromapInfoEXT *);
VkResult writeMicromapsProperties(DeviceMicromaps &, VkDevice, uint32_t, const VkMicromapEXT *, VkQueryType, size_t,
                                  void *, size_t);

} // namespace vellum::layer
