// SPDX-License-Identifier: Apache-2.0
#include "layer/structures/exact_size_handle.h"

#include <algorithm>

#include "layer/structures/device_structures.h"

namespace vellum::layer
{

bool reachesOver(const DeviceStructures &device, const AccelerationStructure &structure)
{
    return device.driver.clearsWholeHandles && (structure.type != VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR ||
                                                capacityOf(device.objects, structure) < structure.size);
}

VkAccelerationStructureKHR exactSizeHandleOrNull(DeviceStructures &device, AccelerationStructure &structure,
                                                 VkDeviceSize bytes)
{
    if (structure.size <= bytes || !reachesOver(device, structure))
        return structure.handle;
    std::lock_guard lock(structure.mutex);
    const auto known =
        std::ranges::find(structure.exactSizeHandles, bytes, &AccelerationStructure::ExactSizeHandle::bytes);
    if (known != structure.exactSizeHandles.end())
        return known->handle;
    VkAccelerationStructureCreateInfoKHR info{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR};
    info.buffer = structure.buffer;
    info.offset = structure.offset;
    info.size = bytes;
    info.type = structure.type;
    structure.exactSizeHandles.reserve(structure.exactSizeHandles.size() + 1); // allocate before the driver creates one
    VkAccelerationStructureKHR exact = VK_NULL_HANDLE;
    if (device.driver.next.CreateAccelerationStructureKHR(device.driver.handle, &info, nullptr, &exact) != VK_SUCCESS)
        return VK_NULL_HANDLE;
    structure.exactSizeHandles.push_back({bytes, exact});
    return exact;
}

VkAccelerationStructureKHR exactSizeHandle(DeviceStructures &device, AccelerationStructure &structure,
                                           VkDeviceSize bytes)
{
    const VkAccelerationStructureKHR exact = exactSizeHandleOrNull(device, structure, bytes);
    return exact ? exact : structure.handle;
}

VkAccelerationStructureKHR exactSizeHandle(DeviceStructures &device, AccelerationStructure &structure)
{
    const VkDeviceSize bytes = device.driver.clearsWholeHandles ? lastBytes(structure) : 0;
    return bytes > 0 ? exactSizeHandle(device, structure, bytes) : structure.handle;
}

void destroyExactSizeHandles(DeviceStructures &device, AccelerationStructure &structure)
{
    for (const AccelerationStructure::ExactSizeHandle &exact : structure.exactSizeHandles)
        device.driver.next.DestroyAccelerationStructureKHR(device.driver.handle, exact.handle, nullptr);
    structure.exactSizeHandles.clear();
}

} // namespace vellum::layer
