// SPDX-License-Identifier: Apache-2.0
#include "layer/base/driver.h"

namespace vellum::layer
{

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
