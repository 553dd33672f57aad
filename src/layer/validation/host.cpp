// SPDX-License-Identifier: Apache-2.0
// The host commands of VK_EXT_opacity_micromap, and those of acceleration structures that read or write micromaps.
#include "layer/input/checked.h"
#include "layer/rules/builds.h"
#include "layer/rules/copies.h"
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

// The micromaps that structures are built with.
std::vector<Structure> micromapsOf(const DeviceModel &device, const input::Builds &builds)
{
    std::vector<Structure> micromaps;
    for (const input::StructureBuild &build : builds.structures)
        for (const input::Geometry &geometry : build.geometries)
            if (auto micromap =
                    geometry.attachment ? device.objects.structureOf(geometry.attachment->micromap) : nullptr)
                micromaps.push_back(std::move(micromap));
    return micromaps;
}

} // namespace

namespace validation
{

// The content of the structures is unknown afterwards.
VkResult buildAccelerationStructures(DeviceValidation &device, VkDevice handle, VkDeferredOperationKHR operation,
                                     uint32_t count, const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                     const VkAccelerationStructureBuildRangeInfoKHR *const *ranges)
{
    input::Builds builds = input::parse(count, infos, ranges);
    noteChecked(device, builds);
    rules::checkHostBuilds(device.rules, Place("vkBuildAccelerationStructuresKHR"), builds);
    const std::vector<Structure> attached = micromapsOf(device, builds);
    const input::Checked checked(infos, builds);
    const VkResult result = device.next.BuildAccelerationStructuresKHR(handle, operation, count, infos, ranges);
    for (uint32_t i = 0; i < count && succeeded(result); ++i) {
        const auto structure = device.objects.structures.get(infos[i].dstAccelerationStructure);
        if (!structure)
            continue;
        remember(device.objects, [&] {
            findReference(device, structure);
            device.logs.add(VK_NULL_HANDLE, [&](const Submission &) {
                setContents(device, structure, unknownContents(infos[i].type));
            });
        });
        if (structure->record)
            device.records.set(*structure->record, {});
    }
    if (succeeded(result) && !attached.empty())
        remember(device.objects, [&] {
            device.logs.add(VK_NULL_HANDLE, [&](const Submission &) {
                for (const Structure &micromap : attached)
                    setAttached(*micromap, false);
            });
        });
    return result;
}

VkResult buildMicromaps(DeviceValidation &device, VkDevice handle, VkDeferredOperationKHR operation, uint32_t count,
                        const VkMicromapBuildInfoEXT *infos)
{
    input::Builds builds = input::parse(count, infos, true);
    checkBuilds(device, VK_NULL_HANDLE, builds);
    for (const input::MicromapBuild &build : builds.micromaps)
        checkHostBuild(device.gpu, build);
    const input::Builds kept = builds;
    const input::Checked checked(infos, builds);
    const VkResult result = device.next.BuildMicromapsEXT(handle, operation, count, infos);
    for (size_t i = 0; succeeded(result) && i < kept.micromaps.size(); ++i)
        remember(device.objects, [&] { micromapBuilt(device, VK_NULL_HANDLE, kept.micromaps[i]); });
    return result;
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
    if (succeeded(result))
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
    if (succeeded(result))
        remember(device.objects, [&] { deserialized(check, target, std::move(header)); });
    return result;
}

VkResult writeMicromapsProperties(DeviceValidation &device, VkDevice handle, uint32_t count,
                                  const VkMicromapEXT *micromaps, VkQueryType type, size_t bytes, void *data,
                                  size_t stride)
{
    const Place command("vkWriteMicromapsPropertiesEXT");
    checkCount(device, "vkWriteMicromapsPropertiesEXT", "micromapCount", count,
               "VUID-vkWriteMicromapsPropertiesEXT-micromapCount-arraylength");
    input::PropertyQuery query = input::parseQuery(count, micromaps, type, 0);
    query.bytes = bytes;
    query.stride = stride;
    query.memory = data;
    rules::checkHostQuery(device.at(command), query, [&device](ObjectHandle object) { return device.factsOf(object); });
    for (uint32_t i = 0; device.checks.core && i < count; ++i) {
        const Place place = command.element("pMicromaps", i);
        const RuleCheck part(device, place, micromaps[i]);
        const Structure micromap = device.objects.micromaps.get(micromaps[i]);
        checkConstructed(part, micromap, "VUID-vkWriteMicromapsPropertiesEXT-pMicromaps-11671");
        if (type == VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT)
            checkCompactable(part, micromap, "VUID-vkWriteMicromapsPropertiesEXT-pMicromaps-07502");
    }
    const input::Checked checked(micromaps, query);
    return device.next.WriteMicromapsPropertiesEXT(handle, count, micromaps, type, bytes, data, stride);
}

void getDeviceMicromapCompatibility(DeviceValidation &device, VkDevice handle, const VkMicromapVersionInfoEXT *info,
                                    VkAccelerationStructureCompatibilityKHR *result)
{
    checkFeature(device.at(Place("vkGetDeviceMicromapCompatibilityEXT")),
                 "VUID-vkGetDeviceMicromapCompatibilityEXT-micromap-11666");
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
    if (succeeded(result))
        remember(device.objects, [&] { deserialized(check, target, std::move(header)); });
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
