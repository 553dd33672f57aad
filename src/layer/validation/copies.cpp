// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/copies.h"

#include "layer/input/checked.h"
#include "layer/rules/copies.h"
#include "layer/validation/commands.h"

namespace vellum::layer
{
namespace
{

using Structure = std::shared_ptr<ValidatedStructure>;

// The source of a clone or a compaction, when the command is executed.
void checkSource(const RuleCheck &check, const input::Copy &copy, const Structure &source, const char *constructed)
{
    if (!check.model().checks.core)
        return;
    checkConstructed(check, source, constructed);
    if (copy.isCompaction)
        checkCompactable(check, source,
                         copy.khr() ? "VUID-VkCopyAccelerationStructureInfoKHR-src-03411"
                                    : "VUID-VkCopyMicromapInfoEXT-mode-07533");
}

} // namespace

void copied(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &source,
            const std::shared_ptr<ValidatedStructure> &target)
{
    copyRecord(check.model(), check.commandBuffer(), source, target);
    findReference(check.model(), target);
    if (target && source)
        check.afterExecution([&device = check.model(), source, target](bool isOrdered) {
            const uint64_t built = source->built;
            const bool isKnown = isOrdered && (source->contents || !isNotConstructed(device, *source).empty());
            setContents(device, target, isKnown ? source->contents : unknownContents(source->type));
            target->built = built;
        });
}

void deserialized(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &target,
                  std::shared_ptr<SerializedHeader> header)
{
    if (!target)
        return;
    if (!header || !check.commandBuffer()) // otherwise the device has written it, with the header
        copyRecord(check.model(), check.commandBuffer(), nullptr, target);
    findReference(check.model(), target);
    const auto contents = unknownContents(target->type);
    contents->header = std::move(header);
    check.afterExecution([&device = check.model(), target, contents](bool) { setContents(device, target, contents); });
}

input::Copy checkCopy(const RuleCheck &check, input::Copy copy, const char *constructed)
{
    DeviceModel &device = check.model();
    const Structure source = device.objects.structureOf(copy.source), target = device.objects.structureOf(copy.target);
    // The host knows only that the first byte is accessed.
    const bool same = memoryOf(source.get(), 1).overlaps(memoryOf(target.get(), 1));
    rules::checkCopy(check, copy, {device.factsOf(copy.source), device.factsOf(copy.target), same});
    checkSource(check, copy, source, constructed);
    return copy;
}

input::SerializedCopy checkCopy(const RuleCheck &check, input::SerializedCopy copy, const char *constructed)
{
    DeviceModel &device = check.model();
    rules::checkCopy(check, copy, device.factsOf(copy.object));
    if (device.checks.core && copy.saves)
        checkConstructed(check, device.objects.structureOf(copy.object), constructed);
    return copy;
}

namespace validation
{
namespace
{

// Models a clone or a compaction on the device, before the implementation records it.
void recordCopy(DeviceValidation &device, const RuleCheck &check, const char *command, const input::Copy &copy)
{
    const Structure source = device.objects.structureOf(copy.source), target = device.objects.structureOf(copy.target);
    if (copy.isCompaction)
        checkCompactedSize(device.gpu, check, source, target);
    if (copy.khr())
        checkDeserializedMicromaps(device.gpu, check, source, "VUID-vkCmdCopyAccelerationStructureKHR-src-11634");
    copied(check, source, target);
    sync::recordCopy(device.sync, check.commandBuffer(), command, source, target);
}

// The buffer of serialized data exists when the command is executed.
void checkDataWhenExecuted(const RuleCheck &check, const char *command, const input::SerializedCopy &copy)
{
    const VkDeviceAddress data = copy.data.deviceAddress;
    if (check.model().checks.core && !check.model().state.rules.lacksBuffer(data))
        checkWhenExecuted(check.model(), check.commandBuffer(),
                          {.address = data,
                           .command = command,
                           .member = copy.saves ? "pInfo.dst" : "pInfo.src",
                           .vuid = copy.saves ? (copy.khr() ? rules::kKhrSavedDataId : rules::kExtSavedDataId)
                                              : (copy.khr() ? rules::kKhrRestoredDataId : rules::kExtRestoredDataId),
                           .object = check.object()});
}

void recordSave(DeviceValidation &device, const RuleCheck &check, const char *command,
                const input::SerializedCopy &copy)
{
    checkDataWhenExecuted(check, command, copy);
    const Structure source = device.objects.structureOf(copy.object);
    checkSerializedSize(device.gpu, check, source, copy.data.deviceAddress);
    if (copy.khr())
        checkDeserializedMicromaps(device.gpu, check, source,
                                   "VUID-VkCopyAccelerationStructureToMemoryInfoKHR-src-11582");
    sync::recordSerialization(device.sync, check.commandBuffer(), command, source, copy.data.deviceAddress);
}

void recordRestore(DeviceValidation &device, const RuleCheck &check, const char *command,
                   const input::SerializedCopy &copy)
{
    checkDataWhenExecuted(check, command, copy);
    const Structure target = device.objects.structureOf(copy.object);
    deserialized(check, target, checkSerializedData(device.gpu, check, copy.data.deviceAddress, target));
    sync::recordDeserialization(device.sync, check.commandBuffer(), command, copy.data.deviceAddress, target);
}

} // namespace

void cmdCopyMicromap(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkCopyMicromapInfoEXT *info)
{
    const char *const name = "vkCmdCopyMicromapEXT";
    const Place command(name);
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->dst, commandBuffer);
    input::Copy copy =
        checkCopy(check, input::parse(*info, input::Executor::Device), "VUID-vkCmdCopyMicromapEXT-src-07532");
    recordCopy(device, check, name, copy);
    const input::Checked checked(info, copy);
    device.next.CmdCopyMicromapEXT(commandBuffer, info);
}

void cmdCopyMicromapToMemory(DeviceValidation &device, VkCommandBuffer commandBuffer,
                             const VkCopyMicromapToMemoryInfoEXT *info)
{
    const char *const name = "vkCmdCopyMicromapToMemoryEXT";
    const Place command(name);
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->src, commandBuffer);
    input::SerializedCopy copy = checkCopy(check, input::parse(*info, input::Executor::Device), kSavedMicromapId);
    recordSave(device, check, name, copy);
    const input::Checked checked(info, copy);
    device.next.CmdCopyMicromapToMemoryEXT(commandBuffer, info);
}

