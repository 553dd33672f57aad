// Acceleration structures as objects: what vkCreate/DestroyAccelerationStructureKHR and the queries of sizes and
// addresses have to do beside the driver's own work, and what builds and copies share. Builds: structure_build.h,
// copies: structure_copy.h.
#pragma once

#include <cstdint>
#include <memory>

#include <vulkan/vulkan.h>

#include "layer/objects/root_table.h"

namespace vellum::layer
{

struct AccelerationStructure;
struct Device;

// Makes the structure a user of its reference's cell, if it is none yet. Address 0: no memory.
CellPlace cellOf(Device &device, AccelerationStructure &structure, VkAccelerationStructureKHR handle);

// The slots that a build of `count` instances into this structure uses: those it has, unless they are too few. Work
// recorded before may still write or read the old ones, so they stay with the structure; growing by half keeps them
// few. Null where there are none left.
std::shared_ptr<SlotRange> slotsFor(Device &device, AccelerationStructure &structure, uint32_t count);

VkDeviceAddress beginOf(const Device &device, const AccelerationStructure &structure);

// Bytes as a number of 16-byte units for shaders, rounded down; UINT32_MAX where they are more.
uint32_t unitsOf(VkDeviceSize bytes);

// Sends messages about what shaders found wrong with copies that were executed in the meantime.
void reportNotices(Device &device);

VKAPI_ATTR VkResult VKAPI_CALL createAccelerationStructure(VkDevice, const VkAccelerationStructureCreateInfoKHR *,
                                                           const VkAllocationCallbacks *, VkAccelerationStructureKHR *);
VKAPI_ATTR void VKAPI_CALL destroyAccelerationStructure(VkDevice, VkAccelerationStructureKHR,
                                                        const VkAllocationCallbacks *);
VKAPI_ATTR VkDeviceAddress VKAPI_CALL
getAccelerationStructureDeviceAddress(VkDevice, const VkAccelerationStructureDeviceAddressInfoKHR *);
VKAPI_ATTR void VKAPI_CALL getAccelerationStructureBuildSizes(VkDevice, VkAccelerationStructureBuildTypeKHR,
                                                              const VkAccelerationStructureBuildGeometryInfoKHR *,
                                                              const uint32_t *,
                                                              VkAccelerationStructureBuildSizesInfoKHR *);

} // namespace vellum::layer
