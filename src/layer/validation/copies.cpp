// SPDX-License-Identifier: Apache-2.0
// Copies of micromaps and acceleration structures, to each other and to memory, on the device and on the host; copies,
// fills and updates of buffers and address ranges.
#include "layer/rules/copies.h"
#include "layer/input/checked.h"
#include "layer/validation/commands.h"
#include "layer/validation/rules/rule_check.h"

namespace vellum::layer
{
namespace
{

using Structure = std::shared_ptr<ValidatedStructure>;

constexpr const char *kSavedMicromapId = "VUID-VkCopyMicromapToMemoryInfoEXT-src-07540";

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

// The effect of a clone or a compaction.
void copied(const RuleCheck &check, const Structure &source, const Structure &target)
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

// The effect of a deserialization: the target holds something that the host does not know. `header`: null if it is not
// known.
void deserialized(const RuleCheck &check, const Structure &target, std::shared_ptr<SerializedHeader> header)
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

// Checks the rules of a copy, and of what its source holds when it is executed (`constructed`: their id).
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

// Models a clone or a compaction on the device, before the implementation records it.
void recordCopy(DeviceValidation &device, const RuleCheck &check, const input::Copy &copy)
{
    const Structure source = device.objects.structureOf(copy.source), target = device.objects.structureOf(copy.target);
    if (copy.isCompaction)
        checkCompactedSize(device.gpu, check, source, target);
    if (copy.khr())
        checkDeserializedMicromaps(device.gpu, check, source, "VUID-vkCmdCopyAccelerationStructureKHR-src-11634");
    copied(check, source, target);
    sync::recordCopy(device.sync, check.commandBuffer(), check.place().command(), source, target);
}

// The buffer of serialized data exists when the command is executed.
void checkDataWhenExecuted(const RuleCheck &check, const input::SerializedCopy &copy)
{
    const VkDeviceAddress data = copy.data.deviceAddress;
    if (check.model().checks.core && !check.model().rules.lacksBuffer(data))
        checkWhenExecuted(check.model(), check.commandBuffer(),
                          {.address = data,
                           .command = check.place().command(),
                           .member = copy.saves ? "pInfo.dst" : "pInfo.src",
                           .vuid = copy.saves ? (copy.khr() ? rules::kKhrSavedDataId : rules::kExtSavedDataId)
                                              : (copy.khr() ? rules::kKhrRestoredDataId : rules::kExtRestoredDataId),
                           .object = check.object()});
}

// As above, for a copy to or from serialized data.
void recordCopy(DeviceValidation &device, const RuleCheck &check, const input::SerializedCopy &copy)
{
    checkDataWhenExecuted(check, copy);
    const char *const command = check.place().command();
    const VkDeviceAddress data = copy.data.deviceAddress;
    const Structure structure = device.objects.structureOf(copy.object);
    if (copy.saves) {
        checkSerializedSize(device.gpu, check, structure, data);
        if (copy.khr())
            checkDeserializedMicromaps(device.gpu, check, structure,
                                       "VUID-VkCopyAccelerationStructureToMemoryInfoKHR-src-11582");
        sync::recordSerialization(device.sync, check.commandBuffer(), command, structure, data);
        return;
    }
    deserialized(check, structure, checkSerializedData(device.gpu, check, data, structure));
    sync::recordDeserialization(device.sync, check.commandBuffer(), command, data, structure);
    if (copy.khr())
        device.traces.deserializes = true;
}

// A command that copies. `constructed`: as of checkCopy.
template <typename Info>
void checkedCopy(DeviceValidation &device, VkCommandBuffer commandBuffer, const char *name, const Info *info,
                 const char *constructed, void(VKAPI_PTR *next)(VkCommandBuffer, const Info *))
{
    const Place command(name);
    const Place place = command.member("pInfo");
    auto copy = input::parse(*info, input::Executor::Device);
    const RuleCheck check(device, place, copy.subject(), commandBuffer);
    copy = checkCopy(check, std::move(copy), constructed);
    recordCopy(device, check, copy);
    const input::Checked checked(info, copy);
    next(commandBuffer, info);
}

} // namespace

namespace validation
{

void cmdCopyMicromap(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkCopyMicromapInfoEXT *info)
{
    checkedCopy(device, commandBuffer, "vkCmdCopyMicromapEXT", info, "VUID-vkCmdCopyMicromapEXT-src-07532",
                device.next.CmdCopyMicromapEXT);
}

void cmdCopyMicromapToMemory(DeviceValidation &device, VkCommandBuffer commandBuffer,
                             const VkCopyMicromapToMemoryInfoEXT *info)
{
    checkedCopy(device, commandBuffer, "vkCmdCopyMicromapToMemoryEXT", info, kSavedMicromapId,
                device.next.CmdCopyMicromapToMemoryEXT);
}

void cmdCopyMemoryToMicromap(DeviceValidation &device, VkCommandBuffer commandBuffer,
                             const VkCopyMemoryToMicromapInfoEXT *info)
{
    checkedCopy(device, commandBuffer, "vkCmdCopyMemoryToMicromapEXT", info, nullptr,
                device.next.CmdCopyMemoryToMicromapEXT);
}

void cmdCopyAccelerationStructure(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                  const VkCopyAccelerationStructureInfoKHR *info)
{
    checkedCopy(device, commandBuffer, "vkCmdCopyAccelerationStructureKHR", info,
                "VUID-vkCmdCopyAccelerationStructureKHR-src-11633", device.next.CmdCopyAccelerationStructureKHR);
}

void cmdCopyAccelerationStructureToMemory(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                          const VkCopyAccelerationStructureToMemoryInfoKHR *info)
{
    checkedCopy(device, commandBuffer, "vkCmdCopyAccelerationStructureToMemoryKHR", info,
                "VUID-VkCopyAccelerationStructureToMemoryInfoKHR-src-04959",
                device.next.CmdCopyAccelerationStructureToMemoryKHR);
}

void cmdCopyMemoryToAccelerationStructure(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                          const VkCopyMemoryToAccelerationStructureInfoKHR *info)
{
    checkedCopy(device, commandBuffer, "vkCmdCopyMemoryToAccelerationStructureKHR", info, nullptr,
                device.next.CmdCopyMemoryToAccelerationStructureKHR);
}

VkResult copyMicromap(DeviceValidation &device, VkDevice handle, VkDeferredOperationKHR operation,
                      const VkCopyMicromapInfoEXT *info)
{
    const Place command("vkCopyMicromapEXT");
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->dst);
    input::Copy copy = checkCopy(check, input::parse(*info, input::Executor::Host), "VUID-vkCopyMicromapEXT-src-11670");
    const input::Checked checked(info, copy);
    const VkResult result = device.next.CopyMicromapEXT(handle, operation, info);
    if (isCarriedOut(result))
        remember(device.objects, [&] {
            copied(check, device.objects.micromaps.get(info->src), device.objects.micromaps.get(info->dst));
        });
    return result;
}

VkResult copyMicromapToMemory(DeviceValidation &device, VkDevice handle, VkDeferredOperationKHR operation,
                              const VkCopyMicromapToMemoryInfoEXT *info)
{
    const Place command("vkCopyMicromapToMemoryEXT");
    const Place place = command.member("pInfo");
    input::SerializedCopy copy =
        checkCopy(RuleCheck(device, place, info->src), input::parse(*info, input::Executor::Host), kSavedMicromapId);
    const input::Checked checked(info, copy);
    return device.next.CopyMicromapToMemoryEXT(handle, operation, info);
}

VkResult copyMemoryToMicromap(DeviceValidation &device, VkDevice handle, VkDeferredOperationKHR operation,
                              const VkCopyMemoryToMicromapInfoEXT *info)
{
    const Place command("vkCopyMemoryToMicromapEXT");
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->dst);
    const Structure target = device.objects.micromaps.get(info->dst);
    input::SerializedCopy copy = checkCopy(check, input::parse(*info, input::Executor::Host), nullptr);
    auto header = checkSerializedData(check, info->src.hostAddress, target.get());
    copy.isReported = header && header->isWrong;
    const input::Checked checked(info, copy);
    const VkResult result = device.next.CopyMemoryToMicromapEXT(handle, operation, info);
    if (isCarriedOut(result))
        remember(device.objects, [&] { deserialized(check, target, std::move(header)); });
    return result;
}

