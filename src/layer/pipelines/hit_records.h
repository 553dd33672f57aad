// vkCmdTraceRays*: hits without a shader of the application's, through a null hit record or through none at all, still
// look up micromaps. Pipelines that use micromaps trace with hit tables in which a record of the layer's stands in.
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
