// SPDX-License-Identifier: Apache-2.0
// The host commands of VK_EXT_opacity_micromap, and those of acceleration structures that read or write micromaps.
#include "layer/validation/builds.h"
#include "layer/validation/copies.h"
#include "layer/validation/rules/build_rules.h"
#include "layer/validation/rules/implicit_rules.h"

namespace vellum::layer
{
namespace
{

using Structure = std::shared_ptr<ValidatedStructure>;

bool succeeded(VkResult result)
{
    return result >= 0; // VK_OPERATION_DEFERRED_KHR counts as done: its order is the application's
}

void checkFeature(const RuleCheck &check, const char *vuid)
{
    if (!check.device().driver.enabled.hostCommands)
        check.fault(vuid, "the feature micromapHostCommands is not enabled");
}

// The memory of a micromap that the host accesses.
void checkHostMemory(const RuleCheck &check, const Structure &micromap, const char *member, const char *vuid)
{
    if (!micromap || !micromap->buffer)
        return;
    const VkDeviceMemory memory = micromap->buffer->memory;
    check.require(memory && check.device().objects.memories.get(memory).hostVisible, member, vuid,
                  "its buffer is not bound to host-visible memory");
}

void checkHostAddress(const RuleCheck &check, const void *address, const char *member, const char *nullId,
                      const char *alignmentId)
{
    if (check.require(address != nullptr, member, nullId, "the pointer is null"))
        checkMultiple(check, reinterpret_cast<uintptr_t>(address), 16, member, alignmentId);
}

void checkResults(const RuleCheck &check, uint32_t count, VkQueryType type, size_t bytes, const void *data,
                  size_t stride)
{
    if (!check.require(
            type == VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT || type == VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT,
            "queryType", "VUID-vkWriteMicromapsPropertiesEXT-queryType-07503", "it is not a size of a micromap"))
        return;
    if (bytes < count * stride)
        check.fault("dataSize", "VUID-vkWriteMicromapsPropertiesEXT-dataSize-07576",
                    std::to_string(bytes) + " is less than micromapCount * stride, " + std::to_string(count * stride));
    checkMultiple(check, stride, sizeof(VkDeviceSize), "stride", "VUID-vkWriteMicromapsPropertiesEXT-queryType-10071");
    checkMultiple(check, reinterpret_cast<uintptr_t>(data), alignof(VkDeviceSize), "pData",
                  "VUID-vkWriteMicromapsPropertiesEXT-queryType-10072");
}

} // namespace

namespace validation
{

// What the structures hold then is unknown.
VkResult buildAccelerationStructures(DeviceValidation &device, VkDevice handle, VkDeferredOperationKHR operation,
                                     uint32_t count, const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                     const VkAccelerationStructureBuildRangeInfoKHR *const *ranges)
{
    if (device.checks.core)
        checkHostStructureBuilds(device, {infos, count});
    const VkResult result = device.next.BuildAccelerationStructuresKHR(handle, operation, count, infos, ranges);
    for (uint32_t i = 0; i < count && succeeded(result); ++i) {
        const auto structure = device.objects.structures.get(infos[i].dstAccelerationStructure);
        if (!structure)
            continue;
        remember([&] {
            device.logs.add(VK_NULL_HANDLE, [&](const Submission &) {
                setContents(device, *structure, unknownContents(infos[i].type));
            });
        });
        if (structure->record)
            device.records.set(*structure->record, {});
    }
    return result;
}

VkResult buildMicromaps(DeviceValidation &device, VkDevice handle, VkDeferredOperationKHR operation, uint32_t count,
                        const VkMicromapBuildInfoEXT *infos)
{
    const Place command("vkBuildMicromapsEXT");
    if (device.checks.core) {
        checkFeature(RuleCheck(device, command), "VUID-vkBuildMicromapsEXT-micromapHostCommands-07555");
        checkMicromapBuilds(device, VK_NULL_HANDLE, count, infos);
        for (uint32_t i = 0; i < count; ++i) {
            const Place place = command.element("pInfos", i);
            checkHostMemory(RuleCheck(device, place, infos[i].dstMicromap),
                            device.objects.micromaps.get(infos[i].dstMicromap), "dstMicromap",
                            "VUID-vkBuildMicromapsEXT-pInfos-07552");
        }
    }
    for (uint32_t i = 0; i < count; ++i)
        checkHostBuild(device.gpu, i, micromapBuildOf(device, infos[i]));
    const VkResult result = device.next.BuildMicromapsEXT(handle, operation, count, infos);
    for (uint32_t i = 0; succeeded(result) && i < count; ++i)
        remember([&] { micromapBuilt(device, VK_NULL_HANDLE, micromapBuildOf(device, infos[i])); });
    return result;
}

VkResult copyMicromap(DeviceValidation &device, VkDevice handle, VkDeferredOperationKHR operation,
                      const VkCopyMicromapInfoEXT *info)
{
    const Place command("vkCopyMicromapEXT");
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->dst);
    const Structure source = device.objects.micromaps.get(info->src);
    const Structure target = device.objects.micromaps.get(info->dst);
    if (device.checks.core) {
        checkStructure(check, *info, kCopyMicromapInfo);
        checkFeature(check, "VUID-vkCopyMicromapEXT-micromapHostCommands-07560");
        checkHostMemory(check, source, "src", "VUID-vkCopyMicromapEXT-buffer-07558");
        checkHostMemory(check, target, "dst", "VUID-vkCopyMicromapEXT-buffer-07559");
        checkConstructed(check, source, "VUID-vkCopyMicromapEXT-src-11670");
        check.require(info->mode == VK_COPY_MICROMAP_MODE_CLONE_EXT || info->mode == VK_COPY_MICROMAP_MODE_COMPACT_EXT,
                      "mode", "VUID-VkCopyMicromapInfoEXT-mode-07531", "it is neither CLONE nor COMPACT");
        if (info->mode == VK_COPY_MICROMAP_MODE_COMPACT_EXT)
            checkCompactable(check, source, "VUID-VkCopyMicromapInfoEXT-mode-07533");
    }
    const VkResult result = device.next.CopyMicromapEXT(handle, operation, info);
    if (succeeded(result))
        remember([&] { copied(check, source, target); });
    return result;
}

VkResult copyMicromapToMemory(DeviceValidation &device, VkDevice handle, VkDeferredOperationKHR operation,
                              const VkCopyMicromapToMemoryInfoEXT *info)
{
    const Place command("vkCopyMicromapToMemoryEXT");
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->src);
    if (device.checks.core) {
        const Structure source = device.objects.micromaps.get(info->src);
        checkStructure(check, *info, kCopyMicromapToMemoryInfo);
        checkFeature(check, "VUID-vkCopyMicromapToMemoryEXT-micromapHostCommands-07571");
        checkHostMemory(check, source, "src", "VUID-vkCopyMicromapToMemoryEXT-buffer-07568");
        checkConstructed(check, source, "VUID-VkCopyMicromapToMemoryInfoEXT-src-07540");
        check.require(info->mode == VK_COPY_MICROMAP_MODE_SERIALIZE_EXT, "mode",
                      "VUID-VkCopyMicromapToMemoryInfoEXT-mode-07542", "it is not SERIALIZE");
        checkHostAddress(check, info->dst.hostAddress, "dst", "VUID-vkCopyMicromapToMemoryEXT-pInfo-07569",
                         "VUID-vkCopyMicromapToMemoryEXT-pInfo-07570");
    }
    return device.next.CopyMicromapToMemoryEXT(handle, operation, info);
}

