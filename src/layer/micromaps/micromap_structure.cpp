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
    const auto *geometry = info.geometryCount == 1 ? geometryOf(info) : nullptr;
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

std::optional<Offence> usageOffenceOf(const BuildInfo &info, const MicromapData &data)
{
    if (data.usageCountsCount > 0 && (data.pUsageCounts != nullptr) == (data.ppUsageCounts != nullptr))
        return Offence{"VELLUM-VUID-VkAccelerationStructureGeometryMicromapDataKHR-pUsageCounts-11642",
                       data.pUsageCounts
                           ? "both pUsageCounts and ppUsageCounts are given"
                           : "usageCountsCount is not 0, but neither pUsageCounts nor ppUsageCounts is given"};
    uint64_t triangles = 0;
    for (uint32_t i = 0; i < data.usageCountsCount; ++i) {
        const VkMicromapUsageKHR &usage = data.pUsageCounts ? data.pUsageCounts[i] : *data.ppUsageCounts[i];
        const std::string where = "usage count " + std::to_string(i) + ": ";
        if (usage.format != VK_OPACITY_MICROMAP_FORMAT_2_STATE_KHR &&
            usage.format != VK_OPACITY_MICROMAP_FORMAT_4_STATE_KHR)
            return Offence{"VELLUM-VUID-VkMicromapUsageKHR-format-parameter",
                           where + "format " + std::to_string(usage.format) + " is neither 2-state nor 4-state"};
        if (lossy(info) && usage.format != VK_OPACITY_MICROMAP_FORMAT_4_STATE_KHR)
            return Offence{"VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-format-11712",
                           where + "the format of a lossy micromap is not 4-state"};
        if (usage.subdivisionLevel > kMaxSubdivisionLevel)
            return Offence{lossy(info)
                               ? "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11565"
                           : usage.format == VK_OPACITY_MICROMAP_FORMAT_4_STATE_KHR
                               ? "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11564"
                               : "VELLUM-VUID-VkAccelerationStructureGeometryMicromapDataKHR-subdivisionLevel-11645",
                           where + "subdivision level " + std::to_string(usage.subdivisionLevel) + " is above 12"};
        triangles += usage.count;
    }
    if (triangles > kMaxMicromapTriangles)
        return Offence{"VELLUM-VUID-VkAccelerationStructureGeometryMicromapDataKHR-count-11643",
                       "the usage counts add up to " + std::to_string(triangles) +
                           " triangles, more than maxMicromapTriangles"};
    return std::nullopt;
}

// What sizes depend on.
std::optional<Offence> shapeOffenceOf(const DeviceMicromaps &device, const BuildInfo &info)
{
    if (!device.driver.asked.khrFeature)
        return Offence{"VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-micromap-11559",
                       "the feature VkPhysicalDeviceOpacityMicromapFeaturesKHR::micromap is not enabled"};
    if (info.geometryCount != 1)
        return Offence{"VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryCount-11560",
                       "a micromap has one geometry, not " + std::to_string(info.geometryCount)};
    const auto *geometry = geometryOf(info);
    if (!geometry || (info.pGeometries && info.ppGeometries))
        return Offence{"VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-pGeometries-03788",
                       "not exactly one of pGeometries and ppGeometries is given"};
    if (geometry->geometryType != VK_GEOMETRY_TYPE_MICROMAP_KHR)
        return Offence{"VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-geometryType-11561",
                       "the geometry of a micromap is not of type VK_GEOMETRY_TYPE_MICROMAP_KHR"};
    const MicromapData *data = dataOf(info);
    if (!data)
        return Offence{"VELLUM-VUID-VkAccelerationStructureGeometryKHR-micromap-11568",
                       "the geometry has no VkAccelerationStructureGeometryMicromapDataKHR"};
    if (info.flags & ~kMicromapBuildFlags)
        return Offence{"VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11562",
                       "flags " + std::to_string(info.flags) + " holds some that are not for micromaps"};
    return usageOffenceOf(info, *data);
}

std::optional<Offence> structureOffenceOf(const DeviceMicromaps &device, const BuildInfo &info)
{
    if (auto offence = shapeOffenceOf(device, info))
        return offence;
    if (info.mode != VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR)
        return Offence{"VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-mode-11545", "a micromap cannot be updated"};
    const auto target = device.objects.accelerationStructures.get(info.dstAccelerationStructure);
    if (!target || (target->type != VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR &&
                    target->type != VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR))
        return Offence{"VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-11547",
                       "dstAccelerationStructure was created as neither OPACITY_MICROMAP nor GENERIC"};
    const MicromapData &data = *dataOf(info);
    const Translated build(info, data, micromapIn(*target));
    const MicromapExtent extent = extentOf(build.info);
    if (target->size < extent.bytes())
        return Offence{"VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10126",
                       "dstAccelerationStructure has " + std::to_string(target->size) + " bytes, the build needs " +
                           std::to_string(extent.bytes())};
    if (extent.triangles == 0)
        return std::nullopt;
    if (data.data == 0 || data.triangleArray == 0)
        return Offence{"VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11550",
                       "data or triangleArray is a null address"};
    if (data.data % 128 != 0 || data.triangleArray % 128 != 0)
        return Offence{"VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11552",
                       "data or triangleArray is not a multiple of 128"};
    const VkDeviceAddress scratch = info.scratchData.deviceAddress;
    if (scratch == 0 || scratch % kLeastScratchAlignment != 0)
        return Offence{scratch == 0 ? "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12261"
                                    : "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03710",
                       "scratchData is a null address or not aligned"};
    if (device.buffers.addresses.bytesFrom(scratch) < extent.scratchBytes())
        return Offence{"VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12258",
                       "scratchData has " + std::to_string(device.buffers.addresses.bytesFrom(scratch)) +
                           " bytes in its buffer, the build needs " + std::to_string(extent.scratchBytes())};
    if (data.triangleArrayStride < sizeof(VkMicromapTriangleKHR))
        return Offence{"VELLUM-VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11646",
                       "triangleArrayStride " + std::to_string(data.triangleArrayStride) + " is less than 8"};
    // What both front ends have in common.
    return buildOffenceOf(build.info);
}

