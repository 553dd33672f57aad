#include "layer/address/address_lookup.h"

#include <cinttypes>
#include <cstdio>

#include "layer/memory/device_buffers.h"

namespace vellum::layer
{

void AddressLookup::refuse(const std::string &id, const std::string &text) const
{
    device_.driver.report().error(id.c_str(), std::string(command_) + ": " + text + "; " + otherwise_,
                                  VK_OBJECT_TYPE_COMMAND_BUFFER, reinterpret_cast<uint64_t>(commandBuffer_));
}

std::optional<AddressLookup::Found> AddressLookup::find(const VkDeviceAddressRangeKHR &range, const Need &need,
                                                        const char *structure) const
{
    const auto refuseRange = [&](const std::string &id, const char *what) {
        char text[256];
        std::snprintf(text, sizeof text, "%s (element %" PRIu32 "), %" PRIu64 " bytes at address 0x%" PRIx64 ", %s",
                      need.member, need.index, range.size, range.address, what);
        refuse(id, text);
        return std::nullopt;
    };
    const auto vuid = [structure](const char *rule) { return std::string("VELLUM-VUID-") + structure + rule; };
    if (range.address == 0)
        return refuseRange(vuid("-size-11411"), "is a null range");
    if (range.size < need.least)
        return refuseRange(need.leastId, "is smaller than what the command accesses");
    const AddressMap::Place place = device_.addresses.covering(range.address, range.size, need.usage);
    if (place.buffer)
        return Found{place.buffer, place.offset};
    if (device_.addresses.covering(range.address, range.size, 0).buffer)
        return refuseRange(need.usageId, "lies in no buffer with the usage that the command needs");
    return refuseRange(vuid("-address-11365"), "does not lie in one buffer");
}

std::optional<AddressLookup::Found> AddressLookup::find(const VkDeviceAddressRangeKHR &range, const Need &need) const
{
    return find(range, need, "VkDeviceAddressRangeKHR");
}

std::optional<AddressLookup::Found> AddressLookup::find(const VkStridedDeviceAddressRangeKHR &range,
                                                        const Need &need) const
{
    return find({range.address, range.size}, need, "VkStridedDeviceAddressRangeKHR");
}

} // namespace vellum::layer
