#include "layer/structures/fitted_handle.h"

#include <algorithm>

#include "layer/structures/device_structures.h"

namespace vellum::layer
{

bool reachesOver(const DeviceStructures &device, const AccelerationStructure &structure)
{
    return device.driver.clearsWholeHandles && (structure.type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR ||
                                                roomOf(device.objects, structure) < structure.size);
}

VkAccelerationStructureKHR fittedHandle(DeviceStructures &device, AccelerationStructure &structure, VkDeviceSize bytes)
{
    if (structure.size <= bytes || !reachesOver(device, structure))
        return structure.handle;
    std::lock_guard lock(structure.mutex);
    const auto known = std::ranges::find(structure.fitted, bytes, &AccelerationStructure::Fitted::bytes);
    if (known != structure.fitted.end())
        return known->handle;
    VkAccelerationStructureCreateInfoKHR info{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR};
    info.buffer = structure.buffer;
    info.offset = structure.offset;
    info.size = bytes;
    info.type = structure.type;
    structure.fitted.reserve(structure.fitted.size() + 1); // before the driver has made one
    VkAccelerationStructureKHR fitted = VK_NULL_HANDLE;
    if (device.driver.next.CreateAccelerationStructureKHR(device.driver.handle, &info, nullptr, &fitted) != VK_SUCCESS)
        return structure.handle;
    structure.fitted.push_back({bytes, fitted});
    return fitted;
}

VkAccelerationStructureKHR fittedHandle(DeviceStructures &device, AccelerationStructure &structure)
{
    const VkDeviceSize bytes = device.driver.clearsWholeHandles ? lastBytes(structure) : 0;
    return bytes > 0 ? fittedHandle(device, structure, bytes) : structure.handle;
}

void destroyFittedHandles(DeviceStructures &device, AccelerationStructure &structure)
{
    for (const AccelerationStructure::Fitted &fitted : structure.fitted)
        device.driver.next.DestroyAccelerationStructureKHR(device.driver.handle, fitted.handle, nullptr);
    structure.fitted.clear();
}

} // namespace vellum::layer
