// vkCmdTraceRays*: a hit record with a null handle has no shaders, but the micromaps of what it is hit through still
// count. For pipelines that use micromaps the records are copied, with a group of the layer's in the place of null.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct DevicePipelines;

void cmdTraceRays(DevicePipelines &, VkCommandBuffer, const VkStridedDeviceAddressRegionKHR *,
                  const VkStridedDeviceAddressRegionKHR *, const VkStridedDeviceAddressRegionKHR *,
                  const VkStridedDeviceAddressRegionKHR *, uint32_t, uint32_t, uint32_t);
void cmdTraceRaysIndirect(DevicePipelines &, VkCommandBuffer, const VkStridedDeviceAddressRegionKHR *,
                          const VkStridedDeviceAddressRegionKHR *, const VkStridedDeviceAddressRegionKHR *,
                          const VkStridedDeviceAddressRegionKHR *, VkDeviceAddress);
void cmdTraceRaysIndirect2(DevicePipelines &, VkCommandBuffer, VkDeviceAddress);

} // namespace vellum::layer
