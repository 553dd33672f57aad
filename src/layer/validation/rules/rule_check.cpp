// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/rules/rule_check.h"

#include <algorithm>

namespace vellum::layer
{
void RuleCheck::whenExecuted(const char *vuid, std::function<std::string()> find) const
{
    if (!vuid)
        return;
    device_.logs.add(commandBuffer_, [&device = device_, place = place_.text(), object = object_, vuid,
                                      find = std::move(find)](const Submission &submission) {
        const std::string found = submission.ordered ? find() : std::string();
        if (!found.empty())
            device.fault(place, vuid, found, object);
    });
}

void RuleCheck::whenExecuted(std::function<void()> effect) const
{
    device_.logs.add(commandBuffer_, [effect = std::move(effect)](const Submission &) { effect(); });
}

MemoryRange memoryOf(const ValidatedStructure *structure, VkDeviceSize bytes)
{
    if (!structure || !structure->buffer || !structure->buffer->memory)
        return {};
    const VkDeviceSize begin = structure->buffer->memoryOffset + structure->offset;
    return {structure->buffer->memory, begin, begin + std::min(bytes, structure->size)};
}

MemoryRange memoryAt(const DeviceModel &device, VkDeviceAddress address, VkDeviceSize bytes)
{
    const AddressMap::Location location = device.buffers.addresses.find(address);
    const auto buffer = location.buffer ? device.objects.buffers.get(location.buffer) : nullptr;
    if (!buffer)
        return {};
    const VkDeviceSize begin = buffer->memoryOffset + location.offset;
    return {buffer->memory, begin, begin + bytes};
}

void checkUsage(const RuleCheck &check, VkDeviceAddress address, VkFlags64 usage, const char *member, const char *vuid,
                const char *usageName)
{
    const AddressMap &addresses = check.device().buffers.addresses;
    const AddressMap::Location any = addresses.find(address);
    if (any.buffer && !addresses.covering(address, 1, usage).buffer)
        check.fault(member, vuid,
                    "the buffer " + check.device().nameOf(any.buffer) + " was created without " + usageName);
}

bool checkMultiple(const RuleCheck &check, uint64_t value, uint64_t divisor, const char *member, const char *vuid)
{
    if (divisor == 0 || value % divisor == 0)
        return true;
    check.fault(member, vuid, std::to_string(value) + " is not a multiple of " + std::to_string(divisor));
    return false;
}

void checkConstructed(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &micromap, const char *vuid)
{
    if (!micromap || !micromap->isMicromap())
        return;
    check.whenExecuted(vuid, [&device = check.device(), micromap]() -> std::string {
        if (micromap->contents && !micromap->destroyed)
            return {};
        return "the micromap " + device.nameOf(micromap->handle) +
               (micromap->destroyed ? " is destroyed when the command is executed"
                                    : " is not constructed when the command is executed");
    });
}

void checkCompactable(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &micromap, const char *vuid)
{
    if (!micromap || !micromap->isMicromap())
        return;
    const bool ext = micromap->handle.type == VK_OBJECT_TYPE_MICROMAP_EXT;
    const VkFlags allowed = ext ? VkFlags{VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT}
                                : VkFlags{VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR};
    check.whenExecuted(vuid, [&device = check.device(), micromap, allowed]() -> std::string {
        const auto contents = micromap->contents;
        if (!contents || contents->deserialized || (contents->flags & allowed) != 0)
            return {};
        return "the micromap " + device.nameOf(micromap->handle) + " was built without the flag that allows compaction";
    });
}

} // namespace vellum::layer
