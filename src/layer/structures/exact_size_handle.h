// Handles for a driver that writes all of the handle that it builds into, whatever the build needs
// (Driver::clearsWholeHandles). An application's handle may reach over what lies behind the structure.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct AccelerationStructure;
struct DeviceStructures;

// Whether the driver is such a one, and the handle may reach over what is not the structure's: a GENERIC one does, and
// one that another begins in.
bool reachesOver(const DeviceStructures &device, const AccelerationStructure &structure);

// The handle that the driver is to build `bytes` bytes into: the application's own, or, where that one is larger and
// reaches over something else, one at the same location of just that size, which lives as long as the structure.
VkAccelerationStructureKHR exactSizeHandle(DeviceStructures &device, AccelerationStructure &structure,
                                           VkDeviceSize bytes);
// The handle that was built or copied to last at a structure's location, as far as the host knows: for what the driver
// is to read of it.
VkAccelerationStructureKHR exactSizeHandle(DeviceStructures &device, AccelerationStructure &structure);
void destroyExactSizeHandles(DeviceStructures &device, AccelerationStructure &structure);

} // namespace vellum::layer
