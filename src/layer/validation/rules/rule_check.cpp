// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/rules/rule_check.h"

#include <algorithm>

namespace vellum::layer
{
namespace
{

std::string placeOf(const AccessedAddress &accessed)
{
    const Place command(accessed.command);
    const auto in = [](const Place &outer, const char *array, uint32_t index, auto next) {
        return index == AccessedAddress::kNone ? next(outer) : next(outer.element(array, index));
    };
    return in(command, "pInfos", accessed.info, [&](const Place &info) {
        return in(info, "pGeometries", accessed.geometry,
                  [&](const Place &geometry) { return geometry.member(accessed.member).text(); });
    });
}

void checkAddresses(const DeviceModel &device, AccessedAddresses &accessed)
{
    const uint64_t losses = device.objects.bufferLosses;
    if (accessed.losses == losses)
        return;
    accessed.losses = losses;
    for (const AccessedAddress &one : accessed.addresses)
        if (device.rules.lacksBuffer(one.address))
            device.at(Place(placeOf(one)), one.object)
                .report(one.vuid, nullptr,
                        "when the command is executed, no buffer has the address " + hex(one.address) +
                            " any more: it was destroyed, or its memory was freed");
}

} // namespace

void checkWhenExecuted(DeviceModel &device, VkCommandBuffer commandBuffer, const AccessedAddress &accessed)
{
    CommandLog *log = device.logs.get(commandBuffer);
    if (!log)
        return;
    if (!log->accessed) {
        log->accessed = std::make_shared<AccessedAddresses>();
        log->accessed->losses = device.objects.bufferLosses;
        device.logs.addCheck(commandBuffer,
                             [&device, all = log->accessed](const Submission &) { checkAddresses(device, *all); });
    }
    log->accessed->addresses.push_back(accessed);
}

void RuleCheck::whenExecuted(const char *vuid, std::function<std::string()> find) const
{
    model_.logs.add(commandBuffer_, [&device = model_, place = place().text(), object = object(), vuid,
                                     find = std::move(find)](const Submission &submission) {
        const std::string found = submission.ordered ? find() : std::string();
        if (!found.empty())
            device.at(Place(place), object).report(vuid, nullptr, found);
    });
}

void RuleCheck::whenExecuted(std::function<void()> check) const
{
    afterExecution([check = std::move(check)](bool isOrdered) {
        if (isOrdered)
            check();
    });
}

void RuleCheck::afterExecution(std::function<void(bool)> effect) const
{
    model_.logs.add(commandBuffer_,
                    [effect = std::move(effect)](const Submission &submission) { effect(submission.ordered); });
}

MemoryRange memoryOf(const ValidatedStructure *structure, VkDeviceSize bytes)
{
    return structure ? memoryIn(structure->buffer.get(), structure->offset, std::min(bytes, structure->size))
                     : MemoryRange{};
}

MemoryRange memoryAt(const DeviceModel &device, VkDeviceAddress address, VkDeviceSize bytes, VkBuffer known)
{
    const auto buffer = known ? device.objects.buffers.get(known) : bufferAt(device, address);
    if (bytes == 0)
        return {};
    return buffer && buffer->memory ? memoryIn(buffer.get(), address - buffer->address, bytes)
                                    : MemoryRange{0, address, address + bytes};
}

void checkConstructed(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &structure, const char *vuid)
{
    if (!structure)
        return;
    check.whenExecuted(vuid, [&device = check.model(), structure]() -> std::string {
        const std::string found = isNotConstructed(device, *structure);
        return found.empty()
                   ? found
                   : device.nameOf(structure->handle) + " is not constructed when the command is executed: " + found;
    });
}

void checkCompactable(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &structure, const char *vuid)
{
    if (!structure)
        return;
    const bool ext = structure->handle.type == VK_OBJECT_TYPE_MICROMAP_EXT;
    const VkFlags allowed = ext ? VkFlags{VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT}
                                : VkFlags{VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR};
    check.whenExecuted(vuid, [&device = check.model(), structure, allowed]() -> std::string {
        const auto contents = structure->contents;
        if (!contents || contents->deserialized || (contents->flags & allowed) != 0)
            return {};
        return device.nameOf(structure->handle) + " was built without the flag that allows compaction";
    });
}

void checkCommand(DeviceModel &device, VkCommandBuffer commandBuffer, const char *command, VkQueueFlags queues)
{
    const auto log = device.checks.core ? device.logs.get(commandBuffer) : nullptr;
    if (!log)
        return;
    const auto &families = device.facts.queueFamilies;
    const struct {
        bool broken;
        const char *end; // of the id
        const char *text;
    } rules[] = {
        {!log->isRecording, "-commandBuffer-recording", "the command buffer is not in the recording state"},
        {log->family < families.size() && (families[log->family] & queues) == 0, "-commandBuffer-cmdpool",
         "the queue family of the command pool does not support the command"},
        {log->isRendering, "-renderpass", "the command is recorded inside a render pass instance"},
        {log->isSuspended, "-suspended", "the command is recorded between suspended render pass instances"},
    };
    for (const auto &rule : rules) {
        if (rule.broken)
            device.at(Place(command), commandBuffer)
                .report((std::string("VUID-") + command + rule.end).c_str(), nullptr, rule.text);
    }
}

void checkFeature(const InputCheck &check, const char *vuid)
{
    if (!check.device().driver.enabled.extFeature)
        check.report(vuid, nullptr, "the feature micromap is not enabled", Severity::Report);
}

void checkCount(DeviceModel &device, const char *command, const char *member, uint32_t count, const char *vuid)
{
    if (device.checks.core && count == 0)
        device.at(Place(command)).report(vuid, member, "it is 0");
}

} // namespace vellum::layer
