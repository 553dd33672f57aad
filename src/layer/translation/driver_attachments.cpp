#include "layer/translation/driver_attachments.h"

#include <algorithm>

#include "layer/translation/device_translation.h"
#include "layer/translation/placed_micromaps.h"

namespace vellum::layer
{
namespace
{

constexpr VkStructureType kAttachmentKHR = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR;

// How many of a geometry's triangles have each level and format, EXT wants to know exactly, and drivers size a
// structure by it; but the indices that tell it are read on the device, later. So it is the most that is possible:
// every triangle of the geometry has each level and format that there is in the micromap.
std::vector<VkMicromapUsageEXT> mostUsages(const DeviceTranslation &device, const PlacedMicromap &micromap,
                                           uint32_t primitives, bool indexed)
{
    if (!micromap.isKnown)
        return {{primitives, device.limits.twoStateLevel, VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT},
                {primitives, device.limits.fourStateLevel, VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT}};
    std::vector<VkMicromapUsageEXT> result;
    for (const VkMicromapUsageEXT &usage : micromap.usages) {
        const auto same = std::ranges::find_if(result, [&](const VkMicromapUsageEXT &other) {
            return other.subdivisionLevel == usage.subdivisionLevel && other.format == usage.format;
        });
        if (same == result.end())
            result.push_back(usage);
        else
            same->count += usage.count;
    }
    // Indices may name a triangle of the micromap many times.
    for (VkMicromapUsageEXT &usage : result)
        usage.count = indexed ? primitives : std::min(primitives, usage.count);
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
        VkAccelerationStructureGeometryKHR &g = geometries_.emplace_back(
            application.pGeometries ? application.pGeometries[i] : *application.ppGeometries[i]);
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
    const bool indexed = khr.indexType != VK_INDEX_TYPE_NONE_KHR;
    VkAccelerationStructureTrianglesOpacityMicromapEXT &ext = attachments_.emplace_back();
    ext = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT};
    ext.indexType = khr.indexType;
    ext.indexBuffer.deviceAddress = khr.indexBuffer;
    ext.indexStride = khr.indexStride;
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
            usages = mostUsages(device, micromap, primitives, indexed);
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
