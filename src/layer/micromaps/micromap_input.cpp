#include "layer/micromaps/micromap_input.h"

#include <string>

#include "core/records.h"
#include "layer/ground/driver.h"
#include "layer/ground/pnext.h"
#include "layer/memory/address_map.h"
#include "layer/micromaps/micromap_extent.h"

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

bool lossy(const BuildInfo &info)
{
    return (info.flags & VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR) != 0;
}

const VkAccelerationStructureGeometryKHR *geometryOf(const BuildInfo &info)
{
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

bool mayHaveUsages(const Judge &judge, const BuildInfo &info, const MicromapData &data, const MicromapLimits &limits)
{
    constexpr const char *kArrays = "VELLUM-VUID-VkAccelerationStructureGeometryMicromapDataKHR-pUsageCounts-11642";
    if (data.usageCountsCount > 0 && !data.pUsageCounts && !data.ppUsageCounts)
        return judge.refuse(kArrays, "usageCountsCount is not 0, but neither pUsageCounts nor ppUsageCounts is given");
    if (data.usageCountsCount > 0 && data.pUsageCounts && data.ppUsageCounts &&
        !judge.tolerate(kArrays, "both pUsageCounts and ppUsageCounts are given"))
        return false;
    uint64_t triangles = 0;
    for (uint32_t i = 0; i < data.usageCountsCount; ++i) {
        const VkMicromapUsageKHR &usage = data.pUsageCounts ? data.pUsageCounts[i] : *data.ppUsageCounts[i];
        const bool fourState = usage.format == VK_OPACITY_MICROMAP_FORMAT_4_STATE_KHR;
        if (!fourState && usage.format != VK_OPACITY_MICROMAP_FORMAT_2_STATE_KHR &&
            !judge.weigh(limits.takesUnknownFormats, "VELLUM-VUID-VkMicromapUsageKHR-format-parameter",
                         "usage count " + std::to_string(i) + ": format " + std::to_string(usage.format) +
                             " is neither 2-state nor 4-state"))
            return false;
        // Such triangles stay as they are.
        if (lossy(info) && usage.format == VK_OPACITY_MICROMAP_FORMAT_2_STATE_KHR &&
            !judge.tolerate("VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-format-11712",
                            "usage count " + std::to_string(i) + ": the format of a lossy micromap is not 4-state"))
            return false;
        const uint32_t most = lossy(info) ? limits.lossyLevel
                              : fourState ? limits.fourStateLevel
                                          : limits.twoStateLevel;
        if (usage.subdivisionLevel > most &&
            !mayHaveLevel(judge, i, usage.subdivisionLevel, most, usage.count,
                          lossy(info) ? "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11565"
                          : fourState
                              ? "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11564"
                              : "VELLUM-VUID-VkAccelerationStructureGeometryMicromapDataKHR-subdivisionLevel-11645"))
            return false;
        triangles += usage.count;
    }
    return triangles <= kMaxMicromapTriangles ||
           judge.tolerate("VELLUM-VUID-VkAccelerationStructureGeometryMicromapDataKHR-count-11643",
                          "the usage counts add up to " + std::to_string(triangles) +
                              " triangles, more than maxMicromapTriangles");
}

} // namespace

const MicromapData *micromapDataOf(const BuildInfo &info)
{
    const auto *geometry = info.geometryCount > 0 ? geometryOf(info) : nullptr;
    return geometry ? findInChain<MicromapData>(geometry->pNext,
                                                VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_MICROMAP_DATA_KHR)
                    : nullptr;
}

TranslatedMicromapBuild::TranslatedMicromapBuild(const BuildInfo &khr, const MicromapData &data, VkMicromapEXT target)
    : info{VK_STRUCTURE_TYPE_MICROMAP_BUILD_INFO_EXT}
{
    for (uint32_t i = 0; i < data.usageCountsCount; ++i) {
        const VkMicromapUsageKHR &usage = data.pUsageCounts ? data.pUsageCounts[i] : *data.ppUsageCounts[i];
        usages.push_back({usage.count, usage.subdivisionLevel, static_cast<uint32_t>(usage.format)});
    }
    info.type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT;
    info.flags = flagsOf(khr.flags);
    info.mode = VK_BUILD_MICROMAP_MODE_BUILD_EXT;
    info.dstMicromap = target;
    info.usageCountsCount = static_cast<uint32_t>(usages.size());
    info.pUsageCounts = usages.data();
    info.data.deviceAddress = data.data;
    info.scratchData.deviceAddress = khr.scratchData.deviceAddress;
    info.triangleArray.deviceAddress = data.triangleArray;
    info.triangleArrayStride = data.triangleArrayStride;
}

bool mayMeasureMicromap(const Driver &driver, const Judge &judge, const BuildInfo &info, const MicromapLimits &limits)
{
    if (!driver.asked.khrFeature &&
        !judge.tolerate("VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-micromap-11559",
                        "the feature VkPhysicalDeviceOpacityMicromapFeaturesKHR::micromap is not enabled"))
        return false;
    if (info.geometryCount != 1 &&
        !judge.weigh(info.geometryCount > 1,
                     "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryCount-11560",
                     "a micromap has one geometry, not " + std::to_string(info.geometryCount)))
        return false;
    const auto *geometry = geometryOf(info);
    if ((!geometry || (info.pGeometries && info.ppGeometries)) &&
        !judge.weigh(geometry, "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-pGeometries-03788",
                     "not exactly one of pGeometries and ppGeometries is given"))
        return false;
    const MicromapData *data = micromapDataOf(info);
    if (geometry->geometryType != VK_GEOMETRY_TYPE_MICROMAP_KHR &&
        !judge.weigh(data, "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11561",
                     "the geometry of a micromap is not of type VK_GEOMETRY_TYPE_MICROMAP_KHR"))
        return false;
    if (!data)
        return judge.refuse("VELLUM-VUID-VkAccelerationStructureGeometryKHR-micromap-11568",
                            "the geometry has no VkAccelerationStructureGeometryMicromapDataKHR");
    if ((info.flags & ~kMicromapBuildFlags) != 0 &&
        !judge.tolerate("VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11562",
                        "flags " + std::to_string(info.flags) + " holds some that are not for micromaps"))
        return false;
    return mayHaveUsages(judge, info, *data, limits);
}

bool mayReadInput(const AddressMap &addresses, const Judge &judge, const BuildInfo &info, VkDeviceSize scratchBytes)
{
    const MicromapData &data = *micromapDataOf(info);
    if (data.data == 0 || data.triangleArray == 0)
        return judge.refuse("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11550",
                            "data or triangleArray is a null address");
    if ((data.data % 128 != 0 || data.triangleArray % 128 != 0) &&
        !judge.tolerate("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11552",
                        "data or triangleArray is not a multiple of 128"))
        return false;
    if (scratchBytes == 0)
        return true;
    const VkDeviceAddress scratch = info.scratchData.deviceAddress;
    if (scratch == 0 || scratch % kLeastScratchAlignment != 0)
        return judge.refuse(scratch == 0 ? "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12261"
                                         : "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03710",
                            "scratchData is a null address or not aligned");
    if (addresses.bytesFrom(scratch) < scratchBytes)
        return judge.refuse("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12258",
                            "scratchData has " + std::to_string(addresses.bytesFrom(scratch)) +
                                " bytes in its buffer, the build needs " + std::to_string(scratchBytes));
    return true;
}

VkDeviceSize markedMicromapSize(VkDeviceSize bytes)
{
    return (bytes + 255 - kMicromapSizeMark) / 256 * 256 + kMicromapSizeMark;
}

} // namespace vellum::layer