void cmdCopyMemoryToMicromap(DeviceValidation &device, VkCommandBuffer commandBuffer,
                             const VkCopyMemoryToMicromapInfoEXT *info)
{
    const char *const name = "vkCmdCopyMemoryToMicromapEXT";
    const Place command(name);
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->dst, commandBuffer);
    input::SerializedCopy copy = checkCopy(check, input::parse(*info, input::Executor::Device), nullptr);
    recordRestore(device, check, name, copy);
    const input::Checked checked(info, copy);
    device.next.CmdCopyMemoryToMicromapEXT(commandBuffer, info);
}

void cmdCopyAccelerationStructure(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                  const VkCopyAccelerationStructureInfoKHR *info)
{
    const char *const name = "vkCmdCopyAccelerationStructureKHR";
    const Place command(name);
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->dst, commandBuffer);
    input::Copy copy = checkCopy(check, input::parse(*info), "VUID-vkCmdCopyAccelerationStructureKHR-src-11633");
    recordCopy(device, check, name, copy);
    const input::Checked checked(info, copy);
    device.next.CmdCopyAccelerationStructureKHR(commandBuffer, info);
}

void cmdCopyAccelerationStructureToMemory(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                          const VkCopyAccelerationStructureToMemoryInfoKHR *info)
{
    const char *const name = "vkCmdCopyAccelerationStructureToMemoryKHR";
    const Place command(name);
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->src, commandBuffer);
    input::SerializedCopy copy =
        checkCopy(check, input::parse(*info), "VUID-VkCopyAccelerationStructureToMemoryInfoKHR-src-04959");
    recordSave(device, check, name, copy);
    const input::Checked checked(info, copy);
    device.next.CmdCopyAccelerationStructureToMemoryKHR(commandBuffer, info);
}

void cmdCopyMemoryToAccelerationStructure(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                          const VkCopyMemoryToAccelerationStructureInfoKHR *info)
{
    const char *const name = "vkCmdCopyMemoryToAccelerationStructureKHR";
    const Place command(name);
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->dst, commandBuffer);
    input::SerializedCopy copy = checkCopy(check, input::parse(*info), nullptr);
    recordRestore(device, check, name, copy);
    device.traces.deserializes = true;
    const input::Checked checked(info, copy);
    device.next.CmdCopyMemoryToAccelerationStructureKHR(commandBuffer, info);
}

} // namespace validation
} // namespace vellum::layer
