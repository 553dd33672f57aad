// SPDX-License-Identifier: Apache-2.0
#include "layer/khr_over_ext/placed_micromaps.h"

#include <algorithm>

#include "layer/khr_over_ext/device_khr_over_ext.h"

namespace vellum::layer
{
namespace
{

PlacedMicromaps &locationOf(DeviceKhrOverExt &device, const AccelerationStructure &structure)
{
    std::lock_guard lock(structure.location->mutex);
    auto &micromaps = structure.location->driverMicromaps;
    if (!micromaps)
        micromaps = std::make_shared<PlacedMicromaps>(device.driver);
    return *micromaps;
}

} // namespace

PlacedMicromaps::~PlacedMicromaps()
{
    for (const auto &[bytes, handle] : micromaps_)
        driver_.next.DestroyMicromapEXT(driver_.handle, handle, nullptr);
}

VkMicromapEXT PlacedMicromaps::ofSize(VkBuffer buffer, VkDeviceSize offset, VkDeviceSize bytes)
{
    std::lock_guard lock(mutex_);
    for (const auto &[size, handle] : micromaps_) {
        if (size == bytes)
            return handle;
    }
    VkMicromapCreateInfoEXT info{VK_STRUCTURE_TYPE_MICROMAP_CREATE_INFO_EXT};
    info.buffer = buffer;
    info.offset = offset;
    info.size = bytes;
    info.type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT;
    micromaps_.reserve(micromaps_.size() + 1); // allocate before the driver creates one
    VkMicromapEXT handle = VK_NULL_HANDLE;
    if (driver_.next.CreateMicromapEXT(driver_.handle, &info, nullptr, &handle) != VK_SUCCESS)
        return VK_NULL_HANDLE;
    micromaps_.emplace_back(bytes, handle);
    return handle;
}

void PlacedMicromaps::record(PlacedMicromap micromap)
{
    std::lock_guard lock(mutex_);
    for (const VkMicromapUsageEXT &usage : micromap.usages) {
        if (std::ranges::none_of(usages_, [&](const VkMicromapUsageEXT &other) {
                return other.subdivisionLevel == usage.subdivisionLevel && other.format == usage.format;
            }))
            usages_.push_back(usage);
    }
    last_ = std::move(micromap);
    last_.usages = last_.isKnown ? usages_ : std::vector<VkMicromapUsageEXT>{};
}

PlacedMicromap PlacedMicromaps::last() const
{
    std::lock_guard lock(mutex_);
    return last_;
}

bool allowsMicromapAt(const DeviceKhrOverExt &device, VkBuffer buffer, VkDeviceSize offset)
{
    const VkDeviceAddress address = device.buffers.addresses.addressOf(buffer);
    return offset % 256 == 0 || (address != 0 && (address + offset) % 256 == 0);
}

VkMicromapEXT micromapOfSize(DeviceKhrOverExt &device, const AccelerationStructure &structure, VkDeviceSize bytes)
{
    // Null if neither extension is enabled. A structure that was created by an address is where a micromap may be.
    if (!device.driver.next.CreateMicromapEXT ||
        (!structure.bufferOwner && !allowsMicromapAt(device, structure.buffer, structure.offset)))
        return VK_NULL_HANDLE;
    return locationOf(device, structure).ofSize(structure.buffer, structure.offset, bytes);
}

PlacedMicromap lastMicromap(DeviceKhrOverExt &device, const AccelerationStructure &structure)
{
    PlacedMicromap micromap = locationOf(device, structure).last();
    if (!micromap.handle) {
        micromap.bytes = capacityOf(device.objects, structure);
        micromap.handle = micromapOfSize(device, structure, micromap.bytes);
    }
    return micromap;
}

bool checkDriverMicromap(const DeviceKhrOverExt &device, const char *command, const AccelerationStructure &structure,
                         VkMicromapEXT micromap)
{
    return micromap || rejectCommand(device.driver, command, structure.handle, "VELLUM-out-of-memory",
                                     "the driver could not make a micromap");
}

void setDriverMicromap(DeviceKhrOverExt &device, AccelerationStructure &structure, PlacedMicromap micromap)
{
    becomes(structure, VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR, micromap.bytes);
    locationOf(device, structure).record(std::move(micromap));
}

} // namespace vellum::layer
