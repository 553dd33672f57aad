// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/copies.h"

#include "layer/validation/commands.h"
#include "layer/validation/rules/implicit_rules.h"

namespace vellum::layer
{
namespace
{

bool isMicromap(const std::shared_ptr<ValidatedStructure> &structure)
{
    return structure && structure->isMicromap();
}

void checkSerializedAddress(const RuleCheck &check, VkDeviceAddress address, uint32_t alignment, const char *member,
                            const char *nullId, const char *alignmentId)
{
    if (check.require(address != 0, member, nullId, "the address is null"))
        checkMultiple(check, address, alignment, member, alignmentId);
}

void checkMicromapCopy(const RuleCheck &check, const VkCopyMicromapInfoEXT &info,
                       const std::shared_ptr<ValidatedStructure> &source,
                       const std::shared_ptr<ValidatedStructure> &target)
{
    checkStructure(check, info, kCopyMicromapInfo);
    checkBound(check, source.get(), "src", "VUID-vkCmdCopyMicromapEXT-buffer-07529");
    checkBound(check, target.get(), "dst", "VUID-vkCmdCopyMicromapEXT-buffer-07530");
    checkConstructed(check, source, "VUID-vkCmdCopyMicromapEXT-src-07532");
    check.require(info.mode == VK_COPY_MICROMAP_MODE_CLONE_EXT || info.mode == VK_COPY_MICROMAP_MODE_COMPACT_EXT,
                  "mode", "VUID-VkCopyMicromapInfoEXT-mode-07531", "it is neither CLONE nor COMPACT");
    if (info.mode == VK_COPY_MICROMAP_MODE_COMPACT_EXT)
        checkCompactable(check, source, "VUID-VkCopyMicromapInfoEXT-mode-07533");
}

void checkStructureCopy(const RuleCheck &check, const VkCopyAccelerationStructureInfoKHR &info,
                        const std::shared_ptr<ValidatedStructure> &source,
                        const std::shared_ptr<ValidatedStructure> &target)
{
    checkBound(check, source.get(), "src", "VUID-VkCopyAccelerationStructureInfoKHR-buffer-03718");
    checkBound(check, target.get(), "dst", "VUID-VkCopyAccelerationStructureInfoKHR-buffer-03719");
    checkConstructed(check, source, "VUID-vkCmdCopyAccelerationStructureKHR-src-11633");
    check.require(info.mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR ||
                      info.mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR,
                  "mode", "VUID-VkCopyAccelerationStructureInfoKHR-mode-03410", "it is neither CLONE nor COMPACT");
    if (info.mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR)
        checkCompactable(check, source, "VUID-VkCopyAccelerationStructureInfoKHR-src-03411");
    // The host knows only that the first byte is accessed.
    if (source && target)
        check.require(!memoryOf(source.get(), 1).overlaps(memoryOf(target.get(), 1)), "dst",
                      "VUID-VkCopyAccelerationStructureInfoKHR-dst-07791", "it overlaps src in memory");
}

} // namespace

void copied(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &source,
            const std::shared_ptr<ValidatedStructure> &target)
{
    copyRecord(check.device(), check.commandBuffer(), source, target);
    if (target && source)
        check.whenExecuted([&device = check.device(), source, target] {
            const uint64_t built = source->built;
            setContents(device, *target, source->contents);
            target->built = built;
        });
}

void deserialized(const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &target,
                  std::shared_ptr<SerializedHeader> header)
{
    if (!target)
        return;
    copyRecord(check.device(), check.commandBuffer(), nullptr, target);
    const auto contents = unknownContents(target->type);
    contents->header = std::move(header);
    check.whenExecuted([&device = check.device(), target, contents] { setContents(device, *target, contents); });
}

namespace validation
{

void cmdCopyMicromap(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkCopyMicromapInfoEXT *info)
{
    const char *const name = "vkCmdCopyMicromapEXT";
    const Place command(name);
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->dst, commandBuffer);
    const auto source = device.objects.micromaps.get(info->src);
    const auto target = device.objects.micromaps.get(info->dst);
    if (device.checks.core)
        checkMicromapCopy(check, *info, source, target);
    if (info->mode == VK_COPY_MICROMAP_MODE_COMPACT_EXT)
        checkCompactedSize(device.gpu, check, source, target);
    copied(check, source, target);
    sync::recordCopy(device.sync, commandBuffer, name, source, target);
    device.next.CmdCopyMicromapEXT(commandBuffer, info);
}

void cmdCopyMicromapToMemory(DeviceValidation &device, VkCommandBuffer commandBuffer,
                             const VkCopyMicromapToMemoryInfoEXT *info)
{
    const char *const name = "vkCmdCopyMicromapToMemoryEXT";
    const Place command(name);
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->src, commandBuffer);
    const auto source = device.objects.micromaps.get(info->src);
    if (device.checks.core) {
        checkStructure(check, *info, kCopyMicromapToMemoryInfo);
        checkBound(check, source.get(), "src", "VUID-vkCmdCopyMicromapToMemoryEXT-buffer-07539");
        checkConstructed(check, source, "VUID-VkCopyMicromapToMemoryInfoEXT-src-07540");
        check.require(info->mode == VK_COPY_MICROMAP_MODE_SERIALIZE_EXT, "mode",
                      "VUID-VkCopyMicromapToMemoryInfoEXT-mode-07542", "it is not SERIALIZE");
        checkSerializedAddress(check, info->dst.deviceAddress, 256, "dst",
                               "VUID-vkCmdCopyMicromapToMemoryEXT-pInfo-07536",
                               "VUID-vkCmdCopyMicromapToMemoryEXT-pInfo-07537");
    }
    checkSerializedSize(device.gpu, check, source, info->dst.deviceAddress);
    sync::recordSerialization(device.sync, commandBuffer, name, source, info->dst.deviceAddress);
    device.next.CmdCopyMicromapToMemoryEXT(commandBuffer, info);
}

