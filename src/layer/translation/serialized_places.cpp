#include "layer/translation/serialized_places.h"

#include "layer/memory/device_buffers.h"

namespace vellum::layer
{
namespace
{

constexpr size_t kMostPlaces = 65536;

}

SerializedPlaces::Key SerializedPlaces::keyOf(const DeviceBuffers &device, VkDeviceAddress address)
{
    const AddressMap::Place place = device.addresses.find(address);
    return {device.infos.get(place.buffer).number, place.offset};
}

void SerializedPlaces::set(const DeviceBuffers &device, VkDeviceAddress address, bool isMicromap)
{
    const Key key = keyOf(device, address);
    std::lock_guard lock(mutex_);
    // Those of buffers that are gone are not used again, and not looked for.
    if (places_.size() >= kMostPlaces)
        places_.clear();
    places_[key] = isMicromap;
}

std::optional<bool> SerializedPlaces::holdsMicromap(const DeviceBuffers &device, VkDeviceAddress address) const
{
    const Key key = keyOf(device, address);
    std::lock_guard lock(mutex_);
    const auto found = places_.find(key);
    return found == places_.end() ? std::nullopt : std::optional(found->second);
}

} // namespace vellum::layer
