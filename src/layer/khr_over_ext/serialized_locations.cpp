// SPDX-License-Identifier: Apache-2.0
#include "layer/khr_over_ext/serialized_locations.h"

#include "layer/memory/device_buffers.h"

namespace vellum::layer
{
namespace
{

constexpr size_t kMostLocations = 65536;

}

std::optional<SerializedLocations::Key> SerializedLocations::keyOf(const DeviceBuffers &device, VkDeviceAddress address)
{
    const AddressMap::Location location = device.addresses.find(address);
    if (!location.buffer)
        return std::nullopt;
    return Key{device.infos.get(location.buffer).number, location.offset};
}

void SerializedLocations::set(const DeviceBuffers &device, VkDeviceAddress address, Data data)
{
    const std::optional<Key> key = keyOf(device, address);
    if (!key)
        return;
    std::lock_guard lock(mutex_);
    // Locations in destroyed buffers remain in the map, but their keys are not used again.
    if (locations_.size() >= kMostLocations)
        locations_.clear();
    locations_[*key] = std::move(data);
}

std::optional<SerializedLocations::Data> SerializedLocations::find(const DeviceBuffers &device,
                                                                   VkDeviceAddress address) const
{
    const std::optional<Key> key = keyOf(device, address);
    std::lock_guard lock(mutex_);
    const auto found = key ? locations_.find(*key) : locations_.end();
    return found == locations_.end() ? std::nullopt : std::optional(found->second);
}

} // namespace vellum::layer
