// SPDX-License-Identifier: Apache-2.0
// vkCmdTraceRays*: hits through a null hit record, or beyond the end of the hit table, still look up micromaps.
// Pipelines that use micromaps trace with a copy of the table in which a hit record of the layer replaces these.
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
