// SPDX-License-Identifier: Apache-2.0
// The commands of acceleration structures, including micromaps of VK_KHR_opacity_micromap. The layer intercepts them on
// every device whose micromaps it emulates or translates. Each is parsed and checked here, and then recorded by the
// device's back end.
#pragma once

#include <cstdint>

#include <vulkan/vulkan.h>

#include "vellum/vulkan_opacity_micromap.h"

namespace vellum::layer
{

struct DeviceStructures;

VkResult createAccelerationStructure(DeviceStructures &, VkDevice, const VkAccelerationStructureCreateInfoKHR *,
                                     const VkAllocationCallbacks *, VkAccelerationStructureKHR *);
VkResult createAccelerationStructure2(DeviceStructures &, VkDevice, const VkAccelerationStructureCreateInfo2KHR *,
                                      const VkAllocationCallbacks *, VkAccelerationStructureKHR *);
void destroyAccelerationStructure(DeviceStructures &, VkDevice, VkAccelerationStructureKHR,
                                  const VkAllocationCallbacks *);
VkDeviceAddress getAccelerationStructureDeviceAddress(DeviceStructures &, VkDevice,
                                                      const VkAccelerationStructureDeviceAddressInfoKHR *);
VkResult getAccelerationStructureCaptureData(DeviceStructures &, VkDevice,
                                             const VkAccelerationStructureCaptureDescriptorDataInfoEXT *, void *);
void getDeviceAccelerationStructureCompatibility(DeviceStructures &, VkDevice,
                                                 const VkAccelerationStructureVersionInfoKHR *,
                                                 VkAccelerationStructureCompatibilityKHR *);

void getAccelerationStructureBuildSizes(DeviceStructures &, VkDevice, VkAccelerationStructureBuildTypeKHR,
                                        const VkAccelerationStructureBuildGeometryInfoKHR *, const uint32_t *,
                                        VkAccelerationStructureBuildSizesInfoKHR *);
void cmdBuildAccelerationStructures(DeviceStructures &, VkCommandBuffer, uint32_t,
                                    const VkAccelerationStructureBuildGeometryInfoKHR *,
                                    const VkAccelerationStructureBuildRangeInfoKHR *const *);
void cmdBuildAccelerationStructuresIndirect(DeviceStructures &, VkCommandBuffer, uint32_t,
                                            const VkAccelerationStructureBuildGeometryInfoKHR *,
                                            const VkDeviceAddress *, const uint32_t *, const uint32_t *const *);
void cmdCopyAccelerationStructure(DeviceStructures &, VkCommandBuffer, const VkCopyAccelerationStructureInfoKHR *);
void cmdCopyAccelerationStructureToMemory(DeviceStructures &, VkCommandBuffer,
                                          const VkCopyAccelerationStructureToMemoryInfoKHR *);
void cmdCopyMemoryToAccelerationStructure(DeviceStructures &, VkCommandBuffer,
                                          const VkCopyMemoryToAccelerationStructureInfoKHR *);

// Host commands. The driver alone would lose the records of emulated micromaps, and the host cannot build or copy
// micromaps of VK_KHR_opacity_micromap: these commands report that they are not available.
VkResult buildAccelerationStructures(DeviceStructures &, VkDevice, VkDeferredOperationKHR, uint32_t,
                                     const VkAccelerationStructureBuildGeometryInfoKHR *,
                                     const VkAccelerationStructureBuildRangeInfoKHR *const *);
VkResult copyAccelerationStructure(DeviceStructures &, VkDevice, VkDeferredOperationKHR,
                                   const VkCopyAccelerationStructureInfoKHR *);
VkResult copyAccelerationStructureToMemory(DeviceStructures &, VkDevice, VkDeferredOperationKHR,
                                           const VkCopyAccelerationStructureToMemoryInfoKHR *);
VkResult copyMemoryToAccelerationStructure(DeviceStructures &, VkDevice, VkDeferredOperationKHR,
                                           const VkCopyMemoryToAccelerationStructureInfoKHR *);

} // namespace vellum::layer
