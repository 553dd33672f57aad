// Where this device has written serialized data last. The header of a serialized micromap is that of any other
// structure, and which of the driver's commands is to read it, must be known when that is recorded.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct DeviceBuffers;

class SerializedLocations
{
public:
    struct Data {
        bool isMicromap = false;
        bool isKnown = false;                     // what follows is
        std::vector<VkMicromapUsageEXT> usages{}; // of the micromap (PlacedMicromap::usages)
    };
    void set(const DeviceBuffers &device, VkDeviceAddress address, Data data);
    // What was serialized to that address; nothing where nothing was.
    [[nodiscard]] std::optional<Data> find(const DeviceBuffers &device, VkDeviceAddress address) const;

private:
    using Key = std::pair<uint64_t, VkDeviceSize>; // a buffer, by its number of all of the device, and an offset in it
    // Nothing: the address is in no known buffer.
    static std::optional<Key> keyOf(const DeviceBuffers &device, VkDeviceAddress address);
    mutable std::mutex mutex_;
    std::map<Key, Data> locations_;
};

} // namespace vellum::layer
