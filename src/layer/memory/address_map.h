// Which buffer a device address lies in. Kept for every buffer whose address the application asked for; with
// VK_KHR_device_address_commands, for every buffer that has one.
#pragma once

#include <map>
#include <shared_mutex>
#include <unordered_map>
#include <vector>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

class AddressMap
{
public:
    // `usage`: as the driver knows it. Address 0 and a buffer that is known already are left out.
    void add(VkDeviceAddress address, VkBuffer buffer, VkDeviceSize size, VkFlags64 usage);
    void remove(VkBuffer buffer);
    struct Location {
        VkBuffer buffer = VK_NULL_HANDLE; // null where there is none
        VkDeviceSize offset = 0;
        VkDeviceSize bytes = 0; // to the end of the buffer
    };
    // The buffer that an address lies in, of several the one that reaches furthest: its end bounds what the GPU may
    // read from there.
    [[nodiscard]] Location find(VkDeviceAddress address) const;
    // Where a buffer lies; 0 where that is not known, as of one without memory.
    [[nodiscard]] VkDeviceAddress addressOf(VkBuffer buffer) const;
    // Bytes from `address` to the end of its buffer; UINT64_MAX where no buffer of that address is known.
    [[nodiscard]] VkDeviceSize bytesFrom(VkDeviceAddress address) const;
    // Elements of `bytes` bytes, `stride` apart, that lie between `address` and the end of its buffer; at most
    // UINT32_MAX.
    [[nodiscard]] uint32_t elementsFrom(VkDeviceAddress address, VkDeviceSize bytes, VkDeviceSize stride) const;
    // A buffer that all of a range lies in and that has all of the usage flags. Buffers may alias each other in
    // memory, and so in addresses: the one that an address came from cannot be told, any that may be used will do.
    [[nodiscard]] Location covering(VkDeviceAddress address, VkDeviceSize size, VkFlags64 usage) const;
    // What every buffer has of a range: offset, and bytes from there that lie in the range.
    [[nodiscard]] std::vector<Location> within(VkDeviceAddress address, VkDeviceSize size) const;

private:
    struct Range {
        VkBuffer buffer;
        VkDeviceAddress end;
        VkFlags64 usage;
        VkDeviceAddress reach; // the furthest end of this range and all before it: where a search may stop
    };
    using Ranges = std::multimap<VkDeviceAddress, Range>;
    void updateReach(Ranges::iterator from);
    // Calls `visit(begin, range)` for every range that holds `address`, nearest begin first, until it returns true.
    template <typename Visit>
    void visitAt(VkDeviceAddress address, Visit visit) const;

    mutable std::shared_mutex mutex_;
    Ranges ranges_;
    std::unordered_map<VkBuffer, VkDeviceAddress> addresses_;
};

} // namespace vellum::layer
