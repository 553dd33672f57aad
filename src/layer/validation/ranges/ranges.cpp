// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/ranges/ranges.h"

#include <algorithm>
#include <cinttypes>
#include <cstdio>

#include "layer/validation/rules/rule_check.h"

namespace vellum::layer
{
namespace
{

// The two flags about one usage of buffers, and the numbers of the rules: both flags are set; neither is, and the
// buffer has the usage; the first is, and the buffer lacks the usage.
struct UsageFlags {
    VkBufferUsageFlags usage;
    VkAddressCommandFlagsKHR has, unknown;
    const char *name;
    const char *both, *missing, *wrong;
};
constexpr UsageFlags kUsageFlags[] = {
    {VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, VK_ADDRESS_COMMAND_STORAGE_BUFFER_USAGE_BIT_KHR,
     VK_ADDRESS_COMMAND_UNKNOWN_STORAGE_BUFFER_USAGE_BIT_KHR, "STORAGE_BUFFER_USAGE", "13100", "13122", "13123"},
    {VK_BUFFER_USAGE_TRANSFORM_FEEDBACK_BUFFER_BIT_EXT, VK_ADDRESS_COMMAND_TRANSFORM_FEEDBACK_BUFFER_USAGE_BIT_KHR,
     VK_ADDRESS_COMMAND_UNKNOWN_TRANSFORM_FEEDBACK_BUFFER_USAGE_BIT_KHR, "TRANSFORM_FEEDBACK_BUFFER_USAGE", "13101",
     "13124", "13125"}};

} // namespace

std::string textOf(const VkDeviceAddressRangeKHR &range)
{
    return hex(range.address) + " + " + std::to_string(range.size) + " bytes";
}

VkBuffer RangeCheck::soundBuffer(const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                                 const rules::Range &need) const
{
    if (range.size < need.least || range.address == 0 || range.address % need.alignment != 0 ||
        (flags & (VK_ADDRESS_COMMAND_PROTECTED_BIT_KHR | VK_ADDRESS_COMMAND_FULLY_BOUND_BIT_KHR)) != 0 ||
        device_.objects.hasProtectedBuffers)
        return VK_NULL_HANDLE;
    const AddressMap::Only only = device_.buffers.addresses.only(range.address, range.size);
    const bool sound =
        (only.usage & need.usage) == need.usage && std::ranges::all_of(kUsageFlags, [&](const UsageFlags &usage) {
            const bool has = (flags & usage.has) != 0;
            return (flags & usage.unknown) != 0 ? !has : has == ((only.usage & usage.usage) != 0);
        });
    return sound ? only.buffer : VK_NULL_HANDLE;
}

void RangeCheck::fault(const Place &place, const char *vuid, const std::string &text, Severity severity) const
{
    kept_ = false;
    device_.at(place, commandBuffer_ ? ObjectHandle(commandBuffer_) : ObjectHandle())
        .report(vuid, nullptr, text, device_.implementsRanges ? severity : Severity::Reject);
}

void RangeCheck::checkUnprotected(const Place &place, VkDeviceAddress address, const char *rule) const
{
    const auto buffer = bufferAt(device_, address);
    if (buffer && (buffer->flags & VK_BUFFER_CREATE_PROTECTED_BIT) != 0 && !device_.facts.protectedNoFault)
        fault(place, rule, "buffer " + device_.nameOf(buffer->handle) + " is protected");
}

bool RangeCheck::isProtected() const
{
    const auto log = device_.logs.get(commandBuffer_);
    return log && log->isProtected;
}

void RangeCheck::checkProtection(const Place &place, const char *member, VkAddressCommandFlagsKHR flags,
                                 const char *unprotectedRule, const char *protectedRule) const
{
    if (device_.facts.protectedNoFault)
        return;
    const bool flag = (flags & VK_ADDRESS_COMMAND_PROTECTED_BIT_KHR) != 0;
    if (flag && !isProtected())
        fault(place.member(member), unprotectedRule, "PROTECTED, in a command buffer that is not protected");
    else if (!flag && protectedRule && isProtected())
        fault(place.member(member), protectedRule, "no PROTECTED, in a protected command buffer");
}

VkBuffer RangeCheck::check(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                           const FlaggedRange &names, const rules::Range &need) const
{
    return check(place, range, flags, names, need, rules::kAnyRange);
}

void RangeCheck::check(const Place &place, const VkStridedDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                       const FlaggedRange &names, const rules::Range &need) const
{
    if (range.stride > range.size)
        fault(place.member(names.range), "VUID-VkStridedDeviceAddressRangeKHR-stride-10957",
              "stride " + std::to_string(range.stride) + " is larger than the size, " + std::to_string(range.size));
    check(place, {range.address, range.size}, flags, names, need, rules::kAnyStridedRange);
}

VkBuffer RangeCheck::check(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                           const FlaggedRange &names, const rules::Range &need, const rules::AnyRange &ids) const
{
    const AddressMap &addresses = device_.buffers.addresses;
    const VkBuffer sound = soundBuffer(range, flags, need);
    // A range that is only bound need not be accessed.
    const bool isAccessed = need.usageId && need.part != rules::Part::UpToEnd && range.size != 0;
    if (isAccessed && (sound || addresses.find(range.address).buffer))
        checkWhenExecuted(device_, commandBuffer_,
                          {.address = range.address,
                           .command = place.command(),
                           .member = names.range,
                           .vuid = ids.buffer,
                           .object = commandBuffer_});
    if (sound)
        return sound;
    const Place member = place.member(names.range);
    if (need.leastId && range.size < need.least)
        fault(member, need.leastId,
              std::to_string(range.size) + " bytes; the command accesses " + std::to_string(need.least),
              rules::ofSmallRange(addresses, range, need.least));
    if (range.address == 0) {
        if (range.size != 0)
            fault(member, ids.null, "address 0, with a size of " + std::to_string(range.size));
        return VK_NULL_HANDLE;
    }
    if (need.alignmentId && range.address % need.alignment != 0)
        fault(member, need.alignmentId,
              "address " + hex(range.address) + " is not a multiple of " + std::to_string(need.alignment));
    const auto any = addresses.covering(range.address, range.size, 0);
    if (!any.buffer) {
        const auto at = addresses.find(range.address);
        fault(member, ids.buffer,
              textOf(range) + (at.buffer ? ": its buffer " + device_.nameOf(at.buffer) + " ends after " +
                                               std::to_string(at.bytes) + " bytes"
                                         : ": there is no buffer at this address"),
              rules::ofSplitRange(addresses, range, need, need.least));
        return VK_NULL_HANDLE;
    }
    // Another thread may destroy the buffer, if it is not the application's for this range.
    const auto buffer = device_.objects.buffers.get(any.buffer);
    if (buffer && need.usageId && !addresses.covering(range.address, range.size, need.usage).buffer)
        fault(member, need.usageId,
              "buffer " + device_.nameOf(any.buffer) + " has usage " + hex(buffer->usage) + ", without " +
                  hex(need.usage),
              Severity::Tolerate);
    checkFlags(place, range, flags, names);
    return VK_NULL_HANDLE;
}

void RangeCheck::checkFlags(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                            const FlaggedRange &names) const
{
    const auto buffer = bufferAt(device_, range.address);
    if (!buffer)
        return;
    const bool isProtected = (buffer->flags & VK_BUFFER_CREATE_PROTECTED_BIT) != 0;
    const bool flag = (flags & VK_ADDRESS_COMMAND_PROTECTED_BIT_KHR) != 0;
    if (isProtected != flag && !device_.facts.protectedNoFault)
        fault(place.member(names.flags), names.ofRange(isProtected ? "13098" : "13099").c_str(),
              "buffer " + device_.nameOf(buffer->handle) +
                  (isProtected ? " is protected; PROTECTED is not set" : " is not protected; PROTECTED is set"));
    checkUsageFlags(place, range, flags, names);
    checkBinding(place, range, flags, names);
}

void RangeCheck::checkUsageFlags(const Place &place, const VkDeviceAddressRangeKHR &range,
                                 VkAddressCommandFlagsKHR flags, const FlaggedRange &names) const
{
    const std::vector<AddressMap::Location> buffers = device_.buffers.addresses.within(range.address, range.size);
    for (const UsageFlags &usage : kUsageFlags) {
        const Place member = place.member(names.flags);
        const bool has = (flags & usage.has) != 0;
        if (has && (flags & usage.unknown) != 0) {
            fault(member, names.ofFlags(usage.both).c_str(), std::string(usage.name) + " and UNKNOWN_" + usage.name);
            continue;
        }
        // A buffer that the flags are wrong for.
        const auto wrong = std::ranges::find_if(buffers, [&](const AddressMap::Location &location) {
            const auto buffer = device_.objects.buffers.get(location.buffer);
            const bool hasUsage = buffer && (buffer->usage & usage.usage) != 0;
            return buffer && (flags & usage.unknown) == 0 && hasUsage != has;
        });
        if (wrong != buffers.end())
            fault(member, names.ofRange(has ? usage.wrong : usage.missing).c_str(),
                  std::string(usage.name) + (has ? " is set" : " is not set") + "; buffer " +
                      device_.nameOf(wrong->buffer) + " was created " + (has ? "without" : "with") + " that usage");
    }
}

// A range of a sparse buffer may be bound until the commands are executed.
void RangeCheck::checkBinding(const Place &place, const VkDeviceAddressRangeKHR &range, VkAddressCommandFlagsKHR flags,
                              const FlaggedRange &names) const
{
    const AddressMap::Location location = device_.buffers.addresses.find(range.address);
    const auto buffer = device_.objects.buffers.get(location.buffer);
    if ((flags & VK_ADDRESS_COMMAND_FULLY_BOUND_BIT_KHR) == 0 || !buffer ||
        (buffer->flags & VK_BUFFER_CREATE_SPARSE_BINDING_BIT) == 0)
        return;
    device_.logs.add(commandBuffer_, [&device = device_, object = ObjectHandle(buffer->handle), buffer, location, range,
                                      names, text = place.member(names.flags).text()](const Submission &) {
        if (!buffer->bound.contain(location.offset, location.offset + range.size))
            device.at(Place(text), object)
                .report(names.ofRange("13097").c_str(), nullptr,
                        "FULLY_BOUND, but " + textOf(range) + " of sparse buffer " + device.nameOf(buffer->handle) +
                            " are not bound to memory");
    });
}

namespace ranges
{

void checkCreation(DeviceModel &device, const VkAccelerationStructureCreateInfo2KHR &info)
{
    const RangeCheck ranges(device, VK_NULL_HANDLE, "vkCreateAccelerationStructure2KHR");
    if (!device.facts.addressCommands)
        ranges.fault(ranges.command(), "VUID-vkCreateAccelerationStructure2KHR-deviceAddressCommands-13086",
                     "the feature deviceAddressCommands is not enabled");
    ranges.checkFlags(ranges.command().member("pCreateInfo"), info.addressRange, info.addressFlags, flagged::kCreation);
}

} // namespace ranges
} // namespace vellum::layer
