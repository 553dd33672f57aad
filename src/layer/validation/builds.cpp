// SPDX-License-Identifier: Apache-2.0
// Builds of micromaps and acceleration structures, on the device and on the host, and queries of their sizes.
#include "layer/rules/builds.h"

#include "layer/input/checked.h"
#include "layer/validation/commands.h"
#include "layer/validation/rules/build_rules.h"
#include "layer/validation/rules/rule_check.h"

namespace vellum::layer
{
namespace
{

std::shared_ptr<const StructureContents> contentsOf(const input::MicromapBuild &build)
{
    auto contents = std::make_shared<StructureContents>();
    contents->type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
    contents->flags = build.flags;
    contents->usages = build.usages.merged();
    contents->triangles = build.usages.triangles();
    contents->discardable = build.needs.discardable;
    return contents;
}

std::shared_ptr<StructureContents> contentsOf(const DeviceModel &device, const input::StructureBuild &build)
{
    auto contents = std::make_shared<StructureContents>();
    contents->type = build.given->type;
    contents->flags = build.given->flags;
    for (uint32_t g = 0; g < build.geometries.size(); ++g) {
        const input::Geometry &geometry = build.geometries[g];
        if (!geometry.given)
            break;
        GeometryContents &part = contents->geometries.emplace_back();
        part.type = geometry.given->geometryType;
        part.flags = geometry.given->flags;
        if (build.ranges.direct)
            part.primitives = build.ranges.primitives(g);
        if (const auto &attachment = geometry.attachment) {
            part.hasMicromap = true;
            part.khr = attachment->khr;
            part.micromapHandle = attachment->micromap;
            part.usages = attachment->usages.merged();
            if (const auto micromap = device.objects.structureOf(attachment->micromap)) {
                part.micromap = micromap;
                part.micromapNumber = micromap->number;
            }
        }
    }
    return contents;
}

// Gives a structure its new contents when the command is executed.
void construct(DeviceValidation &device, VkCommandBuffer commandBuffer,
               const std::shared_ptr<ValidatedStructure> &target, std::shared_ptr<const StructureContents> contents)
{
    if (target)
        device.logs.add(commandBuffer, [&device, target, contents](const Submission &submission) {
            contents->submitted();
            setContents(device, target, submission.ordered ? contents : unknownContents(contents->type));
            for (const GeometryContents &geometry : contents->geometries)
                if (const auto micromap = geometry.micromap.lock())
                    setAttached(*micromap, submission.ordered);
        });
}

// The effect of a build of a micromap; `commandBuffer`: null for one on the host.
void micromapBuilt(DeviceValidation &device, VkCommandBuffer commandBuffer, const input::MicromapBuild &build)
{
    construct(device, commandBuffer, device.objects.structureOf(build.target), contentsOf(build));
}

// Records the checks on the device and the effects of a command that builds.
void recordBuilds(DeviceValidation &device, VkCommandBuffer commandBuffer, const input::Builds &builds)
{
    GpuBuildChecks checks(device.gpu, commandBuffer, builds.command);
    std::vector<std::shared_ptr<const StructureContents>> built;
    for (const input::MicromapBuild &build : builds.micromaps) {
        if (build.khr && !build.hasData)
            continue;
        checks.add(build);
        micromapBuilt(device, commandBuffer, build);
    }
    for (const input::StructureBuild &build : builds.structures) {
        checks.add(build);
        const auto contents = contentsOf(device, build);
        captureContents(device, commandBuffer, build, *contents);
        const auto target = device.objects.structureOf(build.given->dstAccelerationStructure);
        findReference(device, target);
        construct(device, commandBuffer, target, contents);
        built.push_back(contents);
    }
    checks.record();
    sync::recordBuilds(device.sync, commandBuffer, builds);
    for (size_t i = 0; i < built.size(); ++i)
        sync::recordReferences(device.sync, commandBuffer, builds, builds.structures[i], built[i]);
}

// The micromaps that structures are built with.
std::vector<std::shared_ptr<ValidatedStructure>> micromapsOf(const DeviceModel &device, const input::Builds &builds)
{
    std::vector<std::shared_ptr<ValidatedStructure>> micromaps;
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

void getMicromapBuildSizes(DeviceValidation &device, VkDevice handle, VkAccelerationStructureBuildTypeKHR type,
                           const VkMicromapBuildInfoEXT *info, VkMicromapBuildSizesInfoEXT *sizes)
{
    const Place command("vkGetMicromapBuildSizesEXT");
    checkFeature(device.at(command), "VUID-vkGetMicromapBuildSizesEXT-micromap-11618");
    if (device.checks.core) {
        const Place place = command.member("pSizeInfo");
        checkStructure(device.at(place), *sizes,
                       {VK_STRUCTURE_TYPE_MICROMAP_BUILD_SIZES_INFO_EXT, "VUID-VkMicromapBuildSizesInfoEXT-sType-sType",
                        "VUID-VkMicromapBuildSizesInfoEXT-pNext-pNext"});
    }
    input::Builds query = input::parse(1, info, type == VK_ACCELERATION_STRUCTURE_BUILD_TYPE_HOST_KHR);
    rules::checkSizes(device.rules, command, query);
    const input::Checked checked(info, query);
    device.next.GetMicromapBuildSizesEXT(handle, type, info, sizes);
}

void getAccelerationStructureBuildSizes(DeviceValidation &device, VkDevice handle,
                                        VkAccelerationStructureBuildTypeKHR type,
                                        const VkAccelerationStructureBuildGeometryInfoKHR *info, const uint32_t *most,
                                        VkAccelerationStructureBuildSizesInfoKHR *sizes)
{
    const Place command("vkGetAccelerationStructureBuildSizesKHR");
    input::Builds query = input::parse(1, info, nullptr);
    rules::checkSizeParameters(device.rules, command, query, type, most != nullptr);
    rules::checkSizes(device.rules, command, query);
    const input::Checked checked(info, query);
    device.next.GetAccelerationStructureBuildSizesKHR(handle, type, info, most, sizes);
}

void cmdBuildMicromaps(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                       const VkMicromapBuildInfoEXT *infos)
{
    input::Builds builds = input::parse(count, infos);
    checkBuilds(device, commandBuffer, builds);
    recordBuilds(device, commandBuffer, builds);
    const input::Checked checked(infos, builds);
    device.next.CmdBuildMicromapsEXT(commandBuffer, count, infos);
}

void cmdBuildAccelerationStructures(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                                    const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                    const VkAccelerationStructureBuildRangeInfoKHR *const *ranges)
{
    input::Builds builds = input::parse(count, infos, ranges);
    checkBuilds(device, commandBuffer, builds);
    recordBuilds(device, commandBuffer, builds);
    const input::Checked checked(infos, builds);
    device.next.CmdBuildAccelerationStructuresKHR(commandBuffer, count, infos, ranges);
}

void cmdBuildAccelerationStructuresIndirect(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                                            const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                            const VkDeviceAddress *addresses, const uint32_t *strides,
                                            const uint32_t *const *most)
{
    input::Builds builds = input::parseIndirect(count, infos, addresses, strides, most);
    checkBuilds(device, commandBuffer, builds);
    recordBuilds(device, commandBuffer, builds);
    const input::Checked checked(infos, builds);
    device.next.CmdBuildAccelerationStructuresIndirectKHR(commandBuffer, count, infos, addresses, strides, most);
}

// The content of the structures is unknown afterwards.
VkResult buildAccelerationStructures(DeviceValidation &device, VkDevice handle, VkDeferredOperationKHR operation,
                                     uint32_t count, const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                                     const VkAccelerationStructureBuildRangeInfoKHR *const *ranges)
{
    input::Builds builds = input::parse(count, infos, ranges);
    noteChecked(device, builds);
    rules::checkHostBuilds(device.rules, Place("vkBuildAccelerationStructuresKHR"), builds);
    const std::vector<std::shared_ptr<ValidatedStructure>> attached = micromapsOf(device, builds);
    const input::Checked checked(infos, builds);
    const VkResult result = device.next.BuildAccelerationStructuresKHR(handle, operation, count, infos, ranges);
    for (uint32_t i = 0; i < count && isCarriedOut(result); ++i) {
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
    if (isCarriedOut(result) && !attached.empty())
        remember(device.objects, [&] {
            device.logs.add(VK_NULL_HANDLE, [&](const Submission &) {
                for (const auto &micromap : attached)
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
    for (size_t i = 0; isCarriedOut(result) && i < kept.micromaps.size(); ++i)
        remember(device.objects, [&] { micromapBuilt(device, VK_NULL_HANDLE, kept.micromaps[i]); });
    return result;
}

} // namespace validation
} // namespace vellum::layer
