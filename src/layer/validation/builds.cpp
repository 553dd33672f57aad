// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/builds.h"

#include "layer/validation/rules/build_rules.h"

namespace vellum::layer
{
namespace
{

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
    GpuBuildChecks checks(device.gpu, commandBuffer, SiteCommand::BuildMicromaps);
    for (uint32_t i = 0; i < count; ++i) {
        const MicromapBuildInput build = micromapBuildOf(device, infos[i]);
        checks.add(i, build);
        micromapBuilt(device, commandBuffer, build);
    }
    checks.record();
    sync::recordBuilds(device.sync, commandBuffer, count, infos);
    device.next.CmdBuildMicromapsEXT(commandBuffer, count, infos);
}

void cmdBuildAccelerationStructures(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                                    const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                    const VkAccelerationStructureBuildRangeInfoKHR *const *ranges)
{
    if (device.checks.core)
        checkStructureBuilds(device, commandBuffer, {infos, count}, ranges);
    GpuBuildChecks checks(device.gpu, commandBuffer, SiteCommand::BuildStructures);
    for (uint32_t i = 0; i < count; ++i) {
        addChecks(device, checks, i, infos[i], {.ranges = ranges ? ranges[i] : nullptr});
        construct(device, commandBuffer, infos[i], ranges ? ranges[i] : nullptr, nullptr);
    }
    checks.record();
    sync::recordBuilds(device.sync, commandBuffer, "vkCmdBuildAccelerationStructuresKHR", count, infos, ranges);
    device.next.CmdBuildAccelerationStructuresKHR(commandBuffer, count, infos, ranges);
}

void cmdBuildAccelerationStructuresIndirect(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                                            const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                            const VkDeviceAddress *addresses, const uint32_t *strides,
                                            const uint32_t *const *most)
{
    if (device.checks.core)
        checkIndirectStructureBuilds(device, commandBuffer, {infos, count});
    GpuBuildChecks checks(device.gpu, commandBuffer, SiteCommand::BuildStructuresIndirect);
    for (uint32_t i = 0; i < count; ++i) {
        const uint32_t *const counts = most ? most[i] : nullptr;
        addChecks(device, checks, i, infos[i],
                  {.address = addresses ? addresses[i] : 0, .stride = strides ? strides[i] : 0, .most = counts});
        construct(device, commandBuffer, infos[i], nullptr, counts);
    }
    checks.record();
    sync::recordBuilds(device.sync, commandBuffer, "vkCmdBuildAccelerationStructuresIndirectKHR", count, infos,
                       nullptr);
    sync::recordIndirectRanges(device.sync, commandBuffer, count, infos, addresses);
    device.next.CmdBuildAccelerationStructuresIndirectKHR(commandBuffer, count, infos, addresses, strides, most);
}

} // namespace validation
} // namespace vellum::layer