void cmdCopyMemoryToMicromap(DeviceValidation &device, VkCommandBuffer commandBuffer,
                             const VkCopyMemoryToMicromapInfoEXT *info)
{
    const char *const name = "vkCmdCopyMemoryToMicromapEXT";
    const Place command(name);
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->dst, commandBuffer);
    const auto target = device.objects.micromaps.get(info->dst);
    if (device.checks.core) {
        checkStructure(check, *info, kCopyMemoryToMicromapInfo);
        checkBound(check, target.get(), "dst", "VUID-vkCmdCopyMemoryToMicromapEXT-buffer-07546");
        check.require(info->mode == VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT, "mode",
                      "VUID-VkCopyMemoryToMicromapInfoEXT-mode-07548", "it is not DESERIALIZE");
        checkSerializedAddress(check, info->src.deviceAddress, 256, "src",
                               "VUID-vkCmdCopyMemoryToMicromapEXT-pInfo-07543",
                               "VUID-vkCmdCopyMemoryToMicromapEXT-pInfo-07544");
    }
    deserialized(check, target, checkSerializedData(device.gpu, check, info->src.deviceAddress, target));
    sync::recordDeserialization(device.sync, commandBuffer, name, info->src.deviceAddress, target);
    device.next.CmdCopyMemoryToMicromapEXT(commandBuffer, info);
}

void cmdCopyAccelerationStructure(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                  const VkCopyAccelerationStructureInfoKHR *info)
{
    const char *const name = "vkCmdCopyAccelerationStructureKHR";
    const Place command(name);
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->dst, commandBuffer);
    const auto source = device.objects.structures.get(info->src);
    const auto target = device.objects.structures.get(info->dst);
    if (device.checks.core)
        checkStructureCopy(check, *info, source, target);
    if (info->mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR)
        checkCompactedSize(device.gpu, check, source, target);
    checkDeserializedMicromaps(device.gpu, check, source, "VUID-vkCmdCopyAccelerationStructureKHR-src-11634");
    copied(check, source, target);
    sync::recordCopy(device.sync, commandBuffer, name, source, target);
    device.next.CmdCopyAccelerationStructureKHR(commandBuffer, info);
}

void cmdCopyAccelerationStructureToMemory(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                          const VkCopyAccelerationStructureToMemoryInfoKHR *info)
{
    const char *const name = "vkCmdCopyAccelerationStructureToMemoryKHR";
    const Place command(name);
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->src, commandBuffer);
    const auto source = device.objects.structures.get(info->src);
    if (device.checks.core)
        checkBound(check, source.get(), "src", "VUID-VkCopyAccelerationStructureToMemoryInfoKHR-mode-11714");
    if (device.checks.core && isMicromap(source)) {
        checkConstructed(check, source, "VUID-VkCopyAccelerationStructureToMemoryInfoKHR-src-04959");
        check.require(info->mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR, "mode",
                      "VUID-VkCopyAccelerationStructureToMemoryInfoKHR-mode-03412", "it is not SERIALIZE");
        checkSerializedAddress(check, info->dst.deviceAddress, 128, "dst",
                               "VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03739",
                               "VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11699");
    }
    checkSerializedSize(device.gpu, check, source, info->dst.deviceAddress);
    checkDeserializedMicromaps(device.gpu, check, source, "VUID-VkCopyAccelerationStructureToMemoryInfoKHR-src-11582");
    sync::recordSerialization(device.sync, commandBuffer, name, source, info->dst.deviceAddress);
    device.next.CmdCopyAccelerationStructureToMemoryKHR(commandBuffer, info);
}

void cmdCopyMemoryToAccelerationStructure(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                          const VkCopyMemoryToAccelerationStructureInfoKHR *info)
{
    const char *const name = "vkCmdCopyMemoryToAccelerationStructureKHR";
    const Place command(name);
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->dst, commandBuffer);
    const auto target = device.objects.structures.get(info->dst);
    if (device.checks.core)
        checkBound(check, target.get(), "dst", "VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-11717");
    if (device.checks.core && isMicromap(target)) {
        check.require(info->mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR, "mode",
                      "VUID-VkCopyMemoryToAccelerationStructureInfoKHR-mode-03413", "it is not DESERIALIZE");
        checkSerializedAddress(check, info->src.deviceAddress, 128, "src",
                               "VUID-vkCmdCopyMemoryToAccelerationStructureKHR-pInfo-03742",
                               "VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11700");
    }
    deserialized(check, target, checkSerializedData(device.gpu, check, info->src.deviceAddress, target));
    device.traces.deserializes = true;
    sync::recordDeserialization(device.sync, commandBuffer, name, info->src.deviceAddress, target);
    device.next.CmdCopyMemoryToAccelerationStructureKHR(commandBuffer, info);
}

} // namespace validation
} // namespace vellum::layer
