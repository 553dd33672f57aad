// SPDX-License-Identifier: Apache-2.0
// What commands access, recorded for the tracker: nothing where `sync` is off.
#pragma once

#include <memory>
#include <vector>

#include <vulkan/vulkan.h>

#include "vk/newer.h"

namespace vellum::layer
{

struct DeviceValidation;
struct ValidatedStructure;

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

// Copies and queries of structures and micromaps. A null one is unknown.
void recordCopy(DeviceValidation &, VkCommandBuffer, const char *command,
                const std::shared_ptr<ValidatedStructure> &source, const std::shared_ptr<ValidatedStructure> &target);
void recordSerialization(DeviceValidation &, VkCommandBuffer, const char *command,
                         const std::shared_ptr<ValidatedStructure> &source, VkDeviceAddress target);
void recordDeserialization(DeviceValidation &, VkCommandBuffer, const char *command, VkDeviceAddress source,
                           const std::shared_ptr<ValidatedStructure> &target);
void recordQuery(DeviceValidation &, VkCommandBuffer, const char *command, const char *array,
                 const std::vector<std::shared_ptr<ValidatedStructure>> &structures);

// Transfers.
void recordCopy(DeviceValidation &, VkCommandBuffer, const char *command, VkBuffer from, VkBuffer to,
                const VkBufferCopy &region, uint32_t index);
void recordWrite(DeviceValidation &, VkCommandBuffer, const char *command, VkBuffer to, VkDeviceSize offset,
                 VkDeviceSize size);
void recordCopy(DeviceValidation &, VkCommandBuffer, const VkCopyDeviceMemoryInfoKHR &);
void recordWrite(DeviceValidation &, VkCommandBuffer, const char *command, const VkDeviceAddressRangeKHR &range);

} // namespace sync
} // namespace vellum::layer
