// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/builds.h"

#include <algorithm>

#include "layer/base/pnext.h"
#include "layer/validation/device_validation.h"
#include "layer/validation/gpu/gpu_checks.h"
#include "layer/validation/rules/build_rules.h"
#include "layer/validation/sync/sync_accesses.h"

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

std::shared_ptr<const StructureContents> contentsOf(const MicromapBuildInput &build)
{
    auto contents = std::make_shared<StructureContents>();
    contents->type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
    contents->flags = build.flags;
    contents->usages = build.usages;
    contents->triangles = build.triangleCount();
    return contents;
}

// `primitives(g)`: of geometry g, or the most that an indirect build may have.
template <typename Primitives>
std::shared_ptr<StructureContents> contentsOf(const DeviceValidation &device,
                                              const VkAccelerationStructureBuildGeometryInfoKHR &info,
                                              Primitives primitives)
{
    auto contents = std::make_shared<StructureContents>();
    contents->type = info.type;
    contents->flags = info.flags;
    for (uint32_t g = 0; g < info.geometryCount; ++g) {
        const VkAccelerationStructureGeometryKHR *geometry = geometryOf(info, g);
        if (!geometry)
            break;
        GeometryContents &part = contents->geometries.emplace_back();
        part.type = geometry->geometryType;
        part.flags = geometry->flags;
        part.primitives = primitives(g);
        if (const auto attachment = attachmentOf(device, *geometry)) {
            part.hasMicromap = true;
            part.khr = attachment->khr;
            part.micromapHandle = attachment->handle;
            part.micromap = attachment->micromap;
        }
    }
    return contents;
}

// Adds the checks of one build on the device, before it.
void addChecks(const DeviceValidation &device, GpuBuildChecks &checks, uint32_t i,
               const VkAccelerationStructureBuildGeometryInfoKHR &info, const GeometryCounts &counts)
{
    if (!buildsMicromap(info))
        checks.add(i, info, counts);
    else if (const auto build = micromapBuildOf(device, info))
        checks.add(i, *build);
}

// Gives a structure its new contents when the command is executed.
void construct(DeviceValidation &device, VkCommandBuffer commandBuffer,
               const std::shared_ptr<ValidatedStructure> &target, std::shared_ptr<const StructureContents> contents)
{
    if (target)
        device.logs.add(commandBuffer, [&device, target, contents](const Submission &submission) {
            setContents(device, *target, submission.ordered ? contents : unknownContents(contents->type));
        });
}

void construct(DeviceValidation &device, VkCommandBuffer commandBuffer,
               const VkAccelerationStructureBuildGeometryInfoKHR &info,
               const VkAccelerationStructureBuildRangeInfoKHR *ranges, const uint32_t *most)
{
    if (buildsMicromap(info)) {
        if (const auto build = micromapBuildOf(device, info))
            construct(device, commandBuffer, build->target, contentsOf(*build));
        return;
    }
    const auto primitives = [&](uint32_t g) { return ranges ? ranges[g].primitiveCount : most ? most[g] : 0; };
    const auto contents = contentsOf(device, info, primitives);
    captureContents(device, commandBuffer, info, ranges, *contents);
    construct(device, commandBuffer, device.objects.structures.get(info.dstAccelerationStructure), contents);
}

} // namespace

uint64_t MicromapBuildInput::triangleCount() const
{
    uint64_t count = 0;
    for (const VkMicromapUsageEXT &usage : usages)
        count += usage.count;
    return count;
}

MicromapBuildInput micromapBuildOf(const DeviceValidation &device, const VkMicromapBuildInfoEXT &info)
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

