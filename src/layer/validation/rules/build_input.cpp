// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/rules/build_input.h"

#include "layer/base/pnext.h"

namespace vellum::layer
{
namespace
{

template <typename Counts>
std::vector<VkMicromapUsageEXT> usagesOf(uint32_t count, const Counts *counts, const Counts *const *pointers)
{
    std::vector<VkMicromapUsageEXT> usages;
    for (uint32_t i = 0; i < count && (counts || pointers); ++i)
        if (const Counts *usage = counts ? &counts[i] : pointers[i])
            usages.push_back({usage->count, usage->subdivisionLevel, static_cast<uint32_t>(usage->format)});
    return usages;
}

uint32_t arraysOf(uint32_t count, const void *counts, const void *pointers)
{
    return count == 0 ? 1 : uint32_t{counts != nullptr} + uint32_t{pointers != nullptr};
}

} // namespace

uint64_t MicromapBuildInput::triangleCount() const
{
    uint64_t count = 0;
    for (const VkMicromapUsageEXT &usage : usages)
        count += usage.count;
    return count;
}

MicromapBuildInput micromapBuildOf(const DeviceModel &device, const VkMicromapBuildInfoEXT &info)
{
    MicromapBuildInput build;
    build.target = device.objects.micromaps.get(info.dstMicromap);
    build.flags = info.flags;
    build.usages = usagesOf(info.usageCountsCount, info.pUsageCounts, info.ppUsageCounts);
    build.usageArrays = arraysOf(info.usageCountsCount, info.pUsageCounts, info.ppUsageCounts);
    build.data = info.data;
    build.triangles = info.triangleArray;
    build.triangleStride = info.triangleArrayStride;
    build.scratch = info.scratchData;
    return build;
}

std::optional<MicromapBuildInput> micromapBuildOf(const DeviceModel &device,
                                                  const VkAccelerationStructureBuildGeometryInfoKHR &info)
{
    const VkAccelerationStructureGeometryKHR *geometry = info.geometryCount > 0 ? geometryOf(info, 0) : nullptr;
    const auto *data = geometry
                           ? findInChain<VkAccelerationStructureGeometryMicromapDataKHR>(
                                 geometry->pNext, VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_MICROMAP_DATA_KHR)
                           : nullptr;
    if (!data)
        return std::nullopt;
    MicromapBuildInput build;
    build.target = device.objects.structures.get(info.dstAccelerationStructure);
    build.flags = info.flags;
    build.khr = true;
    build.usages = usagesOf(data->usageCountsCount, data->pUsageCounts, data->ppUsageCounts);
    build.usageArrays = arraysOf(data->usageCountsCount, data->pUsageCounts, data->ppUsageCounts);
    build.data.deviceAddress = data->data;
    build.triangles.deviceAddress = data->triangleArray;
    build.triangleStride = data->triangleArrayStride;
    build.scratch = info.scratchData;
    return build;
}

std::optional<AttachmentInput> attachmentOf(const DeviceModel &device,
                                            const VkAccelerationStructureGeometryKHR &geometry)
{
    if (geometry.geometryType != VK_GEOMETRY_TYPE_TRIANGLES_KHR)
        return std::nullopt;
    AttachmentInput attachment;
    const auto fill = [&attachment](const auto &given) {
        attachment.indexType = given.indexType;
        attachment.indexStride = given.indexStride;
        attachment.baseTriangle = given.baseTriangle;
        if (given.micromap)
            attachment.handle = given.micromap;
    };
    const void *chain = geometry.geometry.triangles.pNext;
    if (const auto *khr = findInChain<VkAccelerationStructureTrianglesOpacityMicromapKHR>(
            chain, VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR)) {
        fill(*khr);
        attachment.khr = true;
        attachment.indexBuffer.deviceAddress = khr->indexBuffer;
        attachment.micromap = khr->micromap ? device.objects.structures.get(khr->micromap) : nullptr;
        return attachment;
    }
    if (const auto *ext = findInChain<VkAccelerationStructureTrianglesOpacityMicromapEXT>(
            chain, VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT)) {
        fill(*ext);
        attachment.indexBuffer = ext->indexBuffer;
        attachment.micromap = ext->micromap ? device.objects.micromaps.get(ext->micromap) : nullptr;
        attachment.usages = usagesOf(ext->usageCountsCount, ext->pUsageCounts, ext->ppUsageCounts);
        attachment.usageArrays = arraysOf(ext->usageCountsCount, ext->pUsageCounts, ext->ppUsageCounts);
        return attachment;
    }
    return std::nullopt;
}

const VkAccelerationStructureGeometryKHR *geometryOf(const VkAccelerationStructureBuildGeometryInfoKHR &info,
                                                     uint32_t g)
{
    if (info.pGeometries)
        return &info.pGeometries[g];
    return info.ppGeometries ? info.ppGeometries[g] : nullptr;
}

} // namespace vellum::layer
