// SPDX-License-Identifier: Apache-2.0
#include "layer/base/driver.h"

#include <cstring>

#include "layer/base/pnext.h"

namespace vellum::layer
{

bool enablesExtension(const VkDeviceCreateInfo &info, const char *extension)
{
    for (uint32_t i = 0; i < info.enabledExtensionCount; ++i) {
        if (std::strcmp(info.ppEnabledExtensionNames[i], extension) == 0)
            return true;
    }
    return false;
}

bool isGroup(const VkDeviceCreateInfo &info)
{
    const auto *group =
        findInChain<VkDeviceGroupDeviceCreateInfo>(info.pNext, VK_STRUCTURE_TYPE_DEVICE_GROUP_DEVICE_CREATE_INFO);
    return group && group->physicalDeviceCount > 1;
}

VkDeviceAddress Driver::bufferAddress(VkBuffer buffer) const
{
    const VkBufferDeviceAddressInfo info{VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO, nullptr, buffer};
    return next.GetBufferDeviceAddress(handle, &info);
}

VkDeviceAddress Driver::structureAddress(VkAccelerationStructureKHR structure) const
{
    const VkAccelerationStructureDeviceAddressInfoKHR info{
        VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR, nullptr, structure};
    return next.GetAccelerationStructureDeviceAddressKHR(handle, &info);
}

} // namespace vellum::layer
