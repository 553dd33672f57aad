// Builds and updates of acceleration structures: the patched instances and the records around the driver's build.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct DeviceStructures;

void cmdBuildAccelerationStructures(DeviceStructures &, VkCommandBuffer, uint32_t,
                                    const VkAccelerationStructureBuildGeometryInfoKHR *,
                                    const VkAccelerationStructureBuildRangeInfoKHR *const *);

// Not there yet: each reports so and does nothing, since the driver alone would build what shaders then misread.
void cmdBuildAccelerationStructuresIndirect(DeviceStructures &, VkCommandBuffer, uint32_t,
                                            const VkAccelerationStructureBuildGeometryInfoKHR *,
                                            const VkDeviceAddress *, const uint32_t *, const uint32_t *const *);
VkResult buildAccelerationStructures(DeviceStructures &, VkDevice, VkDeferredOperationKHR, uint32_t,
                                     const VkAccelerationStructureBuildGeometryInfoKHR *,
                                     const VkAccelerationStructureBuildRangeInfoKHR *const *);

} // namespace vellum::layer
