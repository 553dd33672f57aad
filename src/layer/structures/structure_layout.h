// Where the layer's part of an acceleration structure lies: behind the driver's, in the application's memory. What a
// build needs is behind what the driver says that it needs for the same build; where a copy puts it is decided on the
// GPU.
#pragma once

#include <vulkan/vulkan.h>

#include "core/align.h"
#include "layer/structures/structure_input.h"

namespace vellum::layer
{

inline constexpr VkDeviceSize kPartAlignment = 256; // of parts within acceleration structures and scratch memory

// Makes the build what the driver gets: without micromaps, and with every geometry that has one non-opaque, so that
// each hit on it is handed to a shader; of a top-level structure never an update.
void hideMicromaps(StructureBuild &build);

// Bytes of the records of a bottom-level structure; 0: it needs none. `primitives`: of each geometry.
VkDeviceSize bottomLevelTailBytes(const StructureBuild &build, const uint32_t *primitives);

// --- top level ---
// The instances that the driver builds from lie behind its scratch memory.
inline constexpr VkDeviceSize kPatchedAlignment = 64;

// The parts of a top-level structure for builds of up to `count` instances with some flags, and for copies, which are
// builds without flags: never less for more instances. Asks the driver for sizes, twice at most.
struct TopLevelLayout {
    TopLevelLayout(const Driver &driver, VkBuildAccelerationStructureFlagsKHR flags, uint32_t count);

    uint32_t count;
    VkDeviceSize driverScratch = 0; // that the driver needs, in front of the instances it builds from
    VkDeviceSize tailOffset = 0;    // of the instances that are kept, behind the driver's part
    [[nodiscard]] VkDeviceSize bytes() const
    {
        return tailOffset + VkDeviceSize{count} * sizeof(VkAccelerationStructureInstanceKHR);
    }
    [[nodiscard]] VkDeviceSize scratchBytes() const
    {
        return driverScratch + kPartAlignment + VkDeviceSize{count} * sizeof(VkAccelerationStructureInstanceKHR);
    }
};
// The largest number of instances that a structure of that size can hold.
uint32_t topLevelCapacity(const Driver &driver, VkDeviceSize size);

// The build of a top-level structure as the driver gets it: one geometry, instances from an array at `instances`.
struct TopLevelBuild {
    TopLevelBuild(VkBuildAccelerationStructureFlagsKHR flags, VkDeviceAddress instances);
    TopLevelBuild(const TopLevelBuild &) = delete;
    TopLevelBuild &operator=(const TopLevelBuild &) = delete;
    VkAccelerationStructureGeometryKHR geometry;
    VkAccelerationStructureBuildGeometryInfoKHR info;
};

} // namespace vellum::layer
