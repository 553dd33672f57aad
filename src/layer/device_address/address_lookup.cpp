// SPDX-License-Identifier: Apache-2.0
#include "layer/device_address/address_lookup.h"

#include <algorithm>
#include <cinttypes>
#include <cstdio>

#include "layer/device_address/device_addresses.h"
#include "layer/input/checked.h"

namespace vellum::layer
{

AddressLookup::AddressLookup(const DeviceAddresses &device, VkCommandBuffer commandBuffer, const char *command,
                             const char *otherwise)
    : device_(device), commandBuffer_(commandBuffer), command_(command), otherwise_(otherwise),
      isReported_(input::areRangesReported(commandBuffer))
{
}

bool AddressLookup::report(Severity severity, const char *id, const std::string &text) const
{
    return InputCheck(device_.queries.objects.rules, command_, commandBuffer_, isReported_)
        .report(id, nullptr, severity == Severity::Reject ? text + "; " + otherwise_ : text, severity)
        .accepted;
}

AddressLookup::Found AddressLookup::keep(const AddressMap::Location &location, VkDeviceSize size) const
{
    device_.commands.states.keep(commandBuffer_, location.owner);
    return {location.buffer, location.offset, size};
}

std::optional<AddressLookup::Found> AddressLookup::find(const VkDeviceAddressRangeKHR &range, const Need &need,
                                                        const rules::AnyRange &ids) const
{
    const auto textOf = [&](const char *what) {
        char text[256];
        std::snprintf(text, sizeof text, "%s (element %" PRIu32 "), %" PRIu64 " bytes at address 0x%" PRIx64 ", %s",
                      need.member, need.index, range.size, range.address, what);
        return std::string(text);
    };
    if (range.address == 0) {
        report(Severity::Reject, ids.null, textOf("is a null range"));
        return std::nullopt;
    }
    const AddressMap &addresses = device_.buffers.addresses;
    const VkDeviceSize least = need.least > 0 ? need.least : need.range.least;
    const VkDeviceSize size = std::max(range.size, least);
    if (range.size < least &&
        !report(rules::ofSmallRange(addresses, range, least), need.leastId ? need.leastId : need.range.leastId,
                textOf("is smaller than what the command accesses")))
        return std::nullopt;
    AddressMap::Location location = addresses.covering(range.address, size, need.range.usage);
    if (location.buffer)
        return keep(location, range.size);
    location = addresses.covering(range.address, size, 0);
    if (location.buffer)
        return report(Severity::Tolerate, need.range.usageId,
                      textOf("lies in no buffer with the usage that the command needs"))
                   ? std::optional(keep(location, range.size))
                   : std::nullopt;
    if (need.range.part != rules::Part::All)
        location = addresses.covering(range.address, std::max(least, VkDeviceSize{1}), need.range.usage);
    return report(rules::ofSplitRange(addresses, range, need.range, least), ids.buffer,
                  textOf("does not lie in one buffer"))
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
