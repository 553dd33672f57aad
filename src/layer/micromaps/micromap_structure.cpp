#include "layer/micromaps/micromap_structure.h"

#include <new>
#include <string>
#include <vector>

#include "core/curve.h"
#include "core/records.h"
#include "layer/micromaps/device_micromaps.h"
#include "layer/micromaps/micromap.h"
#include "layer/micromaps/micromap_extent.h"
#include "layer/micromaps/micromap_input.h"

namespace vellum::layer
{
namespace
{

using namespace shared;
using BuildInfo = VkAccelerationStructureBuildGeometryInfoKHR;
using MicromapData = VkAccelerationStructureGeometryMicromapDataKHR;
using Translated = TranslatedMicromapBuild;

constexpr MicromapLimits kLimits{kMaxSubdivisionLevel, kMaxSubdivisionLevel, kMaxSubdivisionLevel, true};

// What sizes depend on.
bool mayMeasureStructure(const DeviceMicromaps &device, const Judge &judge, const BuildInfo &info)
{
    return mayMeasureMicromap(device.driver, judge, info, kLimits) &&
           mayBeSoLarge(judge, extentOf(Translated(info, *micromapDataOf(info), {}).info));
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
    const MicromapData &data = *micromapDataOf(info);
    const MicromapExtent extent = extentOf(Translated(info, data, micromapIn(*target)).info);
    if (target->size < extent.bytes())
        return judge.refuse("VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10126",
                            "dstAccelerationStructure has " + std::to_string(target->size) +
                                " bytes, the build needs " + std::to_string(extent.bytes()));
    if (extent.triangles == 0)
        return true;
    if (!mayReadInput(device.buffers.addresses, judge, info, extent.scratchBytes()))
        return false;
    return mayHaveStride(judge, data.triangleArrayStride, extent,
                         "VELLUM-VUID-VkAccelerationStructureGeometryMicromapDataKHR-triangleArrayStride-11646");
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
    const Translated build(info, *micromapDataOf(info), VK_NULL_HANDLE);
    const MicromapExtent extent = extentOf(build.info);
    sizes.accelerationStructureSize = markedMicromapSize(extent.bytes());
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
        builds.emplace_back(infos[i], *micromapDataOf(infos[i]), micromapIn(*target));
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