VkResult copyAccelerationStructure(DeviceValidation &device, VkDevice handle, VkDeferredOperationKHR operation,
                                   const VkCopyAccelerationStructureInfoKHR *info)
{
    const Place command("vkCopyAccelerationStructureKHR");
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->dst);
    const Structure source = device.objects.structures.get(info->src);
    if (device.checks.core)
        checkConstructed(check, source, "VUID-vkCopyAccelerationStructureKHR-src-11586");
    checkDeserializedMicromaps(device.gpu, check, source, "VUID-vkCopyAccelerationStructureKHR-src-11587");
    const VkResult result = device.next.CopyAccelerationStructureKHR(handle, operation, info);
    if (isCarriedOut(result))
        remember(device.objects, [&] { copied(check, source, device.objects.structures.get(info->dst)); });
    return result;
}

VkResult copyMemoryToAccelerationStructure(DeviceValidation &device, VkDevice handle, VkDeferredOperationKHR operation,
                                           const VkCopyMemoryToAccelerationStructureInfoKHR *info)
{
    const Place command("vkCopyMemoryToAccelerationStructureKHR");
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->dst);
    const Structure target = device.objects.structures.get(info->dst);
    auto header = checkSerializedData(check, info->src.hostAddress, target.get());
    const VkResult result = device.next.CopyMemoryToAccelerationStructureKHR(handle, operation, info);
    if (isCarriedOut(result))
        remember(device.objects, [&] { deserialized(check, target, std::move(header)); });
    device.traces.deserializes = true;
    return result;
}

