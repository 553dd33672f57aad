// SPDX-License-Identifier: Apache-2.0
// Handles for a driver that writes the whole range of the handle that it builds into, whatever the build needs
// (Driver::clearsWholeHandles). The range of an application's handle may include data after the structure.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct AccelerationStructure;
struct DeviceStructures;

// Returns whether the driver is one of these, and the handle's range may include other data: it is GENERIC, another
// structure begins in it, or it is top-level and includes the tail, which the driver builds from.
bool reachesOver(const DeviceStructures &device, const AccelerationStructure &structure);

// The handle for the driver's build of `bytes` bytes: the application's, or, if that is larger and includes other data,
// a handle of exactly that size at the same location, which lives as long as the structure. Null if the driver cannot
// create one; the second function returns the application's then.
VkAccelerationStructureKHR exactSizeHandleOrNull(DeviceStructures &device, AccelerationStructure &structure,
                                                 VkDeviceSize bytes);
VkAccelerationStructureKHR exactSizeHandle(DeviceStructures &device, AccelerationStructure &structure,
                                           VkDeviceSize bytes);
// The handle that was built or copied to last at a structure's location, as far as the host knows: the driver reads
// from this one.
VkAccelerationStructureKHR exactSizeHandle(DeviceStructures &device, AccelerationStructure &structure);
void destroyExactSizeHandles(DeviceStructures &device, AccelerationStructure &structure);

} // namespace vellum::layer
