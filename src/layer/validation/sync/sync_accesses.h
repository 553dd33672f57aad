// SPDX-License-Identifier: Apache-2.0
// What commands access, recorded for the tracker: nothing where `sync` is off.
#pragma once

#include <vulkan/vulkan.h>

#include "layer/base/vulkan_newer.h"

namespace vellum::layer
{

struct DeviceValidation;

namespace sync
{

void recordBuilds(DeviceValidation &, VkCommandBuffer, uint32_t count, const VkMicromapBuildInfoEXT *infos);
// `ranges`: null for indirect builds, and without ranges an element is unknown.
void recordBuilds(DeviceValidation &, VkCommandBuffer, const char *command, uint32_t count,
                  const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                  const VkAccelerationStructureBuildRangeInfoKHR *const *ranges);
// The ranges of an indirect build.
void recordIndirectRanges(DeviceValidation &, VkCommandBuffer, uint32_t count,
                          const VkAccelerationStructureBuildGeometryInfoKHR *infos, const VkDeviceAddress *addresses);

void recordCopy(DeviceValidation &, VkCommandBuffer, const VkCopyMicromapInfoEXT &);
void recordCopy(DeviceValidation &, VkCommandBuffer, const VkCopyMicromapToMemoryInfoEXT &);
void recordCopy(DeviceValidation &, VkCommandBuffer, const VkCopyMemoryToMicromapInfoEXT &);
void recordCopy(DeviceValidation &, VkCommandBuffer, const VkCopyAccelerationStructureInfoKHR &);
void recordCopy(DeviceValidation &, VkCommandBuffer, const VkCopyAccelerationStructureToMemoryInfoKHR &);
void recordCopy(DeviceValidation &, VkCommandBuffer, const VkCopyMemoryToAccelerationStructureInfoKHR &);
void recordQuery(DeviceValidation &, VkCommandBuffer, uint32_t count, const VkMicromapEXT *micromaps);
void recordQuery(DeviceValidation &, VkCommandBuffer, uint32_t count, const VkAccelerationStructureKHR *structures);

// Transfers.
void recordCopy(DeviceValidation &, VkCommandBuffer, const char *command, VkBuffer from, VkBuffer to,
                const VkBufferCopy &region, uint32_t index);
void recordWrite(DeviceValidation &, VkCommandBuffer, const char *command, VkBuffer to, VkDeviceSize offset,
                 VkDeviceSize size);
void recordCopy(DeviceValidation &, VkCommandBuffer, const VkCopyDeviceMemoryInfoKHR &);
void recordWrite(DeviceValidation &, VkCommandBuffer, const char *command, const VkDeviceAddressRangeKHR &range);

} // namespace sync
} // namespace vellum::layer
