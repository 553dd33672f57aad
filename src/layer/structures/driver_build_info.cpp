#include "layer/structures/driver_build_info.h"

#include "layer/ground/vulkan_newer.h"

namespace vellum::layer
{
namespace
{

constexpr VkStructureType kAttachmentEXT = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT;
constexpr VkStructureType kAttachmentKHR = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_KHR;

std::optional<MicromapAttachment> attachmentIn(const void *chain)
{
    if (const auto *khr = findInChain<VkAccelerationStructureTrianglesOpacityMicromapKHR>(chain, kAttachmentKHR))
        return MicromapAttachment{khr->indexType,    khr->indexBuffer, khr->indexStride,
                                  khr->baseTriangle, VK_NULL_HANDLE,   khr->micromap};
    if (const auto *ext = findInChain<VkAccelerationStructureTrianglesOpacityMicromapEXT>(chain, kAttachmentEXT))
        return MicromapAttachment{ext->indexType,   ext->indexBuffer.deviceAddress,
                                  ext->indexStride, ext->baseTriangle,
                                  ext->micromap,    VK_NULL_HANDLE};
    return std::nullopt;
}

} // namespace

VkBuildAccelerationStructureFlagsKHR topLevelFlags(VkBuildAccelerationStructureFlagsKHR application)
{
    return application & (VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR |
                          VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR |
                          VK_BUILD_ACCELERATION_STRUCTURE_LOW_MEMORY_BIT_KHR);
}

DriverBuildInfo::DriverBuildInfo(const VkAccelerationStructureBuildGeometryInfoKHR &application) : info_(application)
{
    const VkBuildAccelerationStructureFlagsKHR micromapFlags =
        VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_EXT |
        VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT |
        VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_DATA_UPDATE_EXT |
        VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR;
    info_.flags &= ~micromapFlags;
    // It is ignored, and may be a micromap.
    if (info_.mode != VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR)
        info_.srcAccelerationStructure = VK_NULL_HANDLE;
    for (uint32_t i = 0; i < application.geometryCount; ++i) {
        VkAccelerationStructureGeometryKHR g =
            application.pGeometries ? application.pGeometries[i] : *application.ppGeometries[i];
        std::optional<MicromapAttachment> micromap;
        opaque_.push_back((g.flags & VK_GEOMETRY_OPAQUE_BIT_KHR) != 0);
        // The type of a GENERIC structure is known from what is built into it.
        topLevel_ = topLevel_ || g.geometryType == VK_GEOMETRY_TYPE_INSTANCES_KHR;
        hasMicromapGeometry_ = hasMicromapGeometry_ || g.geometryType == VK_GEOMETRY_TYPE_MICROMAP_KHR;
        hasBoxes_ = hasBoxes_ || g.geometryType == VK_GEOMETRY_TYPE_AABBS_KHR;
        if (g.geometryType == VK_GEOMETRY_TYPE_TRIANGLES_KHR) {
            micromap = attachmentIn(g.geometry.triangles.pNext);
            if (micromap) {
                hasMicromaps_ = true;
                Chain &chain = chains_.emplace_back(g.geometry.triangles.pNext);
                chain.remove(kAttachmentEXT);
                chain.remove(kAttachmentKHR);
                // Carries a VkMicromapEXT, and was refused with its extension.
                chain.remove(newer::kTrianglesDisplacementMicromap);
                g.geometry.triangles.pNext = chain.head();
                g.flags &= ~static_cast<VkGeometryFlagsKHR>(VK_GEOMETRY_OPAQUE_BIT_KHR);
            }
        }
        geometries_.push_back(g);
        micromaps_.push_back(micromap);
    }
    if (topLevel_) {
        // An update is carried out as a build, since a copy may have more instances, inactive ones, than the
        // application knows of. Copies of top-level structures are builds too.
        info_.flags = topLevelFlags(info_.flags);
        info_.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR;
        info_.srcAccelerationStructure = VK_NULL_HANDLE;
    }
}

const VkAccelerationStructureBuildGeometryInfoKHR &DriverBuildInfo::info()
{
    info_.pGeometries = geometries_.empty() ? nullptr : geometries_.data();
    info_.ppGeometries = nullptr;
    return info_;
}

void DriverBuildInfo::setTarget(VkAccelerationStructureKHR handle)
{
    if (info_.srcAccelerationStructure == info_.dstAccelerationStructure)
        info_.srcAccelerationStructure = handle;
    info_.dstAccelerationStructure = handle;
}

} // namespace vellum::layer
