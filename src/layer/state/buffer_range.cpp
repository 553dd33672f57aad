// SPDX-License-Identifier: Apache-2.0
#include "layer/state/buffer_range.h"

#include <algorithm>

#include "layer/input/checked.h"
#include "layer/rules/creations.h"
#include "layer/state/device_state.h"

namespace vellum::layer
{

BufferRange rangeOf(const DeviceState &device, const VkAccelerationStructureCreateInfo2KHR &info)
{
    const auto creation = input::Checked<input::Creation>::take(&info, [&] {
        const Place command("vkCreateAccelerationStructure2KHR");
        const Place place = command.member("pCreateInfo");
        return rules::checkCreation(InputCheck(device.rules, place), info);
    });
    if (!creation.accepted)
        return {};
    const auto &[address, size] = info.addressRange;
    AddressMap::Location found =
        device.buffers.addresses.covering(address, size, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR);
    if (!found.buffer)
        found = device.buffers.addresses.find(address);
    return {found.buffer, found.offset, std::min(size, found.bytes), found.owner};
}

VkResult createInRange(const Driver &driver, const VkAccelerationStructureCreateInfo2KHR &info,
                       const BufferRange &range, const VkAllocationCallbacks *allocator,
                       VkAccelerationStructureKHR &result)
{
    if (driver.next.CreateAccelerationStructure2KHR)
        return driver.next.CreateAccelerationStructure2KHR(driver.handle, &info, allocator, &result);
    VkAccelerationStructureCreateInfoKHR driverInfo{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR};
    driverInfo.pNext = info.pNext;
    driverInfo.createFlags = info.createFlags;
    driverInfo.buffer = range.buffer;
    driverInfo.offset = range.offset;
    driverInfo.size = range.size;
    // The structure has to have the address of the range. Only those of type GENERIC have that of their memory
    // (vkGetAccelerationStructureDeviceAddressKHR).
    driverInfo.type = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    return driver.next.CreateAccelerationStructureKHR(driver.handle, &driverInfo, allocator, &result);
}

} // namespace vellum::layer
