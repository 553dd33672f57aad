// SPDX-License-Identifier: Apache-2.0
// Wrong host commands of acceleration structures. No implementation at hand executes them with micromaps: all report
// that they are not available.
#include "recorded.h"

namespace vt
{
namespace
{

// The micromap attachment of a build's geometry, for the extension of the device.
struct Attachments {
    VkAccelerationStructureTrianglesOpacityMicromapEXT ext =
        vkInit<VkAccelerationStructureTrianglesOpacityMicromapEXT>({.indexType = VK_INDEX_TYPE_NONE_KHR});
    VkAccelerationStructureTrianglesOpacityMicromapKHR khr =
        vkInit<VkAccelerationStructureTrianglesOpacityMicromapKHR>({.indexType = VK_INDEX_TYPE_NONE_KHR});
    MicromapHandle micromap; // already built
    std::array<uint32_t, 1> indices{};
};

template <auto attach>
void build(Gpu &gpu, bool wrong)
{
    Micromap micromap(gpu, oneTriangle());
    micromap.build();
    const Blas target(gpu, {Geometry{.vertices = triangleRow(1)}});
    const std::array<float, 9> vertices{0, 0, 0, 1, 0, 0, 0, 1, 0};
    Attachments attachments{.micromap = micromap.handle()};
    attach(attachments, wrong);
    auto geometry = vkInit<VkAccelerationStructureGeometryKHR>({.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR});
    auto &triangles = geometry.geometry.triangles;
    triangles = vkInit<VkAccelerationStructureGeometryTrianglesDataKHR>(
        {.pNext = gpu.khr() ? static_cast<const void *>(&attachments.khr) : &attachments.ext,
         .vertexFormat = VK_FORMAT_R32G32B32_SFLOAT,
         .vertexStride = 12,
         .maxVertex = 2,
         .indexType = VK_INDEX_TYPE_NONE_KHR});
    triangles.vertexData.hostAddress = vertices.data();
    std::array<uint8_t, 4096> scratch{};
    auto info =
        vkInit<VkAccelerationStructureBuildGeometryInfoKHR>({.type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR,
                                                             .mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
                                                             .dstAccelerationStructure = target.handle(),
                                                             .geometryCount = 1,
                                                             .pGeometries = &geometry});
    info.scratchData.hostAddress = scratch.data();
    const VkAccelerationStructureBuildRangeInfoKHR range{.primitiveCount = 1};
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = &range;
    const auto command = reinterpret_cast<PFN_vkBuildAccelerationStructuresKHR>(
        vkGetDeviceProcAddr(gpu.device(), "vkBuildAccelerationStructuresKHR"));
    command(gpu.device(), VK_NULL_HANDLE, 1, &info, &ranges);
}

void indicesOfNoType(Attachments &attachments, bool wrong)
{
    attachments.ext.indexBuffer.hostAddress = wrong ? attachments.indices.data() : nullptr;
}

void noIndices(Attachments &attachments, bool wrong)
{
    attachments.ext.indexType = VK_INDEX_TYPE_UINT32;
    attachments.ext.indexStride = 4;
    attachments.ext.indexBuffer.hostAddress = wrong ? nullptr : attachments.indices.data();
}

void attachesMicromap(Attachments &attachments, bool wrong)
{
    attachments.khr.micromap = wrong ? attachments.micromap.khr : VK_NULL_HANDLE;
}

constexpr VkMicromapUsageEXT kOne{1, 2, kFourState}, kOneOfNoFormat{1, 2, 7};

// One triangle, with the micromap or with a special index.
void noCounts(Attachments &attachments, bool wrong)
{
    attachments.ext.micromap = attachments.micromap.ext;
    attachments.ext.usageCountsCount = wrong ? 0 : 1;
    attachments.ext.pUsageCounts = &kOne;
}

void countsSpecial(Attachments &attachments, bool wrong)
{
    attachments.indices = {0xffff};
    attachments.ext.micromap = attachments.micromap.ext;
    attachments.ext.indexType = VK_INDEX_TYPE_UINT16;
    attachments.ext.indexStride = 2;
    attachments.ext.indexBuffer.hostAddress = attachments.indices.data();
    attachments.ext.usageCountsCount = wrong ? 1 : 0;
    attachments.ext.pUsageCounts = &kOne;
}

// One triangle with the micromap, by its index; `change`: of the structure.
template <auto change>
void indexed(Attachments &attachments, bool wrong)
{
    attachments.ext.micromap = attachments.micromap.ext;
    attachments.ext.indexType = VK_INDEX_TYPE_UINT32;
    attachments.ext.indexStride = 4;
    attachments.ext.indexBuffer.hostAddress = attachments.indices.data();
    attachments.ext.usageCountsCount = 1;
    attachments.ext.pUsageCounts = &kOne;
    if (wrong)
        change(attachments.ext);
}

void copyNotBuilt(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    const Micromap target(gpu, twins.source, twins.source.size());
    const auto info =
        vkInit<VkCopyAccelerationStructureInfoKHR>({.src = (wrong ? twins.other : twins.built).khr,
                                                    .dst = target.handle().khr,
                                                    .mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR});
    const auto command = reinterpret_cast<PFN_vkCopyAccelerationStructureKHR>(
        vkGetDeviceProcAddr(gpu.device(), "vkCopyAccelerationStructureKHR"));
    command(gpu.device(), VK_NULL_HANDLE, &info);
}

void writeNotBuilt(Gpu &gpu, bool wrong)
{
    const Twins twins(gpu);
    const VkAccelerationStructureKHR structure = (wrong ? twins.other : twins.built).khr;
    const auto command = reinterpret_cast<PFN_vkWriteAccelerationStructuresPropertiesKHR>(
        vkGetDeviceProcAddr(gpu.device(), "vkWriteAccelerationStructuresPropertiesKHR"));
    VkDeviceSize size = 0;
    command(gpu.device(), 1, &structure, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR, sizeof size,
            &size, sizeof size);
}

void sizesWithoutCounts(Gpu &gpu, bool wrong)
{
    auto geometry = vkInit<VkAccelerationStructureGeometryKHR>({.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR});
    geometry.geometry.triangles =
        vkInit<VkAccelerationStructureGeometryTrianglesDataKHR>({.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT,
                                                                 .vertexStride = 12,
                                                                 .maxVertex = 2,
                                                                 .indexType = VK_INDEX_TYPE_NONE_KHR});
    const auto info = vkInit<VkAccelerationStructureBuildGeometryInfoKHR>(
        {.type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, .geometryCount = 1, .pGeometries = &geometry});
    auto sizes = vkInit<VkAccelerationStructureBuildSizesInfoKHR>();
    const uint32_t most = 1;
    gpu.vk().GetAccelerationStructureBuildSizesKHR(gpu.device(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info,
                                                   wrong ? nullptr : &most, &sizes);
}

const WrongProgram kPrograms[] = {
    {"VUID-vkBuildAccelerationStructuresKHR-pInfos-10892", Api::Ext, kNeedsNothing, build<indicesOfNoType>, "", "",
     true},
    {"VUID-vkBuildAccelerationStructuresKHR-pInfos-11821", Api::Ext, kNeedsNothing, build<noIndices>, "", "", true},
    {"attachment-usage-counts", Api::Ext, kNeedsNothing, build<noCounts>, "Host", "", true},
    {"attachment-usage-counts", Api::Ext, kNeedsNothing, build<countsSpecial>, "HostSpecial", "", true},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-indexType-10719", Api::Ext, kNeedsNothing,
     build<indexed<[](auto &ext) { ext.indexType = static_cast<VkIndexType>(7); }>>, "Host", "", true},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-indexType-10722", Api::Ext, kNeedsNothing,
     build<indexed<[](auto &ext) { ext.indexStride = 6; }>>, "Host", "", true},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-indexType-10723", Api::Ext, kNeedsNothing,
     build<indexed<[](auto &ext) { ext.indexStride = VkDeviceSize{1} << 40; }>>, "Host", "", true},
    {"VUID-VkAccelerationStructureTrianglesOpacityMicromapEXT-format-11679", Api::Ext, kNeedsNothing,
     build<indexed<[](auto &ext) { ext.pUsageCounts = &kOneOfNoFormat; }>>, "Host", "", true},
    {"VUID-vkBuildAccelerationStructuresKHR-pInfos-11705", Api::Khr, kNeedsNothing, build<attachesMicromap>, "", "",
     true},
    {"VUID-vkCopyAccelerationStructureKHR-src-11586", Api::Khr, kNeedsNothing, copyNotBuilt, "", "", true},
    {"VUID-vkWriteAccelerationStructuresPropertiesKHR-pAccelerationStructures-11591", Api::Khr, kNeedsNothing,
     writeNotBuilt, "", "", true},
    {"VUID-vkGetAccelerationStructureBuildSizesKHR-pMaxPrimitiveCounts-11612", Api::Khr, kNeedsNothing,
     sizesWithoutCounts},
};

} // namespace

std::span<const WrongProgram> hostStructurePrograms()
{
    return kPrograms;
}

} // namespace vt
