// Acceleration structures as objects: what creating and destroying them, and asking for sizes and addresses, has to do
// beside the driver's own work.
#pragma once

#include <cstdint>

#include "layer/ground/vulkan_newer.h"

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
void getAccelerationStructureBuildSizes(DeviceStructures &, VkDevice, VkAccelerationStructureBuildTypeKHR,
                                        const VkAccelerationStructureBuildGeometryInfoKHR *, const uint32_t *,
                                        VkAccelerationStructureBuildSizesInfoKHR *);

} // namespace vellum::layer
