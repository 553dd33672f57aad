// SPDX-License-Identifier: Apache-2.0
#include "layer/micromaps/micromap_input.h"

#include <string>

#include "core/curve.h"
#include "core/records.h"
#include "layer/base/pnext.h"
#include "layer/state/device_state.h"

namespace vellum::layer
{
namespace
{

using namespace shared;
using BuildInfo = VkAccelerationStructureBuildGeometryInfoKHR;
using MicromapData = VkAccelerationStructureGeometryMicromapDataKHR;

constexpr VkBuildAccelerationStructureFlagsKHR kMicromapBuildFlags =
    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR |
    VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR |
    VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR | VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR;

constexpr VkBuildMicromapFlagsEXT kMicromapBuildFlagsExt = VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT |
                                                           VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT |
                                                           VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;

// The rules of one extension for the usage counts of a build.
struct UsageRules {
    const char *countsId;
    const char *formatId;
    bool takesUnknownFormats;
    uint32_t twoStateLevel, fourStateLevel;
    const char *twoStateId, *fourStateId;
};

bool checkLevel(const InputCheck &check, uint32_t i, const VkMicromapUsageEXT &usage, uint32_t most, const char *id)
{
    // The size of a micromap with such triangles is undefined.
    return usage.subdivisionLevel <= most ||
           check.tolerateIf(usage.count == 0, id,
                            "usage count " + std::to_string(i) + ": subdivision level " +
                                std::to_string(usage.subdivisionLevel) + " is above " + std::to_string(most));
}

// Calls `checkUsage(i, usage)` for each usage count, and adds it to the build.
template <typename Counts, typename CheckUsage>
bool parseUsages(const InputCheck &check, const UsageRules &rules, uint32_t count, const Counts *counts,
                 const Counts *const *pointers, MicromapBuild &build, CheckUsage checkUsage)
{
    if (count > 0 && !counts && !pointers)
        return check.reject(rules.countsId,
                            "usageCountsCount is not 0, but neither pUsageCounts nor ppUsageCounts is given");
    if (count > 0 && counts && pointers &&
        !check.tolerate(rules.countsId, "both pUsageCounts and ppUsageCounts are given"))
        return false;
    for (uint32_t i = 0; i < count; ++i) {
        const Counts &given = counts ? counts[i] : *pointers[i];
        VkMicromapUsageEXT usage{given.count, given.subdivisionLevel, static_cast<uint32_t>(given.format)};
        const bool twoState = usage.format == VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT;
        if (!twoState && usage.format != VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT) {
            if (!check.tolerateIf(rules.takesUnknownFormats, rules.formatId,
                                  "usage count " + std::to_string(i) + ": format " + std::to_string(usage.format) +
                                      " is neither 2-state nor 4-state"))
                return false;
            usage.format = VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT; // takes most
        }
        if (!checkUsage(i, usage) || !checkLevel(check, i, usage, twoState ? rules.twoStateLevel : rules.fourStateLevel,
                                                 twoState ? rules.twoStateId : rules.fourStateId))
            return false;
        if (usage.count > 0) // otherwise level and format may have any value
            build.usages.push_back(usage);
    }
    build.extent = extentOf(build.usages, build.flags);
    return true;
}

bool checkExtent(const InputCheck &check, const MicromapExtent &extent)
{
    return extent.countable() || check.reject("VELLUM-micromap-too-large",
                                              "the usage counts add up to more than 2^32 triangles or data units");
}

bool checkStride(const InputCheck &check, const MicromapBuild &build, const char *id)
{
    if (build.triangleStride > UINT32_MAX && build.extent.triangles > 1)
        return check.reject("VELLUM-micromap-stride", "triangleArrayStride does not fit 32 bits");
    // Tolerated: overlapping triangles are read as they are.
    return build.triangleStride >= sizeof(VkMicromapTriangleEXT) ||
           check.tolerate(id, "triangleArrayStride " + std::to_string(build.triangleStride) +
                                  " is less than the 8 bytes of a VkMicromapTriangleEXT");
}

// --- VK_KHR_opacity_micromap ---

const VkAccelerationStructureGeometryKHR *geometryOf(const BuildInfo &info)
{
    if (info.geometryCount == 0)
        return nullptr;
    if (info.pGeometries)
        return info.pGeometries;
    return info.ppGeometries ? info.ppGeometries[0] : nullptr;
}

VkBuildMicromapFlagsEXT flagsOf(VkBuildAccelerationStructureFlagsKHR flags)
{
    VkBuildMicromapFlagsEXT result = 0;
    if (flags & VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR)
        result |= VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT;
    if (flags & VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR)
        result |= VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT;
    if (flags & VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR)
        result |= VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
    if (flags & VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR)
        result |= kLossyBuild;
    return result;
}

// The data of the only geometry of a micromap; null, after a message, if it is missing.
const MicromapData *parseGeometry(const InputCheck &check, const BuildInfo &info)
{
    if (info.geometryCount != 1 &&
        !check.tolerateIf(info.geometryCount > 1,
                          "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryCount-11560",
                          "a micromap has one geometry, not " + std::to_string(info.geometryCount)))
        return nullptr;
    const auto *geometry = geometryOf(info);
    if ((!geometry || (info.pGeometries && info.ppGeometries)) &&
        !check.tolerateIf(geometry, "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-pGeometries-03788",
                          "not exactly one of pGeometries and ppGeometries is given"))
        return nullptr;
    const auto *data =
        findInChain<MicromapData>(geometry->pNext, VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_MICROMAP_DATA_KHR);
    if (geometry->geometryType != VK_GEOMETRY_TYPE_MICROMAP_KHR &&
        !check.tolerateIf(data, "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11561",
                          "the geometry of a micromap is not of type VK_GEOMETRY_TYPE_MICROMAP_KHR"))
        return nullptr;
    if (!data)
        check.reject("VELLUM-VUID-VkAccelerationStructureGeometryKHR-micromap-11568",
                     "the geometry has no VkAccelerationStructureGeometryMicromapDataKHR");
    return data;
}

bool parseUsages(const InputCheck &check, const MicromapData &data, const MicromapLimits &limits, MicromapBuild &build)
{
    const bool lossy = (build.flags & kLossyBuild) != 0;
    const char *lossyId = "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11565";
    const UsageRules rules{
        "VELLUM-VUID-VkAccelerationStructureGeometryMicromapDataKHR-pUsageCounts-11642",
        "VELLUM-VUID-VkMicromapUsageKHR-format-parameter",
        limits.takesUnknownFormats,
        lossy ? limits.lossyLevel : limits.twoStateLevel,
        lossy ? limits.lossyLevel : limits.fourStateLevel,
        lossy ? lossyId : "VELLUM-VUID-VkAccelerationStructureGeometryMicromapDataKHR-subdivisionLevel-11645",
        lossy ? lossyId : "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11564"};
    const auto checkUsage = [&](uint32_t i, const VkMicromapUsageEXT &usage) {
        // Tolerated: lossy builds do not change 2-state triangles.
        return !lossy || usage.format != VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT ||
               check.tolerate("VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-format-11712",
                              "usage count " + std::to_string(i) + ": the format of a lossy micromap is not 4-state");
    };
    return parseUsages(check, rules, data.usageCountsCount, data.pUsageCounts, data.ppUsageCounts, build, checkUsage) &&
           (build.extent.triangles <= kMaxMicromapTriangles ||
            check.tolerate("VELLUM-VUID-VkAccelerationStructureGeometryMicromapDataKHR-count-11643",
                           "the usage counts add up to " + std::to_string(build.extent.triangles) +
                               " triangles, more than maxMicromapTriangles"));
}

bool checkAddresses(const AddressMap &addresses, const InputCheck &check, const MicromapBuild &build,
                    VkDeviceSize scratchBytes)
{
    const VkDeviceAddress data = build.data.deviceAddress, triangles = build.triangles.deviceAddress;
    if (data == 0 || triangles == 0)
        return check.reject("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11550",
                            "data or triangleArray is a null address");
    if ((data % 128 != 0 || triangles % 128 != 0) &&
        !check.tolerate("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11552",
                        "data or triangleArray is not a multiple of 128"))
        return false;
    if (scratchBytes == 0)
        return true;
    if (build.scratch == 0 || build.scratch % kLeastScratchAlignment != 0)
        return check.reject(build.scratch == 0 ? "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12261"
                                               : "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03710",
                            "scratchData is a null address or not aligned");
    if (addresses.bytesFrom(build.scratch) < scratchBytes)
        return check.reject("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12258",
                            "scratchData has " + std::to_string(addresses.bytesFrom(build.scratch)) +
                                " bytes in its buffer, the build needs " + std::to_string(scratchBytes));
    return true;
}

} // namespace

std::optional<MicromapBuild> parseMicromapBuild(const InputCheck &check, const VkMicromapBuildInfoEXT &info)
{
    if (info.type != VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT) {
        check.reject("VELLUM-VUID-VkMicromapBuildInfoEXT-type-parameter",
                     "type " + std::to_string(info.type) + " is not VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT");
        return std::nullopt;
    }
    if ((info.flags & ~kMicromapBuildFlagsExt) != 0 &&
        !check.tolerate("VELLUM-VUID-VkMicromapBuildInfoEXT-flags-parameter",
                        "flags " + std::to_string(info.flags) + " has unknown bits"))
        return std::nullopt;
    MicromapBuild build;
    build.flags = info.flags & kMicromapBuildFlagsExt; // kLossyBuild is not among them
    build.data = info.data;
    build.triangles = info.triangleArray;
    build.triangleStride = info.triangleArrayStride;
    build.scratch = info.scratchData.deviceAddress;
    constexpr UsageRules kRules{"VELLUM-VUID-VkMicromapBuildInfoEXT-pUsageCounts-07516",
                                "VELLUM-VUID-VkMicromapBuildInfoEXT-format-11652",
                                true,
                                kMaxSubdivisionLevel,
                                kMaxSubdivisionLevel,
                                "VELLUM-VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11654",
                                "VELLUM-VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11655"};
    if (!parseUsages(check, kRules, info.usageCountsCount, info.pUsageCounts, info.ppUsageCounts, build,
                     [](uint32_t, const VkMicromapUsageEXT &) { return true; }) ||
        !checkExtent(check, build.extent))
        return std::nullopt;
    return build;
}

bool checkMicromapBuild(const InputCheck &check, const MicromapBuildRules &rules, const VkMicromapBuildInfoEXT &info,
                        MicromapBuild &build)
{
    // Tolerated: there is no other mode.
    if (info.mode != VK_BUILD_MICROMAP_MODE_BUILD_EXT &&
        !check.tolerate(rules.mode, "mode " + std::to_string(info.mode) + " is not VK_BUILD_MICROMAP_MODE_BUILD_EXT"))
        return false;
    if (!info.dstMicromap)
        return check.reject(rules.target, "dstMicromap is VK_NULL_HANDLE");
    build.target = *micromapOf(info.dstMicromap);
    if (build.target.size < build.extent.bytes())
        return check.reject(rules.size, "dstMicromap has " + std::to_string(build.target.size) +
                                            " bytes, the build needs " + std::to_string(build.extent.bytes()));
    return build.extent.triangles <= 1 || checkStride(check, build, "VELLUM-micromap-stride");
}

std::optional<MicromapBuild> parseMicromapBuild(const Driver &driver, const InputCheck &check, const BuildInfo &info,
                                                const MicromapLimits *limits)
{
    constexpr const char *kFeature = "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-micromap-11559";
    if (!limits) {
        check.reject(kFeature, "VK_KHR_opacity_micromap is not enabled");
        return std::nullopt;
    }
    if (!driver.enabled.khrFeature &&
        !check.tolerate(kFeature, "the feature VkPhysicalDeviceOpacityMicromapFeaturesKHR::micromap is not enabled"))
        return std::nullopt;
    const MicromapData *data = parseGeometry(check, info);
    if (!data)
        return std::nullopt;
    if ((info.flags & ~kMicromapBuildFlags) != 0 &&
        !check.tolerate("VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11562",
                        "flags " + std::to_string(info.flags) + " holds some that are not for micromaps"))
        return std::nullopt;
    MicromapBuild build;
    build.flags = flagsOf(info.flags);
    build.data.deviceAddress = data->data;
    build.triangles.deviceAddress = data->triangleArray;
    build.triangleStride = data->triangleArrayStride;
    build.scratch = info.scratchData.deviceAddress;
    if (!parseUsages(check, *data, *limits, build) || !checkExtent(check, build.extent))
        return std::nullopt;
    return build;
}

bool checkMicromapBuild(const DeviceState &objects, const InputCheck &check, const BuildInfo &info,
                        const MicromapBuildSizes &sizes, MicromapBuild &build)
{
    // Tolerated: the update is carried out as a build.
    if (info.mode != VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR &&
        !check.tolerate("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-mode-11545", "a micromap cannot be updated"))
        return false;
    build.structure = objects.accelerationStructures.get(info.dstAccelerationStructure);
    if (!build.structure || !canHoldMicromap(*build.structure))
        return check.reject("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11547",
                            "dstAccelerationStructure was created as neither OPACITY_MICROMAP nor GENERIC");
    build.target = micromapIn(*build.structure);
    build.bytes = sizes.micromap;
    if (build.target.size < sizes.micromap)
        return check.reject("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10126",
                            "dstAccelerationStructure has " + std::to_string(build.target.size) +
                                " bytes, the build needs " + std::to_string(sizes.micromap));
    if (build.extent.triangles == 0)
        return true;
    return checkAddresses(objects.buffers.addresses, check, build, sizes.scratch) &&
           checkStride(check, build,
                       "VELLUM-VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11646");
}

VkDeviceSize markedMicromapSize(VkDeviceSize bytes)
{
    return (bytes + 255 - kMicromapSizeMark) / 256 * 256 + kMicromapSizeMark;
}

} // namespace vellum::layer
