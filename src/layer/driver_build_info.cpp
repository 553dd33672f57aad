#include "layer/driver_build_info.h"

namespace vellum::layer
{

DriverBuildInfo::DriverBuildInfo(const VkAccelerationStructureBuildGeometryInfoKHR &application) : info_(application)
{
    const VkBuildAccelerationStructureFlagsKHR micromapFlags =
        VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_EXT |
        VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT |
        VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_DATA_UPDATE_EXT;
    info_.flags &= ~micromapFlags;
    for (uint32_t i = 0; i < application.geometryCount; ++i) {
        VkAccelerationStructureGeometryKHR g =
            application.pGeometries ? application.pGeometries[i] : *application.ppGeometries[i];
        const VkAccelerationStructureTrianglesOpacityMicromapEXT *micromap = nullptr;
        opaque_.push_back((g.flags & VK_GEOMETRY_OPAQUE_BIT_KHR) != 0);
        // The type of a GENERIC structure is known from what is built into it.
        topLevel_ = topLevel_ || g.geometryType == VK_GEOMETRY_TYPE_INSTANCES_KHR;
        hasBoxes_ = hasBoxes_ || g.geometryType == VK_GEOMETRY_TYPE_AABBS_KHR;
        if (g.geometryType == VK_GEOMETRY_TYPE_TRIANGLES_KHR) {
            const VkStructureType type = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT;
            micromap =
                findInChain<VkAccelerationStructureTrianglesOpacityMicromapEXT>(g.geometry.triangles.pNext, type);
            if (micromap) {
                hasMicromaps_ = true;
                Chain &chain = chains_.emplace_back(g.geometry.triangles.pNext);
                chain.remove(type);
                g.geometry.triangles.pNext = chain.head();
                g.flags &= ~static_cast<VkGeometryFlagsKHR>(VK_GEOMETRY_OPAQUE_BIT_KHR);
            }
        }
        geometries_.push_back(g);
        micromaps_.push_back(micromap);
    }
}

const VkAccelerationStructureBuildGeometryInfoKHR &DriverBuildInfo::info()
{
    info_.pGeometries = geometries_.empty() ? nullptr : geometries_.data();
    info_.ppGeometries = nullptr;
    return info_;
}

} // namespace vellum::layer