VkResult copyMemoryToMicromap(DeviceValidation &device, VkDevice handle, VkDeferredOperationKHR operation,
                              const VkCopyMemoryToMicromapInfoEXT *info)
{
    const Place command("vkCopyMemoryToMicromapEXT");
    const Place place = command.member("pInfo");
    const RuleCheck check(device, place, info->dst);
    const Structure target = device.objects.micromaps.get(info->dst);
    if (device.checks.core) {
        checkStructure(check, *info, kCopyMemoryToMicromapInfo);
        checkFeature(check, "VUID-vkCopyMemoryToMicromapEXT-micromapHostCommands-07566");
        checkHostMemory(check, target, "dst", "VUID-vkCopyMemoryToMicromapEXT-buffer-07565");
        check.require(info->mode == VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT, "mode",
                      "VUID-VkCopyMemoryToMicromapInfoEXT-mode-07548", "it is not DESERIALIZE");
        checkHostAddress(check, info->src.hostAddress, "src", "VUID-vkCopyMemoryToMicromapEXT-pInfo-07563",
                         "VUID-vkCopyMemoryToMicromapEXT-pInfo-07564");
    }
    auto header = checkSerializedData(check, info->src.hostAddress, target.get());
    const VkResult result = device.next.CopyMemoryToMicromapEXT(handle, operation, info);
    if (succeeded(result))
        remember([&] { deserialized(check, target, std::move(header)); });
    return result;
}

