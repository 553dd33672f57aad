#include "layer/structures/fitted_handle.h"

#include <algorithm>
#include <bit>

#include "layer/structures/device_structures.h"

namespace vellum::layer
{
namespace
{

// A structure that is built for another number of instances every frame gets few handles all the same: after so many,
// sizes are rounded up by at most an eighth.
constexpr std::size_t kExactHandles = 64;

VkDeviceSize roundedUp(VkDeviceSize bytes)
{
    const VkDeviceSize step = std::max<VkDeviceSize>(std::bit_floor(bytes) / 8, 256);
    return (bytes + step - 1) / step * step;
}

} // namespace

VkAccelerationStructureKHR fittedHandle(DeviceStructures &device, AccelerationStructure &structure,
                                        VkAccelerationStructureKHR handle, VkDeviceSize bytes)
{
    if (!device.driver.clearsWholeHandles || structure.size <= bytes)
        return handle;
    std::lock_guard lock(structure.mutex);
    if (structure.fitted.size() >= kExactHandles)
        bytes = std::min(roundedUp(bytes), structure.size);
    const auto known = std::ranges::find(structure.fitted, bytes, &AccelerationStructure::Fitted::bytes);
    if (known != structure.fitted.end())
        return known->handle;
    VkAccelerationStructureCreateInfoKHR info{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR};
    info.buffer = structure.buffer;
    info.offset = structure.offset;
    info.size = bytes;
    info.type = structure.type;
    VkAccelerationStructureKHR fitted = VK_NULL_HANDLE;
    if (device.driver.next.CreateAccelerationStructureKHR(device.driver.handle, &info, nullptr, &fitted) != VK_SUCCESS)
        return handle;
    structure.fitted.push_back({bytes, fitted});
    return fitted;
}

VkAccelerationStructureKHR fittedHandle(DeviceStructures &device, VkAccelerationStructureKHR handle)
{
    const auto structure =
        device.driver.clearsWholeHandles ? device.objects.accelerationStructures.get(handle) : nullptr;
    const VkDeviceSize bytes = structure ? lastBytes(*structure) : 0;
    return bytes > 0 ? fittedHandle(device, *structure, handle, bytes) : handle;
}

void destroyFittedHandles(DeviceStructures &device, AccelerationStructure &structure)
{
    for (const AccelerationStructure::Fitted &fitted : structure.fitted)
        device.driver.next.DestroyAccelerationStructureKHR(device.driver.handle, fitted.handle, nullptr);
    structure.fitted.clear();
}

} // namespace vellum::layer