std::optional<MicromapBuildInput> micromapBuildOf(const DeviceValidation &device,
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

std::optional<AttachmentInput> attachmentOf(const DeviceValidation &device,
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

void micromapBuilt(DeviceValidation &device, VkCommandBuffer commandBuffer, const MicromapBuildInput &build)
{
    construct(device, commandBuffer, build.target, contentsOf(build));
}

namespace validation
{

void getMicromapBuildSizes(DeviceValidation &device, VkDevice handle, VkAccelerationStructureBuildTypeKHR type,
                           const VkMicromapBuildInfoEXT *info, VkMicromapBuildSizesInfoEXT *sizes)
{
    if (device.checks.core)
        checkMicromapSizeQuery(device, *info);
    device.next.GetMicromapBuildSizesEXT(handle, type, info, sizes);
    device.sync.scratch.reported(type, *sizes);
}

void getAccelerationStructureBuildSizes(DeviceValidation &device, VkDevice handle,
                                        VkAccelerationStructureBuildTypeKHR type,
                                        const VkAccelerationStructureBuildGeometryInfoKHR *info, const uint32_t *most,
                                        VkAccelerationStructureBuildSizesInfoKHR *sizes)
{
    if (device.checks.core)
        checkStructureSizeQuery(device, type, *info, most);
    device.next.GetAccelerationStructureBuildSizesKHR(handle, type, info, most, sizes);
    device.sync.scratch.reported(type, info->type, *sizes);
}

void cmdBuildMicromaps(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                       const VkMicromapBuildInfoEXT *infos)
{
    if (device.checks.core)
        checkMicromapBuilds(device, commandBuffer, count, infos);
    GpuBuildChecks checks(device, commandBuffer, SiteCommand::BuildMicromaps);
    for (uint32_t i = 0; i < count; ++i) {
        const MicromapBuildInput build = micromapBuildOf(device, infos[i]);
        checks.add(i, build);
        micromapBuilt(device, commandBuffer, build);
    }
    checks.record();
    sync::recordBuilds(device, commandBuffer, count, infos);
    device.next.CmdBuildMicromapsEXT(commandBuffer, count, infos);
}

void cmdBuildAccelerationStructures(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                                    const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                    const VkAccelerationStructureBuildRangeInfoKHR *const *ranges)
{
    if (device.checks.core)
        checkStructureBuilds(device, commandBuffer, {infos, count}, ranges);
    GpuBuildChecks checks(device, commandBuffer, SiteCommand::BuildStructures);
    for (uint32_t i = 0; i < count; ++i) {
        addChecks(device, checks, i, infos[i], {.ranges = ranges ? ranges[i] : nullptr});
        construct(device, commandBuffer, infos[i], ranges ? ranges[i] : nullptr, nullptr);
    }
    checks.record();
    sync::recordBuilds(device, commandBuffer, "vkCmdBuildAccelerationStructuresKHR", count, infos, ranges);
    device.next.CmdBuildAccelerationStructuresKHR(commandBuffer, count, infos, ranges);
}

void cmdBuildAccelerationStructuresIndirect(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                                            const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                            const VkDeviceAddress *addresses, const uint32_t *strides,
                                            const uint32_t *const *most)
{
    if (device.checks.core)
        checkIndirectStructureBuilds(device, commandBuffer, {infos, count});
    GpuBuildChecks checks(device, commandBuffer, SiteCommand::BuildStructuresIndirect);
    for (uint32_t i = 0; i < count; ++i) {
        const uint32_t *const counts = most ? most[i] : nullptr;
        addChecks(device, checks, i, infos[i],
                  {.address = addresses ? addresses[i] : 0, .stride = strides ? strides[i] : 0, .most = counts});
        construct(device, commandBuffer, infos[i], nullptr, counts);
    }
    checks.record();
    sync::recordBuilds(device, commandBuffer, "vkCmdBuildAccelerationStructuresIndirectKHR", count, infos, nullptr);
    sync::recordIndirectRanges(device, commandBuffer, count, infos, addresses);
    device.next.CmdBuildAccelerationStructuresIndirectKHR(commandBuffer, count, infos, addresses, strides, most);
}

} // namespace validation
} // namespace vellum::layer
