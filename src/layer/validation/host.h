// SPDX-License-Identifier: Apache-2.0
// The host commands of VK_EXT_opacity_micromap, and those of acceleration structures that read or write micromaps.
#pragma once

#include "layer/validation/objects.h"

namespace vellum::layer::validation
{

VkResult buildAccelerationStructures(DeviceValidation &, VkDevice, VkDeferredOperationKHR, uint32_t,
                                     const VkAccelerationStructureBuildGeometryInfoKHR *,
                                     const VkAccelerationStructureBuildRangeInfoKHR *const *);
VkResult buildMicromaps(DeviceValidation &, VkDevice, VkDeferredOperationKHR, uint32_t, const VkMicromapBuildInfoEXT *);
VkResult copyMicromap(DeviceValidation &, VkDevice, VkDeferredOperationKHR, const VkCopyMicromapInfoEXT *);
VkResult copyMicromapToMemory(DeviceValidation &, VkDevice, VkDeferredOperationKHR,
                              const VkCopyMicromapToMemoryInfoEXT *);
VkResult copyMemoryToMicromap(DeviceValidation &, VkDevice, VkDeferredOperationKHR,
                              const VkCopyMemoryToMicromapInfoEXT *);
VkResult writeMicromapsProperties(DeviceValidation &, VkDevice, uint32_t, const VkMicromapEXT *, VkQueryType, size_t,
                                  void *, size_t);
void getDeviceMicromapCompatibility(DeviceValidation &, VkDevice, const VkMicromapVersionInfoEXT *,
                                    VkAccelerationStructureCompatibilityKHR *);
VkResult copyAccelerationStructure(DeviceValidation &, VkDevice, VkDeferredOperationKHR,
                                   const VkCopyAccelerationStructureInfoKHR *);
VkResult copyMemoryToAccelerationStructure(DeviceValidation &, VkDevice, VkDeferredOperationKHR,
                                           const VkCopyMemoryToAccelerationStructureInfoKHR *);
VkResult writeAccelerationStructuresProperties(DeviceValidation &, VkDevice, uint32_t,
                                               const VkAccelerationStructureKHR *, VkQueryType, size_t, void *, size_t);

} // namespace vellum::layer::validation
