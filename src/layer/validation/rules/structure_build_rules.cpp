// SPDX-License-Identifier: Apache-2.0
// Builds of acceleration structures, as far as micromaps are concerned.
#include "layer/validation/rules/build_rules.h"

#include "layer/base/pnext.h"
#include "layer/validation/rules/implicit_rules.h"

namespace vellum::layer
{
namespace
{

using BuildInfo = VkAccelerationStructureBuildGeometryInfoKHR;
using RangeInfo = VkAccelerationStructureBuildRangeInfoKHR;

constexpr VkFlags kForMicromaps = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR |
                                  VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR |
                                  VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR |
                                  VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR;
constexpr VkFlags kUpdate = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_BIT_KHR;
constexpr VkFlags kDataUpdate = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_DATA_UPDATE_EXT;
constexpr VkFlags kDisable = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_BIT_KHR;
constexpr VkFlags kLossy = VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR;

// Flags that need something that a build does not have.
void checkFlags(const RuleCheck &check, const BuildInfo &info)
{
    const EnabledFeatures &enabled = check.device().driver.enabled;
    const bool micromap = buildsMicromap(info);
    struct FlagRule {
        bool broken;
        const char *vuid;
        const char *found;
    };
    const FlagRule rules[] = {
        {(info.flags & kUpdate) && (info.flags & kDataUpdate),
         "VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11558",
         "ALLOW_OPACITY_MICROMAP_UPDATE and ALLOW_OPACITY_MICROMAP_DATA_UPDATE are both set"},
        {micromap && (info.flags & ~kForMicromaps), "VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11562",
         "a flag is set that is not for micromaps"},
        {!micromap && (info.flags & kLossy), "VUID-VkAccelerationStructureBuildGeometryInfoKHR-type-11563",
         "MICROMAP_LOSSY is set for a structure that is not a micromap"},
        {(info.flags & kDataUpdate) && !enabled.extFeature,
         "VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11709",
         "ALLOW_OPACITY_MICROMAP_DATA_UPDATE is set, the feature micromap of VK_EXT_opacity_micromap is not enabled"},
        {(info.flags & kUpdate) && !enabled.anyFeature(),
         "VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11710",
         "ALLOW_OPACITY_MICROMAP_UPDATE is set, no feature micromap is enabled"},
        {(info.flags & kDisable) && !enabled.anyFeature(),
         "VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11711",
         "ALLOW_DISABLE_OPACITY_MICROMAPS is set, no feature micromap is enabled"},
    };
    for (const FlagRule &rule : rules)
        check.require(!rule.broken, "flags", rule.vuid, rule.found);
}

// The geometry of a micromap. Returns whether its data can be checked.
bool checkMicromapGeometry(const RuleCheck &check, const BuildInfo &info)
{
    check.require(check.device().driver.enabled.khrFeature, "type",
                  "VUID-VkAccelerationStructureBuildGeometryInfoKHR-micromap-11559",
                  "the feature micromap of VK_KHR_opacity_micromap is not enabled");
    if (info.geometryCount != 1)
        check.fault("geometryCount", "VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryCount-11560",
                    std::to_string(info.geometryCount) + " geometries; a micromap has one");
    if (info.geometryCount == 0)
        return false;
    const auto *geometry = geometryOf(info, 0);
    check.require((info.pGeometries == nullptr) != (info.ppGeometries == nullptr), "pGeometries",
                  "VUID-VkAccelerationStructureBuildGeometryInfoKHR-pGeometries-03788",
                  "not exactly one of pGeometries and ppGeometries is given");
    if (!geometry)
        return false;
    const Place place = check.place().element("pGeometries", 0);
    const RuleCheck part = check.at(place);
    const bool right = part.require(geometry->geometryType == VK_GEOMETRY_TYPE_MICROMAP_KHR, "geometryType",
                                    "VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11561",
                                    "the geometry of a micromap is not of type VK_GEOMETRY_TYPE_MICROMAP_KHR");
    if (right)
        part.require(geometry->flags == 0, "flags", "VUID-VkAccelerationStructureGeometryKHR-flags-11569",
                     "the geometry of a micromap has flags");
    const bool hasData =
        findInChain(geometry->pNext, VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_MICROMAP_DATA_KHR) != nullptr;
    return part.require(hasData || !right, "pNext", "VUID-VkAccelerationStructureGeometryKHR-micromap-11568",
                        "there is no VkAccelerationStructureGeometryMicromapDataKHR") &&
           hasData;
}

BuildMemory checkMicromapBuild(const RuleCheck &check, const BuildInfo &info, const RangeInfo *ranges)
{
    check.require(info.mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR, "mode",
                  "VUID-vkCmdBuildAccelerationStructuresKHR-mode-11545", "a micromap cannot be updated");
    check.require(!info.srcAccelerationStructure, "srcAccelerationStructure",
                  "VUID-vkCmdBuildAccelerationStructuresKHR-srcAccelerationStructure-11546",
                  "a micromap is built, but it is not VK_NULL_HANDLE");
    check.require(!ranges, "type", "VUID-vkCmdBuildAccelerationStructuresKHR-ppBuildRangeInfos-11544",
                  "a micromap is built, but its element of ppBuildRangeInfos is not null");
    if (!checkMicromapGeometry(check, info))
        return {};
    const auto target = check.device().objects.structures.get(info.dstAccelerationStructure);
    if (target && !check.require(target->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR ||
                                     target->type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR,
                                 "dstAccelerationStructure",
                                 "VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11547",
                                 "it was created as neither OPACITY_MICROMAP nor GENERIC"))
        return {};
    return checkMicromapData(check, info, *micromapBuildOf(check.device(), info));
}

void checkOtherGeometries(const RuleCheck &check, bool indirect, const BuildInfo &info)
{
    for (uint32_t g = 0; g < info.geometryCount; ++g) {
        const auto *geometry = geometryOf(info, g);
        if (!geometry)
            return;
        const Place place = check.place().element("pGeometries", g);
        const RuleCheck part = check.at(place);
        if (geometry->geometryType == VK_GEOMETRY_TYPE_TRIANGLES_KHR)
            checkUnique(part, geometry->geometry.triangles.pNext,
                        "VUID-VkAccelerationStructureGeometryTrianglesDataKHR-sType-unique");
        part.require(geometry->geometryType != VK_GEOMETRY_TYPE_MICROMAP_KHR, "geometryType",
                     "VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11707",
                     "the geometry is for micromaps, the structure is not one");
        if (const auto attachment = attachmentOf(check.device(), *geometry)) {
            const Place triangles = place.member("geometry.triangles");
            checkAttachment(check.at(triangles), indirect, *attachment);
        }
    }
    checkUpdate(check, indirect, info);
}

// Rules of all structures, as far as they are not about their geometries.
void checkTarget(const RuleCheck &check, const BuildInfo &info)
{
    const bool update = info.mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
    check.require(update || info.mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR, "mode",
                  "VUID-vkCmdBuildAccelerationStructuresKHR-mode-04628", "it is neither BUILD nor UPDATE");
    check.require(!update || info.srcAccelerationStructure, "srcAccelerationStructure",
                  "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-04630", "an update has no source");
    const auto target = check.device().objects.structures.get(info.dstAccelerationStructure);
    checkBound(check, target.get(), "dstAccelerationStructure",
               "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03707");
}

// The first byte of each: builds of other structures need sizes that depend on their input.
BuildMemory memoryOfOther(const DeviceModel &device, const BuildInfo &info)
{
    const auto target = device.objects.structures.get(info.dstAccelerationStructure);
    return {target ? target->handle : ObjectHandle(), memoryOf(target.get(), 1),
            memoryAt(device, info.scratchData.deviceAddress, 1)};
}

// Micromaps that geometries attach, against the targets of the other elements.
void checkAttachedTargets(const RuleCheck &command, StructureBuildInfos infos, std::span<const BuildMemory> builds,
                          uint32_t i)
{
    for (uint32_t g = 0; g < infos[i].geometryCount && !buildsMicromap(infos[i]); ++g) {
        const auto *geometry = geometryOf(infos[i], g);
        const auto attachment = geometry ? attachmentOf(command.device(), *geometry) : std::nullopt;
        if (!attachment || !attachment->khr || !attachment->micromap)
            continue;
        const MemoryRange memory = memoryOf(attachment->micromap.get(), 1);
        for (uint32_t other = 0; other < infos.size(); ++other) {
            if (other == i)
                continue;
            const Place place = command.place().element("pInfos", other);
            const bool same = builds[other].target.handle == attachment->handle.handle;
            if (same || memory.overlaps(builds[other].targetRange))
                command.at(place).fault(
                    "dstAccelerationStructure",
                    same ? "VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11548"
                         : "VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11549",
                    std::string(same ? "it is" : "it overlaps in memory") + " the micromap of pInfos[" +
                        std::to_string(i) + "].pGeometries[" + std::to_string(g) + "]");
        }
    }
}

} // namespace

void checkStructureBuilds(DeviceModel &device, VkCommandBuffer commandBuffer, StructureBuildInfos infos,
                          const RangeInfo *const *ranges)
{
    const Place place("vkCmdBuildAccelerationStructuresKHR");
    const RuleCheck command(device, place, commandBuffer, commandBuffer);
    std::vector<BuildMemory> builds;
    bool micromaps = false;
    for (uint32_t i = 0; i < infos.size(); ++i) {
        const BuildInfo &info = infos[i];
        const RangeInfo *range = ranges ? ranges[i] : nullptr;
        const Place element = place.element("pInfos", i);
        const RuleCheck check(device, element, info.dstAccelerationStructure, commandBuffer);
        checkFlags(check, info);
        if (buildsMicromap(info)) {
            micromaps = true;
            builds.push_back(checkMicromapBuild(check, info, range));
            continue;
        }
        const Place rangePlace = place.element("ppBuildRangeInfos", i);
        if (!range && info.geometryCount > 0)
            check.at(rangePlace)
                .fault("VUID-vkCmdBuildAccelerationStructuresKHR-ppBuildRangeInfos-11543",
                       "it is null, and the structure is not a micromap");
        checkTarget(check, info);
        checkOtherGeometries(check, false, info);
        builds.push_back(memoryOfOther(device, info));
    }
    for (uint32_t i = 0; i < infos.size() && infos.size() > 1; ++i)
        checkAttachedTargets(command, infos, builds, i);
    if (micromaps)
        checkOverlaps(command, builds,
                      {"VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-03698",
                       "VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-03702",
                       "VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-03703",
                       "VUID-vkCmdBuildAccelerationStructuresKHR-scratchData-03704"});
}

void checkIndirectStructureBuilds(DeviceModel &device, VkCommandBuffer commandBuffer, StructureBuildInfos infos)
{
    const Place place("vkCmdBuildAccelerationStructuresIndirectKHR");
    for (uint32_t i = 0; i < infos.size(); ++i) {
        const Place element = place.element("pInfos", i);
        const RuleCheck check(device, element, infos[i].dstAccelerationStructure, commandBuffer);
        checkFlags(check, infos[i]);
        if (check.require(!buildsMicromap(infos[i]), "type",
                          "VUID-vkCmdBuildAccelerationStructuresIndirectKHR-type-11557",
                          "a micromap cannot be built indirectly"))
            checkOtherGeometries(check, true, infos[i]);
    }
}

void checkHostStructureBuilds(DeviceModel &device, StructureBuildInfos infos)
{
    const Place command("vkBuildAccelerationStructuresKHR");
    for (uint32_t i = 0; i < infos.size(); ++i) {
        const Place element = command.element("pInfos", i);
        for (uint32_t g = 0; g < infos[i].geometryCount; ++g) {
            const auto *geometry = geometryOf(infos[i], g);
            const auto attachment = geometry ? attachmentOf(device, *geometry) : std::nullopt;
            if (!attachment)
                continue;
            const Place place = element.element("pGeometries", g);
            const RuleCheck check(device, place, infos[i].dstAccelerationStructure);
            const bool indexed = attachment->indexType != VK_INDEX_TYPE_NONE_KHR;
            if (attachment->khr) {
                check.require(attachment->handle.handle == 0, "micromap",
                              "VUID-vkBuildAccelerationStructuresKHR-pInfos-11705",
                              "it is not VK_NULL_HANDLE; the host builds no structures with micromaps");
                continue;
            }
            check.require(indexed || !attachment->indexBuffer.hostAddress, "indexBuffer",
                          "VUID-vkBuildAccelerationStructuresKHR-pInfos-10892",
                          "it is not null, although indexType is VK_INDEX_TYPE_NONE_KHR");
            check.require(!indexed || attachment->indexBuffer.hostAddress, "indexBuffer",
                          "VUID-vkBuildAccelerationStructuresKHR-pInfos-11821",
                          "it is null, although there is an indexType");
        }
    }
}

void checkStructureSizeQuery(DeviceModel &device, VkAccelerationStructureBuildTypeKHR type, const BuildInfo &info,
                             const uint32_t *most)
{
    const Place command("vkGetAccelerationStructureBuildSizesKHR");
    const RuleCheck check(device, command);
    const Place place = command.member("pBuildInfo");
    checkFlags(check.at(place), info);
    if (!buildsMicromap(info)) {
        check.require(most || info.geometryCount == 0, "pMaxPrimitiveCounts",
                      "VUID-vkGetAccelerationStructureBuildSizesKHR-pMaxPrimitiveCounts-11612",
                      "it is null, and the structure is not a micromap");
        return;
    }
    check.require(type == VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, "buildType",
                  "VUID-vkGetAccelerationStructureBuildSizesKHR-buildType-11614",
                  "micromaps are built on the device only");
    check.require(!most, "pMaxPrimitiveCounts",
                  "VUID-vkGetAccelerationStructureBuildSizesKHR-pMaxPrimitiveCounts-11613",
                  "it is not null, and the structure is a micromap");
    if (checkMicromapGeometry(check.at(place), info))
        checkMicromapCounts(check.at(place), info, *micromapBuildOf(device, info));
}

} // namespace vellum::layer
