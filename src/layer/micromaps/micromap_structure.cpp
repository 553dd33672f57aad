#include "layer/micromaps/micromap_structure.h"

#include <new>
#include <string>
#include <vector>

#include "core/curve.h"
#include "core/records.h"
#include "layer/ground/pnext.h"
#include "layer/micromaps/device_micromaps.h"
#include "layer/micromaps/micromap.h"
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

const MicromapData *dataOf(const BuildInfo &info)
{
    const auto *geometry = info.geometryCount > 0 ? geometryOf(info) : nullptr;
    return geometry ? findInChain<MicromapData>(geometry->pNext,
                                                VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_MICROMAP_DATA_KHR)
                    : nullptr;
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

// A build as VK_EXT_opacity_micromap puts it. Points into itself.
struct Translated {
    Translated(const BuildInfo &khr, const MicromapData &data, VkMicromapEXT target)
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
    Translated(Translated &&) = default;
    Translated(const Translated &) = delete;
    Translated &operator=(const Translated &) = delete;
    Translated &operator=(Translated &&) = delete;
    VkMicromapBuildInfoEXT info;
    std::vector<VkMicromapUsageEXT> usages;
};

bool mayHaveUsages(const Judge &judge, const BuildInfo &info, const MicromapData &data)
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
            !judge.tolerate("VELLUM-VUID-VkMicromapUsageKHR-format-parameter",
                            "usage count " + std::to_string(i) + ": format " + std::to_string(usage.format) +
                                " is neither 2-state nor 4-state"))
            return false;
        // Such triangles stay as they are.
        if (lossy(info) && usage.format == VK_OPACITY_MICROMAP_FORMAT_2_STATE_KHR &&
            !judge.tolerate("VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-format-11712",
                            "usage count " + std::to_string(i) + ": the format of a lossy micromap is not 4-state"))
            return false;
        if (usage.subdivisionLevel > kMaxSubdivisionLevel &&
            !mayHaveLevel(judge, i, usage.subdivisionLevel, usage.count,
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

// What sizes depend on.
bool mayMeasureStructure(const DeviceMicromaps &device, const Judge &judge, const BuildInfo &info)
{
    if (!device.driver.asked.khrFeature &&
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
    const MicromapData *data = dataOf(info);
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
    return mayHaveUsages(judge, info, *data) && mayBeSoLarge(judge, extentOf(Translated(info, *data, {}).info));
}

bool mayBuildStructure(const DeviceMicromaps &device, const Judge &judge, const BuildInfo &info)
{
    if (!mayMeasureStructure(device, judge, info))
        return false;
    // It is built.
    if (info.mode != VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR &&
        !judge.tolerate("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-mode-11545", "a micromap cannot be updated"))
        return false;
    const auto target = device.objects.accelerationStructures.get(info.dstAccelerationStructure);
    if (!target || (target->type != VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR &&
                    target->type != VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR))
        return judge.refuse("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11547",
                            "dstAccelerationStructure was created as neither OPACITY_MICROMAP nor GENERIC");
    const MicromapData &data = *dataOf(info);
    const MicromapExtent extent = extentOf(Translated(info, data, micromapIn(*target)).info);
    if (target->size < extent.bytes())
        return judge.refuse("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10126",
                            "dstAccelerationStructure has " + std::to_string(target->size) +
                                " bytes, the build needs " + std::to_string(extent.bytes()));
    if (extent.triangles == 0)
        return true;
    if (data.data == 0 || data.triangleArray == 0)
        return judge.refuse("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11550",
                            "data or triangleArray is a null address");
    if ((data.data % 128 != 0 || data.triangleArray % 128 != 0) &&
        !judge.tolerate("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11552",
                        "data or triangleArray is not a multiple of 128"))
        return false;
    const VkDeviceAddress scratch = info.scratchData.deviceAddress;
    if (scratch == 0 || scratch % kLeastScratchAlignment != 0)
        return judge.refuse(scratch == 0 ? "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12261"
                                         : "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03710",
                            "scratchData is a null address or not aligned");
    if (device.buffers.addresses.bytesFrom(scratch) < extent.scratchBytes())
        return judge.refuse("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12258",
                            "scratchData has " + std::to_string(device.buffers.addresses.bytesFrom(scratch)) +
                                " bytes in its buffer, the build needs " + std::to_string(extent.scratchBytes()));
    return mayHaveStride(judge, data.triangleArrayStride, extent,
                         "VELLUM-VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11646");
}

// The least size of a micromap that is told to applications, so that a GENERIC structure made for it is known.
constexpr VkDeviceSize markedSize(VkDeviceSize bytes)
{
    return (bytes + 255 - kMicromapSizeMark) / 256 * 256 + kMicromapSizeMark;
}

Judge judgeOf(const DeviceMicromaps &device, const char *command, VkAccelerationStructureKHR structure,
              std::optional<uint32_t> element = std::nullopt)
{
    return {device.driver.report(), command, VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR,
            reinterpret_cast<uint64_t>(structure), element};
}

} // namespace

void getMicromapStructureSizes(const DeviceMicromaps &device, const BuildInfo &info,
                               VkAccelerationStructureBuildSizesInfoKHR &sizes)
{
    sizes.accelerationStructureSize = 0;
    sizes.updateScratchSize = 0;
    sizes.buildScratchSize = 0;
    if (!mayMeasureStructure(device, {device.driver.report(), "vkGetAccelerationStructureBuildSizesKHR"}, info))
        return;
    const Translated build(info, *dataOf(info), VK_NULL_HANDLE);
    const MicromapExtent extent = extentOf(build.info);
    sizes.accelerationStructureSize = markedSize(extent.bytes());
    sizes.buildScratchSize = extent.scratchBytes();
}

void cmdBuildMicromapStructures(DeviceMicromaps &device, VkCommandBuffer commandBuffer, const char *command,
                                uint32_t count, const BuildInfo *infos)
{
    std::vector<Translated> builds;
    for (uint32_t i = 0; i < count; ++i) {
        if (!isMicromapBuild(infos[i]))
            continue;
        if (!mayBuildStructure(device, judgeOf(device, command, infos[i].dstAccelerationStructure, i), infos[i]))
            continue;
        const auto target = device.objects.accelerationStructures.get(infos[i].dstAccelerationStructure);
        becomeMicromap(device.objects, *target);
        builds.emplace_back(infos[i], *dataOf(infos[i]), micromapIn(*target));
    }
    std::vector<const VkMicromapBuildInfoEXT *> translated;
    for (const Translated &build : builds)
        translated.push_back(&build.info);
    recordMicromapBuilds(device, commandBuffer, translated);
}

bool copiesMicromapStructure(DeviceMicromaps &device, VkCommandBuffer commandBuffer,
                             const VkCopyAccelerationStructureInfoKHR &info)
{
    const auto source = device.objects.accelerationStructures.get(info.src);
    const auto target = device.objects.accelerationStructures.get(info.dst);
    const bool any = (source && holdsMicromap(*source)) ||
                     (target && target->type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR);
    if (!any)
        return false;
    const Judge judge = judgeOf(device, "vkCmdCopyAccelerationStructureKHR", info.dst);
    if (!source || !target || !canHoldMicromap(*source) || !canHoldMicromap(*target)) {
        judge.refuse("VELLUM-copy-type", "one of src and dst is no micromap");
        return true;
    }
    if (info.mode != VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR &&
        info.mode != VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR &&
        !judge.tolerate("VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-mode-03410",
                        "mode is neither clone nor compact"))
        return true;
    becomeMicromap(device.objects, *target);
    recordMicromapCopy(device, commandBuffer, "vkCmdCopyAccelerationStructureKHR", source->micromap, target->micromap);
    return true;
}

bool savesMicromapStructure(DeviceMicromaps &device, VkCommandBuffer commandBuffer,
                            const VkCopyAccelerationStructureToMemoryInfoKHR &info)
{
    const auto source = device.objects.accelerationStructures.get(info.src);
    if (!source || !holdsMicromap(*source))
        return false;
    const Judge judge = judgeOf(device, "vkCmdCopyAccelerationStructureToMemoryKHR", info.src);
    if (info.mode != VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR &&
        !judge.tolerate("VELLUM-VUID-VkCopyAccelerationStructureToMemoryInfoKHR-mode-03412", "mode is not SERIALIZE"))
        return true;
    if (judge.mayHoldSerialized(info.dst.deviceAddress, 128,
                                "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03739",
                                "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11699"))
        recordMicromapSave(device, commandBuffer, source->micromap, info.dst.deviceAddress);
    return true;
}

bool restoresMicromapStructure(DeviceMicromaps &device, VkCommandBuffer commandBuffer,
                               const VkCopyMemoryToAccelerationStructureInfoKHR &info)
{
    const auto target = device.objects.accelerationStructures.get(info.dst);
    if (!target || target->type != VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR)
        return false;
    const Judge judge = judgeOf(device, "vkCmdCopyMemoryToAccelerationStructureKHR", info.dst);
    if (info.mode != VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR &&
        !judge.tolerate("VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-mode-03413", "mode is not DESERIALIZE"))
        return true;
    if (judge.mayHoldSerialized(info.src.deviceAddress, 128,
                                "VELLUM-VUID-vkCmdCopyMemoryToAccelerationStructureKHR-pInfo-03742",
                                "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11700")) {
        becomeMicromap(device.objects, *target);
        recordMicromapRestore(device, commandBuffer, target->micromap, info.src.deviceAddress);
    }
    return true;
}

} // namespace vellum::layer
