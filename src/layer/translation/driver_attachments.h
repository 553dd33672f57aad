// Builds of acceleration structures with micromaps as VK_EXT_opacity_micromap puts them.
#pragma once

#include <deque>
#include <vector>

#include "layer/ground/pnext.h"
#include "layer/ground/vulkan_newer.h"

namespace vellum::layer
{

struct DeviceTranslation;

// One build, with what EXT wants of each geometry's micromap that KHR does not say.
class AttachedBuild
{
public:
    // `primitives`: of each geometry, the most that it may have.
    AttachedBuild(DeviceTranslation &device, const VkAccelerationStructureBuildGeometryInfoKHR &application,
                  const uint32_t *primitives);
    AttachedBuild(AttachedBuild &&) = default;
    AttachedBuild(const AttachedBuild &) = delete;
    AttachedBuild &operator=(const AttachedBuild &) = delete;
    AttachedBuild &operator=(AttachedBuild &&) = delete;

    // Indices of 8 bits, which EXT does not have: 32-bit ones are to be written to where `set` says.
    struct Narrow {
        uint32_t geometry;
        VkDeviceAddress indices;
        VkDeviceSize stride;
        uint32_t count;
        VkAccelerationStructureTrianglesOpacityMicromapEXT *attachment;
    };
    [[nodiscard]] const std::vector<Narrow> &narrow() const { return narrow_; }
    // The micromaps of geometries, as the application names them.
    struct Named {
        uint32_t geometry;
        VkAccelerationStructureKHR micromap;
    };
    [[nodiscard]] const std::vector<Named> &named() const { return named_; }

    [[nodiscard]] bool attaches() const { return !attachments_.empty(); }

    // Points into this object.
    [[nodiscard]] const VkAccelerationStructureBuildGeometryInfoKHR &info();
    [[nodiscard]] bool topLevel() const { return topLevel_; }
    // Not all geometries are there: the rest has not been looked at, and the build must not reach the driver.
    [[nodiscard]] bool lacksGeometry() const { return lacksGeometry_; }
    // One of VK_GEOMETRY_TYPE_MICROMAP_KHR, which only micromaps may have.
    [[nodiscard]] bool hasMicromapGeometry() const { return hasMicromapGeometry_; }

private:
    void attach(DeviceTranslation &device, uint32_t geometry,
                const VkAccelerationStructureTrianglesOpacityMicromapKHR &khr, uint32_t primitives);

    VkAccelerationStructureBuildGeometryInfoKHR info_;
    std::vector<VkAccelerationStructureGeometryKHR> geometries_;
    std::deque<VkAccelerationStructureTrianglesOpacityMicromapEXT> attachments_;
    std::deque<std::vector<VkMicromapUsageEXT>> usages_;
    std::deque<Chain> chains_;
    std::vector<Narrow> narrow_;
    std::vector<Named> named_;
    bool topLevel_ = false;
    bool hasMicromapGeometry_ = false;
    bool lacksGeometry_ = false;
};

} // namespace vellum::layer
