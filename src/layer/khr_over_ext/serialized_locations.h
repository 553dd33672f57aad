// SPDX-License-Identifier: Apache-2.0
// The locations of data that this device has serialized. A serialized micromap has the same header as other structures,
// and the choice of the driver's command that deserializes it is made when that is recorded.
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
        bool isKnown = false;                     // `usages` is valid
        std::vector<VkMicromapUsageEXT> usages{}; // PlacedMicromap::usages
    };
    void set(const DeviceBuffers &device, VkDeviceAddress address, Data data);
    // The data that was serialized to that address.
    [[nodiscard]] std::optional<Data> find(const DeviceBuffers &device, VkDeviceAddress address) const;

private:
    using Key = std::pair<uint64_t, VkDeviceSize>; // the number of a buffer, and an offset in it
    // nullopt: the address is in no known buffer.
    static std::optional<Key> keyOf(const DeviceBuffers &device, VkDeviceAddress address);
    mutable std::mutex mutex_;
    std::map<Key, Data> locations_;
};

} // namespace vellum::layer
