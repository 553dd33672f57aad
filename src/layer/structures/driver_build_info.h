// An acceleration structure build as the driver is to see it: without micromaps, and with every geometry that has one
// non-opaque, so that each hit on it is handed to a shader; of a top-level structure never an update.
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/ground/pnext.h"

namespace vellum::layer
{

// A geometry's micromap, whichever structure of the application said it.
struct MicromapAttachment {
    VkIndexType indexType;
    VkDeviceAddress indexBuffer;
    VkDeviceSize indexStride;
    uint32_t baseTriangle;
    VkMicromapEXT micromap;               // of VkAccelerationStructureTrianglesOpacityMicromapEXT
    VkAccelerationStructureKHR structure; // of VkAccelerationStructureTrianglesOpacityMicromapKHR
};

// What is left of the flags of a top-level build: the driver neither updates nor copies what it builds.
VkBuildAccelerationStructureFlagsKHR topLevelFlags(VkBuildAccelerationStructureFlagsKHR application);

class DriverBuildInfo
{
public:
    explicit DriverBuildInfo(const VkAccelerationStructureBuildGeometryInfoKHR &application);
    DriverBuildInfo(DriverBuildInfo &&) = default;
    DriverBuildInfo(const DriverBuildInfo &) = delete;
    DriverBuildInfo &operator=(const DriverBuildInfo &) = delete;
    DriverBuildInfo &operator=(DriverBuildInfo &&) = delete;

    // To be handed to the driver; `info` points into this object.
    [[nodiscard]] const VkAccelerationStructureBuildGeometryInfoKHR &info();
    // The driver is to build into another handle of the same place.
    void setTarget(VkAccelerationStructureKHR handle);
    [[nodiscard]] bool topLevel() const { return topLevel_; }
    [[nodiscard]] bool hasMicromaps() const { return hasMicromaps_; }
    [[nodiscard]] bool hasBoxes() const { return hasBoxes_; }
    // One of VK_GEOMETRY_TYPE_MICROMAP_KHR, which only micromaps may have.
    [[nodiscard]] bool hasMicromapGeometry() const { return hasMicromapGeometry_; }
    [[nodiscard]] uint32_t geometryCount() const { return static_cast<uint32_t>(geometries_.size()); }
    // The driver's copy of geometry i; may be changed.
    VkAccelerationStructureGeometryKHR &geometry(uint32_t i) { return geometries_[i]; }
    // Of the application's geometry i: its micromap, or null; and whether it is opaque.
    [[nodiscard]] const MicromapAttachment *micromap(uint32_t i) const
    {
        return micromaps_[i] ? &*micromaps_[i] : nullptr;
    }
    [[nodiscard]] bool opaque(uint32_t i) const { return opaque_[i]; }

private:
    VkAccelerationStructureBuildGeometryInfoKHR info_;
    std::vector<VkAccelerationStructureGeometryKHR> geometries_;
    std::vector<std::optional<MicromapAttachment>> micromaps_;
    std::vector<bool> opaque_;
    std::deque<Chain> chains_;
    bool topLevel_ = false;
    bool hasMicromaps_ = false;
    bool hasBoxes_ = false;
    bool hasMicromapGeometry_ = false;
};

} // namespace vellum::layer
