// SPDX-License-Identifier: Apache-2.0
#include "layer/input/builds.h"

#include <algorithm>
#include <utility>

#include "layer/base/pnext.h"

namespace vellum::layer::input
{
namespace
{

using BuildInfo = VkAccelerationStructureBuildGeometryInfoKHR;

const VkAccelerationStructureGeometryKHR *geometryOf(const BuildInfo &info, uint32_t g)
{
    if (info.pGeometries)
        return &info.pGeometries[g];
    return info.ppGeometries ? info.ppGeometries[g] : nullptr;
}

template <typename Given>
Attachment attachmentOf(const Given &given)
{
    Attachment attachment;
    attachment.indexType = given.indexType;
    attachment.indexStride = given.indexStride;
    attachment.baseTriangle = given.baseTriangle;
    if (given.micromap)
        attachment.micromap = given.micromap;
    return attachment;
}

std::optional<Attachment> parseAttachment(const void *chain)
{
    if (const auto *khr = findInChain<VkAccelerationStructureTrianglesOpacityMicromapKHR>(
            chain, VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR)) {
        Attachment attachment = attachmentOf(*khr);
        attachment.khr = true;
        attachment.indexBuffer.deviceAddress = khr->indexBuffer;
        return attachment;
    }
    if (const auto *ext = findInChain<VkAccelerationStructureTrianglesOpacityMicromapEXT>(
            chain, VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT)) {
        Attachment attachment = attachmentOf(*ext);
        attachment.indexBuffer = ext->indexBuffer;
        attachment.usages = {ext->usageCountsCount, ext->pUsageCounts, ext->ppUsageCounts};
        return attachment;
    }
    return std::nullopt;
}

MicromapBuild parseMicromap(const BuildInfo &info)
{
    MicromapBuild build;
    build.khr = true;
    build.given = &info;
    build.target = info.dstAccelerationStructure;
    build.flags = info.flags;
    build.isBuild = info.mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR;
    build.scratch = info.scratchData;
    build.hasSource = info.srcAccelerationStructure != VK_NULL_HANDLE;
    build.geometries = info.geometryCount;
    build.twoArrays = info.pGeometries && info.ppGeometries;
    build.geometry = info.geometryCount > 0 ? geometryOf(info, 0) : nullptr;
    const auto *data =
        build.geometry ? findInChain<VkAccelerationStructureGeometryMicromapDataKHR>(
                             build.geometry->pNext, VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_MICROMAP_DATA_KHR)
                       : nullptr;
    if (!data)
        return build;
    build.hasData = true;
    build.usages = {data->usageCountsCount, data->pUsageCounts, data->ppUsageCounts};
    build.data.deviceAddress = data->data;
    build.triangles.deviceAddress = data->triangleArray;
    build.triangleStride = data->triangleArrayStride;
    return build;
}

MicromapBuild parseMicromap(const VkMicromapBuildInfoEXT &info)
{
    MicromapBuild build;
    build.given = &info;
    build.target = info.dstMicromap;
    build.flags = info.flags;
    build.isBuild = info.mode == VK_BUILD_MICROMAP_MODE_BUILD_EXT;
    build.usages = {info.usageCountsCount, info.pUsageCounts, info.ppUsageCounts};
    build.data = info.data;
    build.triangles = info.triangleArray;
    build.triangleStride = info.triangleArrayStride;
    build.scratch = info.scratchData;
    build.type = info.type;
    build.sType = info.sType;
    build.hasChain = info.pNext != nullptr;
    return build;
}

StructureBuild parseStructure(const BuildInfo &info)
{
    StructureBuild build;
    build.given = &info;
    build.geometries.resize(info.geometryCount);
    for (uint32_t g = 0; g < info.geometryCount; ++g) {
        Geometry &geometry = build.geometries[g];
        geometry.given = geometryOf(info, g);
        if (geometry.isTriangles())
            geometry.attachment = parseAttachment(geometry.given->geometry.triangles.pNext);
    }
    return build;
}

// Adds the data of a geometry, of which the build reads something; `certain`: it does so for certain.
void addData(std::vector<Access> &accesses, const VkAccelerationStructureGeometryKHR &given, uint32_t g, bool certain)
{
    const auto add = [&](Access::Of of, VkDeviceAddress address) {
        accesses.push_back({of, address, 0, certain ? VkDeviceSize{1} : 0, g});
    };
    if (given.geometryType == VK_GEOMETRY_TYPE_TRIANGLES_KHR) {
        const auto &triangles = given.geometry.triangles;
        add(Access::Of::Vertices, triangles.vertexData.deviceAddress);
        if (triangles.indexType != VK_INDEX_TYPE_NONE_KHR)
            add(Access::Of::Indices, triangles.indexData.deviceAddress);
        if (triangles.transformData.deviceAddress != 0)
            add(Access::Of::Transform, triangles.transformData.deviceAddress);
    } else if (given.geometryType == VK_GEOMETRY_TYPE_AABBS_KHR) {
        add(Access::Of::Boxes, given.geometry.aabbs.data.deviceAddress);
    }
}

// `ranges(i)`: the ranges of element i.
template <typename Ranges>
Builds parseBuilds(uint32_t count, const BuildInfo *infos, BuildCommand command, Ranges ranges)
{
    Builds builds{.command = command, .micromaps = {}, .structures = {}};
    for (uint32_t i = 0; i < count; ++i) {
        if (infos[i].type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR) {
            MicromapBuild &build = builds.micromaps.emplace_back(parseMicromap(infos[i]));
            build.element = i;
            build.indirect = command == BuildCommand::IndirectStructures;
            build.hasRanges = ranges(i).given();
        } else {
            StructureBuild &build = builds.structures.emplace_back(parseStructure(infos[i]));
            build.element = i;
            build.ranges = ranges(i);
        }
    }
    return builds;
}

} // namespace

static_assert(sizeof(VkMicromapUsageKHR) == sizeof(VkMicromapUsageEXT));

UsageCounts::UsageCounts(uint32_t count, const VkMicromapUsageKHR *counts, const VkMicromapUsageKHR *const *pointers)
    : UsageCounts(count, reinterpret_cast<const VkMicromapUsageEXT *>(counts),
                  reinterpret_cast<const VkMicromapUsageEXT *const *>(pointers))
{
}

uint64_t UsageCounts::triangles() const
{
    uint64_t count = 0;
    for (uint32_t i = 0; i < size(); ++i)
        count += (*this)[i].count;
    return count;
}

std::vector<VkMicromapUsageEXT> UsageCounts::merged() const
{
    const auto kindOf = [](const VkMicromapUsageEXT &usage) { return std::pair(usage.subdivisionLevel, usage.format); };
    std::vector<VkMicromapUsageEXT> usages;
    usages.reserve(size());
    for (uint32_t i = 0; i < size(); ++i)
        usages.push_back((*this)[i]);
    std::ranges::sort(usages, {}, kindOf);
    size_t kept = 0;
    for (size_t i = 0; i < usages.size(); ++i) {
        if (kept > 0 && kindOf(usages[kept - 1]) == kindOf(usages[i]) &&
            usages[i].count <= UINT32_MAX - usages[kept - 1].count)
            usages[kept - 1].count += usages[i].count;
        else
            usages[kept++] = usages[i];
    }
    usages.resize(kept);
    return usages;
}

bool StructureBuild::isTopLevel() const
{
    return std::ranges::any_of(geometries, &Geometry::isInstances);
}

Builds parse(uint32_t count, const VkMicromapBuildInfoEXT *infos, bool host)
{
    Builds builds{
        .command = host ? BuildCommand::HostMicromaps : BuildCommand::Micromaps, .micromaps = {}, .structures = {}};
    for (uint32_t i = 0; i < count; ++i) {
        MicromapBuild &build = builds.micromaps.emplace_back(parseMicromap(infos[i]));
        build.element = i;
        build.host = host;
    }
    return builds;
}

Builds parse(uint32_t count, const BuildInfo *infos, const VkAccelerationStructureBuildRangeInfoKHR *const *ranges)
{
    return parseBuilds(count, infos, BuildCommand::Structures,
                       [&](uint32_t i) { return BuildRanges{.direct = ranges ? ranges[i] : nullptr}; });
}

Builds parseIndirect(uint32_t count, const BuildInfo *infos, const VkDeviceAddress *addresses, const uint32_t *strides,
                     const uint32_t *const *most)
{
    return parseBuilds(count, infos, BuildCommand::IndirectStructures, [&](uint32_t i) {
        return BuildRanges{nullptr, addresses ? addresses[i] : 0, strides ? strides[i] : 0, most ? most[i] : nullptr};
    });
}

const char *nameOf(BuildCommand command)
{
    switch (command) {
    case BuildCommand::Micromaps: return "vkCmdBuildMicromapsEXT";
    case BuildCommand::HostMicromaps: return "vkBuildMicromapsEXT";
    case BuildCommand::Structures: return "vkCmdBuildAccelerationStructuresKHR";
    case BuildCommand::IndirectStructures: break;
    }
    return "vkCmdBuildAccelerationStructuresIndirectKHR";
}

std::vector<Access> accessesOf(const MicromapBuild &build)
{
    const uint64_t triangles = build.usages.triangles();
    if (build.host || triangles == 0)
        return {};
    const VkDeviceSize array = (triangles - 1) * build.triangleStride + sizeof(VkMicromapTriangleEXT);
    // Offset 0 of the data is used.
    std::vector<Access> accesses{{Access::Of::Data, build.data.deviceAddress, 0, 1, Access::kNone},
                                 {Access::Of::TriangleArray, build.triangles.deviceAddress, 0, array, Access::kNone}};
    if (build.needs.scratch > 0)
        accesses.push_back({Access::Of::Scratch, build.scratch.deviceAddress, 0, build.needs.scratch, Access::kNone});
    return accesses;
}

std::vector<Access> accessesOf(const StructureBuild &build)
{
    std::vector<Access> accesses;
    for (uint32_t g = 0; g < build.geometries.size(); ++g) {
        const Geometry &geometry = build.geometries[g];
        const VkDeviceSize count = build.ranges.primitives(g);
        if (!geometry.given || count == 0)
            continue;
        const auto *range = build.ranges.direct ? &build.ranges.direct[g] : nullptr;
        addData(accesses, *geometry.given, g, range != nullptr);
        if (geometry.isInstances()) {
            const auto &instances = geometry.given->geometry.instances;
            accesses.push_back({Access::Of::Instances, instances.data.deviceAddress, range ? range->primitiveOffset : 0,
                                range ? count * instanceStride(instances) : 0, g});
        }
        if (geometry.attachment && geometry.attachment->indexType != VK_INDEX_TYPE_NONE_KHR) {
            const Attachment &attachment = *geometry.attachment;
            const VkDeviceSize index = indexBytes(attachment.indexType);
            accesses.push_back({Access::Of::MicromapIndices, attachment.indexBuffer.deviceAddress, 0,
                                range && index != 0 ? (count - 1) * attachment.indexStride + index : 0, g});
        }
    }
    return accesses;
}

} // namespace vellum::layer::input