void getDeviceMicromapCompatibility(DeviceValidation &device, VkDevice handle, const VkMicromapVersionInfoEXT *info,
                                    VkAccelerationStructureCompatibilityKHR *result)
{
    checkFeature(device.at(Place("vkGetDeviceMicromapCompatibilityEXT")),
                 "VUID-vkGetDeviceMicromapCompatibilityEXT-micromap-11666");
    device.next.GetDeviceMicromapCompatibilityEXT(handle, info, result);
}

// --- buffers and address ranges: copies, fills and updates, and other commands that take ranges and do more than to be
// passed on ---

void cmdCopyBuffer(DeviceValidation &device, VkCommandBuffer commandBuffer, VkBuffer from, VkBuffer to, uint32_t count,
                   const VkBufferCopy *regions)
{
    for (uint32_t r = 0; r < count; ++r)
        sync::recordCopy(device.sync, commandBuffer, "vkCmdCopyBuffer", from, to, regions[r], r);
    device.next.CmdCopyBuffer(commandBuffer, from, to, count, regions);
}

void cmdCopyBuffer2(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkCopyBufferInfo2 *info)
{
    for (uint32_t r = 0; r < info->regionCount; ++r) {
        const VkBufferCopy2 &region = info->pRegions[r];
        sync::recordCopy(device.sync, commandBuffer, "vkCmdCopyBuffer2", info->srcBuffer, info->dstBuffer,
                         {region.srcOffset, region.dstOffset, region.size}, r);
    }
    device.next.CmdCopyBuffer2(commandBuffer, info);
}

void cmdFillBuffer(DeviceValidation &device, VkCommandBuffer commandBuffer, VkBuffer buffer, VkDeviceSize offset,
                   VkDeviceSize size, uint32_t data)
{
    sync::recordWrite(device.sync, commandBuffer, "vkCmdFillBuffer", buffer, offset, size);
    device.next.CmdFillBuffer(commandBuffer, buffer, offset, size, data);
}