// The least size of a micromap that is told to applications, so that a GENERIC structure made for it is known.
constexpr VkDeviceSize markedSize(VkDeviceSize bytes)
{
    return (bytes + 255 - kMicromapSizeMark) / 256 * 256 + kMicromapSizeMark;
}

void refuse(const DeviceMicromaps &device, const char *id, const std::string &text,
            VkAccelerationStructureKHR structure)
{
    device.driver.report().error(id, text, VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR,
                                 reinterpret_cast<uint64_t>(structure));
}

} // namespace

void getMicromapStructureSizes(const DeviceMicromaps &device, const BuildInfo &info,
                               VkAccelerationStructureBuildSizesInfoKHR &sizes)
{
    sizes.accelerationStructureSize = 0;
    sizes.updateScratchSize = 0;
    sizes.buildScratchSize = 0;
    if (const auto offence = shapeOffenceOf(device, info)) {
        device.driver.report().error(offence->id, "vkGetAccelerationStructureBuildSizesKHR: " + offence->text);
        return;
    }
    const Translated build(info, *dataOf(info), VK_NULL_HANDLE);
    const MicromapExtent extent = extentOf(build.info);
    sizes.accelerationStructureSize = markedSize(extent.bytes());
    sizes.buildScratchSize = extent.scratchBytes();
}

void cmdBuildMicromapStructures(DeviceMicromaps &device, VkCommandBuffer commandBuffer, uint32_t count,
                                const BuildInfo *infos)
{
    std::vector<Translated> builds;
    for (uint32_t i = 0; i < count; ++i) {
        if (!isMicromapBuild(infos[i]))
            continue;
        if (const auto offence = structureOffenceOf(device, infos[i])) {
            refuse(device, offence->id,
                   "vkCmdBuildAccelerationStructuresKHR: pInfos[" + std::to_string(i) + "]: " + offence->text,
                   infos[i].dstAccelerationStructure);
            continue;
        }
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
    if (!source || !target || !canHoldMicromap(*source) || !canHoldMicromap(*target)) {
        refuse(device, "VELLUM-copy-type", "vkCmdCopyAccelerationStructureKHR: one of src and dst is no micromap",
               info.dst);
        return true;
    }
    if (info.mode != VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR &&
        info.mode != VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR) {
        refuse(device, "VELLUM-VUID-VkCopyAccelerationStructureInfoKHR-mode-03410",
               "vkCmdCopyAccelerationStructureKHR: mode is neither clone nor compact", info.dst);
        return true;
    }
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
    if (info.mode != VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR)
        refuse(device, "VELLUM-VUID-VkCopyAccelerationStructureToMemoryInfoKHR-mode-03412",
               "vkCmdCopyAccelerationStructureToMemoryKHR: mode is not SERIALIZE", info.src);
    else if (info.dst.deviceAddress == 0 || info.dst.deviceAddress % 128 != 0)
        refuse(device,
               info.dst.deviceAddress == 0 ? "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-03739"
                                           : "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11699",
               "vkCmdCopyAccelerationStructureToMemoryKHR: dst is a null address or not aligned to 128 bytes",
               info.src);
    else
        recordMicromapSave(device, commandBuffer, source->micromap, info.dst.deviceAddress);
    return true;
}

bool restoresMicromapStructure(DeviceMicromaps &device, VkCommandBuffer commandBuffer,
                               const VkCopyMemoryToAccelerationStructureInfoKHR &info)
{
    const auto target = device.objects.accelerationStructures.get(info.dst);
    if (!target)
        return false;
    // A GENERIC one is told by its size: sizes of micromaps are marked, as those of top-level structures are.
    const bool generic = target->type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    if (target->type != VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR &&
        (!generic || !device.driver.asked.khr || target->size % 256 != kMicromapSizeMark))
        return false;
    if (info.mode != VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR) {
        refuse(device, "VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-mode-03413",
               "vkCmdCopyMemoryToAccelerationStructureKHR: mode is not DESERIALIZE", info.dst);
    } else if (info.src.deviceAddress == 0 || info.src.deviceAddress % 128 != 0) {
        refuse(device,
               info.src.deviceAddress == 0 ? "VELLUM-VUID-vkCmdCopyMemoryToAccelerationStructureKHR-pInfo-03742"
                                           : "VELLUM-VUID-vkCmdCopyAccelerationStructureToMemoryKHR-pInfo-11700",
               "vkCmdCopyMemoryToAccelerationStructureKHR: src is a null address or not aligned to 128 bytes",
               info.dst);
    } else {
        becomeMicromap(device.objects, *target);
        recordMicromapRestore(device, commandBuffer, target->micromap, info.src.deviceAddress);
    }
    return true;
}

} // namespace vellum::layer
