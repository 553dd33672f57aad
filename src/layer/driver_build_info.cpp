#include "layer/driver_build_info.h"

namespace vellum::layer
{

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

} // namespace vellum::layer