void cmdUpdateBuffer(DeviceValidation &device, VkCommandBuffer commandBuffer, VkBuffer buffer, VkDeviceSize offset,
                     VkDeviceSize size, const void *data)
{
    sync::recordWrite(device.sync, commandBuffer, "vkCmdUpdateBuffer", buffer, offset, size);
    device.next.CmdUpdateBuffer(commandBuffer, buffer, offset, size, data);
}

void cmdCopyMemory(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkCopyDeviceMemoryInfoKHR *info)
{
    const CheckedRanges checked(device, commandBuffer, "vkCmdCopyMemoryKHR",
                                [&](const RangeCheck &check) { ranges::cmdCopyMemory(check, info); });
    sync::recordCopy(device.sync, commandBuffer, *info);
    device.next.CmdCopyMemoryKHR(commandBuffer, info);
}

void cmdUpdateMemory(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkDeviceAddressRangeKHR *range,
                     VkAddressCommandFlagsKHR flags, VkDeviceSize size, const void *data)
{
    const CheckedRanges checked(device, commandBuffer, "vkCmdUpdateMemoryKHR", [&](const RangeCheck &check) {
        ranges::cmdUpdateMemory(check, range, flags, size, data);
    });
    sync::recordWrite(device.sync, commandBuffer, "vkCmdUpdateMemoryKHR", *range);
    device.next.CmdUpdateMemoryKHR(commandBuffer, range, flags, size, data);
}

void cmdFillMemory(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkDeviceAddressRangeKHR *range,
                   VkAddressCommandFlagsKHR flags, uint32_t data)
{
    const CheckedRanges checked(device, commandBuffer, "vkCmdFillMemoryKHR",
                                [&](const RangeCheck &check) { ranges::cmdFillMemory(check, range, flags, data); });
    sync::recordWrite(device.sync, commandBuffer, "vkCmdFillMemoryKHR", *range);
    device.next.CmdFillMemoryKHR(commandBuffer, range, flags, data);
}

void cmdCopyQueryPoolResultsToMemory(DeviceValidation &device, VkCommandBuffer commandBuffer, VkQueryPool pool,
                                     uint32_t first, uint32_t count, const VkStridedDeviceAddressRangeKHR *range,
                                     VkAddressCommandFlagsKHR flags, VkQueryResultFlags results)
{
    const char *const name = "vkCmdCopyQueryPoolResultsToMemoryKHR";
    const CheckedRanges checked(device, commandBuffer, name, [&](const RangeCheck &check) {
        ranges::cmdCopyQueryPoolResultsToMemory(check, pool, first, count, range, flags, results);
    });
    sync::recordUse(device.sync, commandBuffer, name, device.objects.queryPools.get(pool));
    device.next.CmdCopyQueryPoolResultsToMemoryKHR(commandBuffer, pool, first, count, range, flags, results);
}

void cmdBeginConditionalRendering2(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                   const VkConditionalRenderingBeginInfo2EXT *info)
{
    const CheckedRanges checked(device, commandBuffer, "vkCmdBeginConditionalRendering2EXT",
                                [&](const RangeCheck &check) { ranges::cmdBeginConditionalRendering2(check, info); });
    // Kept for injected work, and for the end of conditional rendering.
    const auto state = device.commands.states.get(commandBuffer);
    const auto at = device.buffers.addresses.covering(info->addressRange.address, sizeof(uint32_t),
                                                      VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT);
    if (state && at.buffer)
        state->conditionalRendering = {VK_STRUCTURE_TYPE_CONDITIONAL_RENDERING_BEGIN_INFO_EXT, nullptr, at.buffer,
                                       at.offset, info->flags};
    device.next.CmdBeginConditionalRendering2EXT(commandBuffer, info);
}

} // namespace validation
} // namespace vellum::layer
