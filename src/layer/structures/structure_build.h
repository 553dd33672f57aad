// Builds and updates of acceleration structures: the patched instances and the records around the driver's build.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

VKAPI_ATTR void VKAPI_CALL cmdBuildAccelerationStructures(VkCommandBuffer, uint32_t,
                                                          const VkAccelerationStructureBuildGeometryInfoKHR *,
                                                          const VkAccelerationStructureBuildRangeInfoKHR *const *);

// Not there yet: each reports so and does nothing, since the driver alone would build what shaders then misread.
VKAPI_ATTR void VKAPI_CALL cmdBuildAccelerationStructuresIndirect(VkCommandBuffer, uint32_t,
                                                                  const VkAccelerationStructureBuildGeometryInfoKHR *,
                                                                  const VkDeviceAddress *, const uint32_t *,
                                                                  const uint32_t *const *);
VKAPI_ATTR VkResult VKAPI_CALL buildAccelerationStructures(VkDevice, VkDeferredOperationKHR, uint32_t,
                                                           const VkAccelerationStructureBuildGeometryInfoKHR *,
                                                           const VkAccelerationStructureBuildRangeInfoKHR *const *);

} // namespace vellum::layer
