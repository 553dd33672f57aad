// Acceleration structures: what vkCreate/Destroy/BuildAccelerationStructure(s)KHR have to do beside the driver's own
// work.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

VKAPI_ATTR VkResult VKAPI_CALL createAccelerationStructure(VkDevice, const VkAccelerationStructureCreateInfoKHR *,
                                                           const VkAllocationCallbacks *, VkAccelerationStructureKHR *);
VKAPI_ATTR void VKAPI_CALL destroyAccelerationStructure(VkDevice, VkAccelerationStructureKHR,
                                                        const VkAllocationCallbacks *);
VKAPI_ATTR void VKAPI_CALL getAccelerationStructureBuildSizes(VkDevice, VkAccelerationStructureBuildTypeKHR,
                                                              const VkAccelerationStructureBuildGeometryInfoKHR *,
                                                              const uint32_t *,
                                                              VkAccelerationStructureBuildSizesInfoKHR *);
VKAPI_ATTR void VKAPI_CALL cmdBuildAccelerationStructures(VkCommandBuffer, uint32_t,
                                                          const VkAccelerationStructureBuildGeometryInfoKHR *,
                                                          const VkAccelerationStructureBuildRangeInfoKHR *const *);

VKAPI_ATTR void VKAPI_CALL cmdCopyAccelerationStructure(VkCommandBuffer, const VkCopyAccelerationStructureInfoKHR *);
VKAPI_ATTR void VKAPI_CALL cmdCopyMemoryToAccelerationStructure(VkCommandBuffer,
                                                                const VkCopyMemoryToAccelerationStructureInfoKHR *);
VKAPI_ATTR void VKAPI_CALL cmdCopyAccelerationStructureToMemory(VkCommandBuffer,
                                                                const VkCopyAccelerationStructureToMemoryInfoKHR *);

// Not there yet: each reports so and does nothing, since the driver alone would build what shaders then misread.
VKAPI_ATTR void VKAPI_CALL cmdBuildAccelerationStructuresIndirect(VkCommandBuffer, uint32_t,
                                                                  const VkAccelerationStructureBuildGeometryInfoKHR *,
                                                                  const VkDeviceAddress *, const uint32_t *,
                                                                  const uint32_t *const *);
VKAPI_ATTR VkResult VKAPI_CALL buildAccelerationStructures(VkDevice, VkDeferredOperationKHR, uint32_t,
                                                           const VkAccelerationStructureBuildGeometryInfoKHR *,
                                                           const VkAccelerationStructureBuildRangeInfoKHR *const *);

} // namespace vellum::layer
