// SPDX-License-Identifier: Apache-2.0
// Queries of the sizes of micromaps and acceleration structures.
#pragma once

#include "layer/validation/objects.h"

namespace vellum::layer::validation
{

VkResult createQueryPool(DeviceValidation &, VkDevice, const VkQueryPoolCreateInfo *, const VkAllocationCallbacks *,
                         VkQueryPool *);
void destroyQueryPool(DeviceValidation &, VkDevice, VkQueryPool, const VkAllocationCallbacks *);
void resetQueryPool(DeviceValidation &, VkDevice, VkQueryPool, uint32_t, uint32_t);
void cmdResetQueryPool(DeviceValidation &, VkCommandBuffer, VkQueryPool, uint32_t, uint32_t);
void cmdBeginQuery(DeviceValidation &, VkCommandBuffer, VkQueryPool, uint32_t, VkQueryControlFlags);
void cmdBeginQueryIndexed(DeviceValidation &, VkCommandBuffer, VkQueryPool, uint32_t, VkQueryControlFlags, uint32_t);
void cmdWriteMicromapsProperties(DeviceValidation &, VkCommandBuffer, uint32_t, const VkMicromapEXT *, VkQueryType,
                                 VkQueryPool, uint32_t);
void cmdWriteAccelerationStructuresProperties(DeviceValidation &, VkCommandBuffer, uint32_t,
                                              const VkAccelerationStructureKHR *, VkQueryType, VkQueryPool, uint32_t);

} // namespace vellum::layer::validation
