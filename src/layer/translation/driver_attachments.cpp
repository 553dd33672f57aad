#include "layer/translation/driver_attachments.h"

#include "layer/translation/device_translation.h"
#include "layer/translation/placed_micromaps.h"

namespace vellum::layer
{
namespace
{

constexpr VkStructureType kAttachmentKHR = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR;

// How many of a geometry's triangles have each level and format, EXT wants to know exactly, and drivers size a
// structure by it; but the indices that tell it are read on the device, later. So it is the most that is possible:
// every triangle of the geometry has each level and format that there is in the micromap, or that there can be in one
// of which nothing is known. The counts of the micromap's own build would be less where it is not indexed. But a
// build may follow the query of its size after the micromap was built again with more, and must not get more than the
// query.
std::vector<VkMicromapUsageEXT> mostUsages(const DeviceTranslation &device, const PlacedMicromap &micromap,
                                           uint32_t primitives)
{
    std::vector<VkMicromapUsageEXT> result = micromap.usages;
    if (!micromap.isKnown) {
        for (uint32_t level = 0; level <= device.limits.twoStateLevel; ++level)
            result.push_back({0, level, VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT});
        for (uint32_t level = 0; level <= device.limits.fourStateLevel; ++level)
            result.push_back({0, level, VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT});
    }
    for (VkMicromapUsageEXT &usage : result)
        usage.count = primitives;
    return result;
}

} // namespace

AttachedBuild::AttachedBuild(DeviceTranslation &device, const VkAccelerationStructureBuildGeometryInfoKHR &application,
                             const uint32_t *primitives)
    : info_(application)
{
    info_.flags &=
        ~static_cast<VkBuildAccelerationStructureFlagsKHR>(VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR);
    // It is ignored, and may be a micromap.
    if (info_.mode != VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR)
        info_.srcAccelerationStructure = VK_NULL_HANDLE;
    geometries_.reserve(application.geometryCount);
    for (uint32_t i = 0; i < application.geometryCount; ++i) {
        const VkAccelerationStructureGeometryKHR *given = application.pGeometries    ? application.pGeometries + i
                                                          : application.ppGeometries ? application.ppGeometries[i]
                                                                                     : nullptr;
        if (!given) {
            lacksGeometry_ = true;
            info_.geometryCount = i;
            break;
        }
        VkAccelerationStructureGeometryKHR &g = geometries_.emplace_back(*given);
        topLevel_ = topLevel_ || g.geometryType == VK_GEOMETRY_TYPE_INSTANCES_KHR;
        hasMicromapGeometry_ = hasMicromapGeometry_ || g.geometryType == VK_GEOMETRY_TYPE_MICROMAP_KHR;
        if (g.geometryType != VK_GEOMETRY_TYPE_TRIANGLES_KHR)
            continue;
        const auto *khr =
            findInChain<VkAccelerationStructureTrianglesOpacityMicromapKHR>(g.geometry.triangles.pNext, kAttachmentKHR);
        if (khr)
            attach(device, i, *khr, primitives ? primitives[i] : 0);
    }
}

void AttachedBuild::attach(DeviceTranslation &device, uint32_t geometry,
                           const VkAccelerationStructureTrianglesOpacityMicromapKHR &khr, uint32_t primitives)
{
    VkAccelerationStructureTrianglesOpacityMicromapEXT &ext = attachments_.emplace_back();
    ext = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT};
    ext.indexType = khr.indexType;
    if (khr.indexType != VK_INDEX_TYPE_NONE_KHR) {
        ext.indexBuffer.deviceAddress = khr.indexBuffer;
        ext.indexStride = khr.indexStride;
    }
    ext.baseTriangle = khr.baseTriangle;
    if (khr.indexType == VK_INDEX_TYPE_UINT8_EXT) {
        ext.indexType = VK_INDEX_TYPE_UINT32;
        ext.indexStride = sizeof(uint32_t);
        narrow_.push_back({geometry, khr.indexBuffer, khr.indexStride, primitives, &ext});
    }
    std::vector<VkMicromapUsageEXT> &usages = usages_.emplace_back();
    if (khr.micromap) {
        named_.push_back({geometry, khr.micromap});
        const auto structure = device.objects.accelerationStructures.get(khr.micromap);
        if (structure && canHoldMicromap(*structure)) {
            const PlacedMicromap micromap = lastMicromap(device, *structure);
            ext.micromap = micromap.handle;
            usages = mostUsages(device, micromap, primitives);
        }
    }
    ext.usageCountsCount = static_cast<uint32_t>(usages.size());
    ext.pUsageCounts = usages.data();
    auto &triangles = geometries_[geometry].geometry.triangles;
    Chain &chain = chains_.emplace_back(triangles.pNext);
    chain.remove(kAttachmentKHR);
    chain.prepend(reinterpret_cast<VkBaseInStructure *>(&ext));
    triangles.pNext = chain.head();
}

const VkAccelerationStructureBuildGeometryInfoKHR &AttachedBuild::info()
{
    info_.pGeometries = geometries_.empty() ? nullptr : geometries_.data();
    info_.ppGeometries = nullptr;
    return info_;
}

} // namespace vellum::layer
