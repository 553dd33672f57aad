// SPDX-License-Identifier: Apache-2.0
#include "layer/device_address/address_lookup.h"

#include <algorithm>
#include <cinttypes>
#include <cstdio>

#include "layer/device_address/device_addresses.h"

namespace vellum::layer
{

void AddressLookup::reject(const char *id, const std::string &text) const
{
    device_.driver.report().error(id, std::string(command_) + ": " + text + "; " + otherwise_,
                                  VK_OBJECT_TYPE_COMMAND_BUFFER, reinterpret_cast<uint64_t>(commandBuffer_));
}

bool AddressLookup::tolerateIf(bool harmless, const char *id, const std::string &text) const
{
    if (harmless)
        return device_.driver.report().tolerates(id, std::string(command_) + ": " + text, VK_OBJECT_TYPE_COMMAND_BUFFER,
                                                 reinterpret_cast<uint64_t>(commandBuffer_));
    reject(id, text);
    return false;
}

AddressLookup::Found AddressLookup::keep(const AddressMap::Location &location, VkDeviceSize size) const
{
    device_.commands.states.keep(commandBuffer_, location.owner);
    return {location.buffer, location.offset, size};
}

std::optional<AddressLookup::Found> AddressLookup::find(const VkDeviceAddressRangeKHR &range, const Need &need,
                                                        const rules::AnyRange &ids) const
{
    const auto tolerate = [&](bool harmless, const char *id, const char *what) {
        char text[256];
        std::snprintf(text, sizeof text, "%s (element %" PRIu32 "), %" PRIu64 " bytes at address 0x%" PRIx64 ", %s",
                      need.member, need.index, range.size, range.address, what);
        return tolerateIf(harmless, id, text);
    };
    if (range.address == 0) {
        tolerate(false, ids.null, "is a null range");
        return std::nullopt;
    }
    const AddressMap &addresses = device_.buffers.addresses;
    const VkDeviceSize least = need.least > 0 ? need.least : need.range.least;
    const VkDeviceSize size = std::max(range.size, least);
    if (range.size < least &&
        !tolerate(range.size > 0 && addresses.covering(range.address, least, 0).buffer,
                  need.leastId ? need.leastId : need.range.leastId, "is smaller than what the command accesses"))
        return std::nullopt;
    AddressMap::Location location = addresses.covering(range.address, size, need.range.usage);
    if (location.buffer)
        return keep(location, range.size);
    location = addresses.covering(range.address, size, 0);
    if (location.buffer)
        return tolerate(true, need.range.usageId, "lies in no buffer with the usage that the command needs")
                   ? std::optional(keep(location, range.size))
                   : std::nullopt;
    if (need.part != Part::All)
        location = addresses.covering(range.address, std::max(least, VkDeviceSize{1}), need.range.usage);
    return tolerate(location.buffer, ids.buffer, "does not lie in one buffer")
               ? std::optional(keep(location, location.bytes))
               : std::nullopt;
}

std::optional<AddressLookup::Found> AddressLookup::find(const VkDeviceAddressRangeKHR &range, const Need &need) const
{
    return find(range, need, rules::kAnyRange);
}

std::optional<AddressLookup::Found> AddressLookup::find(const VkStridedDeviceAddressRangeKHR &range,
                                                        const Need &need) const
{
    return find({range.address, range.size}, need, rules::kAnyStridedRange);
}

} // namespace vellum::layer
