#include "layer/translation/serialized_places.h"

#include "layer/memory/device_buffers.h"

namespace vellum::layer
{
namespace
{

constexpr size_t kMostPlaces = 65536;

}

std::optional<SerializedPlaces::Key> SerializedPlaces::keyOf(const DeviceBuffers &device, VkDeviceAddress address)
{
    const AddressMap::Place place = device.addresses.find(address);
    if (!place.buffer)
        return std::nullopt;
    return Key{device.infos.get(place.buffer).number, place.offset};
}

void SerializedPlaces::set(const DeviceBuffers &device, VkDeviceAddress address, Data data)
{
    const std::optional<Key> key = keyOf(device, address);
    if (!key)
        return;
    std::lock_guard lock(mutex_);
    // Those of buffers that are gone are not used again, and not looked for.
    if (places_.size() >= kMostPlaces)
        places_.clear();
    places_[*key] = std::move(data);
}

std::optional<SerializedPlaces::Data> SerializedPlaces::find(const DeviceBuffers &device, VkDeviceAddress address) const
{
    const std::optional<Key> key = keyOf(device, address);
    std::lock_guard lock(mutex_);
    const auto found = key ? places_.find(*key) : places_.end();
    return found == places_.end() ? std::nullopt : std::optional(found->second);
}

} // namespace vellum::layer