VkResult writeMicromapsProperties(DeviceValidation &device, VkDevice handle, uint32_t count,
                                  const VkMicromapEXT *micromaps, VkQueryType type, size_t bytes, void *data,
                                  size_t stride)
{
    const Place command("vkWriteMicromapsPropertiesEXT");
    checkCount(device, "vkWriteMicromapsPropertiesEXT", "micromapCount", count,
               "VUID-vkWriteMicromapsPropertiesEXT-micromapCount-arraylength");
    if (device.checks.core) {
        const RuleCheck check(device, command);
        checkFeature(check, "VUID-vkWriteMicromapsPropertiesEXT-micromapHostCommands-07578");
        checkResults(check, count, type, bytes, data, stride);
        for (uint32_t i = 0; i < count; ++i) {
            const Place place = command.element("pMicromaps", i);
            const RuleCheck part(device, place, micromaps[i]);
            const Structure micromap = device.objects.micromaps.get(micromaps[i]);
            checkHostMemory(part, micromap, "buffer", "VUID-vkWriteMicromapsPropertiesEXT-buffer-07577");
            checkConstructed(part, micromap, "VUID-vkWriteMicromapsPropertiesEXT-pMicromaps-11671");
            if (type == VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT)
                checkCompactable(part, micromap, "VUID-vkWriteMicromapsPropertiesEXT-pMicromaps-07502");
        }
    }
    return device.next.WriteMicromapsPropertiesEXT(handle, count, micromaps, type, bytes, data, stride);
}

void getDeviceMicromapCompatibility(DeviceValidation &device, VkDevice handle, const VkMicromapVersionInfoEXT *info,
                                    VkAccelerationStructureCompatibilityKHR *result)
{
    if (device.checks.core && !device.driver.enabled.extFeature)
        device.fault(Place("vkGetDeviceMicromapCompatibilityEXT"),
                     "VUID-vkGetDeviceMicromapCompatibilityEXT-micromap-11666", "the feature micromap is not enabled");
    device.next.GetDeviceMicromapCompatibilityEXT(handle, info, result);
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
    if (succeeded(result))
        remember([&] { copied(check, source, device.objects.structures.get(info->dst)); });
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
    if (succeeded(result))
        remember([&] { deserialized(check, target, std::move(header)); });
    device.traces.deserializes = true;
    return result;
}

VkResult writeAccelerationStructuresProperties(DeviceValidation &device, VkDevice handle, uint32_t count,
                                               const VkAccelerationStructureKHR *structures, VkQueryType type,
                                               size_t bytes, void *data, size_t stride)
{
    const Place command("vkWriteAccelerationStructuresPropertiesKHR");
    for (uint32_t i = 0; device.checks.core && i < count; ++i) {
        const Place place = command.element("pAccelerationStructures", i);
        checkConstructed(RuleCheck(device, place, structures[i]), device.objects.structures.get(structures[i]),
                         "VUID-vkWriteAccelerationStructuresPropertiesKHR-pAccelerationStructures-11591");
    }
    return device.next.WriteAccelerationStructuresPropertiesKHR(handle, count, structures, type, bytes, data, stride);
}

} // namespace validation
} // namespace vellum::layer
