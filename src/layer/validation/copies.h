// SPDX-License-Identifier: Apache-2.0
// Copies of micromaps and acceleration structures, to each other and to memory.
#pragma once

#include <memory>

#include "layer/validation/objects.h"
#include "layer/validation/rules/rule_check.h"

namespace vellum::layer
{

// The effect of a clone or a compaction.
void copied(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &source,
            const std::shared_ptr<ValidatedStructure> &target);
// The effect of a deserialization: the target holds something that the host does not know. `header`: null if it is not
// known.
void deserialized(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &target,
                  std::shared_ptr<SerializedHeader> header);

namespace validation
{

void cmdCopyMicromap(DeviceValidation &, VkCommandBuffer, const VkCopyMicromapInfoEXT *);
void cmdCopyMicromapToMemory(DeviceValidation &, VkCommandBuffer, const VkCopyMicromapToMemoryInfoEXT *);
void cmdCopyMemoryToMicromap(DeviceValidation &, VkCommandBuffer, const VkCopyMemoryToMicromapInfoEXT *);
void cmdCopyAccelerationStructure(DeviceValidation &, VkCommandBuffer, const VkCopyAccelerationStructureInfoKHR *);
void cmdCopyAccelerationStructureToMemory(DeviceValidation &, VkCommandBuffer,
                                          const VkCopyAccelerationStructureToMemoryInfoKHR *);
void cmdCopyMemoryToAccelerationStructure(DeviceValidation &, VkCommandBuffer,
                                          const VkCopyMemoryToAccelerationStructureInfoKHR *);

} // namespace validation
} // namespace vellum::layer
