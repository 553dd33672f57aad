// SPDX-License-Identifier: Apache-2.0
#include "layer/state/buffer_range.h"

#include <algorithm>
#include <string>

#include "layer/base/command_check.h"
#include "layer/rules/ids.h"
#include "layer/state/device_state.h"

namespace vellum::layer
{

BufferRange rangeOf(const DeviceState &device, const VkAccelerationStructureCreateInfo2KHR &info,
                    VkDeviceSize micromapAlignment)
{
    const CommandCheck check(device.driver.report(), "vkCreateAccelerationStructure2KHR");
    const bool micromap = info.type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
    const auto &[address, size] = info.addressRange;
    if (size == 0) {
        check.reject(rules::ids::kCreationRangeEmpty, "addressRange is empty");
        return {};
    }
    if (micromap && !device.driver.enabled.khrFeature &&
        !check.tolerate(rules::ids::kCreationFeature,
                        "the feature VkPhysicalDeviceOpacityMicromapFeaturesKHR::micromap is not enabled"))
        return {};
    AddressMap::Location found =
        device.buffers.addresses.covering(address, size, VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR);
    if (!found.buffer) {
        found = device.buffers.addresses.find(address);
        if (!found.buffer) {
            check.reject(rules::ids::kCreationRangeUnknown, "addressRange.address is not in any buffer");
            return {};
        }
        // Drivers do not depend on the usage, and the part in the buffer may be large enough for the build.
        if (!check.tolerate(rules::ids::kCreationRangeUsage,
                            "addressRange, of " + std::to_string(size) +
                                " bytes, is not in one buffer for acceleration structures"))
            return {};
    }
    // The layer's shaders read and write 16 bytes at once. What drivers need is unknown.
    if (address % 256 != 0 &&
        !check.tolerateIf(micromap && address % micromapAlignment == 0, rules::ids::kCreationRangeAlignment,
                          "addressRange.address is not a multiple of 256"))
        return {};
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
    driverInfo.type = info.type;
    return driver.next.CreateAccelerationStructureKHR(driver.handle, &driverInfo, allocator, &result);
}

} // namespace vellum::layer
