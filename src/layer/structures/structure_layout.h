// Where the layer's part of an acceleration structure lies: behind the driver's, in the application's memory. What a
// build needs is behind what the driver says that it needs for the same build; where a copy puts it is decided on the
// GPU.
#pragma once

#include <vulkan/vulkan.h>

#include "layer/ground/align.h"
#include "layer/ground/driver.h"
#include "layer/structures/driver_build_info.h"

namespace vellum::layer
{

inline constexpr VkDeviceSize kPartAlignment = 256; // of parts within acceleration structures and scratch memory

// What the driver needs for a build with at most so many primitives in each geometry.
VkAccelerationStructureBuildSizesInfoKHR driverSizes(const Driver &driver, DriverBuildInfo &build,
                                                     const uint32_t *primitives,
                                                     VkAccelerationStructureBuildTypeKHR type);

// Bytes of the records of a bottom-level structure; 0: it needs none. `primitives`: of each geometry.
VkDeviceSize bottomLevelTailBytes(const DriverBuildInfo &build, const uint32_t *primitives);

// --- top level ---
// The driver's part for builds of up to `count` instances with these flags, and for copies, which are builds without
// any flags: never less for more instances.
VkAccelerationStructureBuildSizesInfoKHR
topLevelDriverSizes(const Driver &driver, VkBuildAccelerationStructureFlagsKHR flags, uint32_t count);
// The instances that the driver builds from lie behind its scratch memory.
inline constexpr VkDeviceSize kPatchedAlignment = 64;
constexpr VkDeviceSize patchedInstancesBytes(uint32_t count)
{
    return kPartAlignment + VkDeviceSize{count} * sizeof(VkAccelerationStructureInstanceKHR);
}
// From the beginning of the structure to the instances that are kept, and to the end of them.
VkDeviceSize topLevelTailOffset(const Driver &driver, VkBuildAccelerationStructureFlagsKHR flags, uint32_t count);
VkDeviceSize topLevelBytes(const Driver &driver, VkBuildAccelerationStructureFlagsKHR flags, uint32_t count);
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
