// SPDX-License-Identifier: Apache-2.0
// The layout of an acceleration structure with emulated micromaps: the tail, which is the layer's part, follows the
// driver's part in the application's memory. A build has it after the size that the driver returns for the same build;
// for a copy the GPU decides.
#pragma once

#include <cstdint>

#include <vulkan/vulkan.h>

#include "core/align.h"
#include "core/records.h"
#include "layer/structures/structure_input.h"

namespace vellum::layer
{

class InjectedWork;
class SlotRange;
struct DeviceStructures;

inline constexpr VkDeviceSize kPartAlignment = 256; // of parts within acceleration structures and scratch memory

// Changes the build to the one for the driver: without micromaps, and with every geometry that has one non-opaque, so
// that each hit on it reaches a shader. An update of a top-level structure becomes a build.
void hideMicromaps(StructureBuild &build);

// Bytes of the tail of a bottom-level structure; 0: it needs no records. `primitives`: of each geometry.
VkDeviceSize bottomLevelTailBytes(const StructureBuild &build, const uint32_t *primitives);

// --- top level ---
// The flags of copies, which are builds: the source may have the flag, which only the device knows.
inline constexpr VkBuildAccelerationStructureFlagsKHR kTopLevelCopyFlags =
    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR;

// The layout of a top-level structure for builds of up to `count` instances with some flags, and for copies. Sizes do
// not decrease with more instances. The constructor queries the driver's sizes, at most twice.
struct TopLevelLayout {
    TopLevelLayout(const Driver &driver, VkBuildAccelerationStructureFlagsKHR flags, uint32_t count);

    uint32_t count;
    VkDeviceSize scratchBytes = 0; // the driver's
    VkDeviceSize tailOffset = 0;   // of the instances, after the driver's part, which is not larger
    [[nodiscard]] VkDeviceSize bytes() const
    {
        return tailOffset + VkDeviceSize{count} * sizeof(VkAccelerationStructureInstanceKHR);
    }
    // The size that queries report: shared::kTopLevelSizeMark.
    [[nodiscard]] VkDeviceSize reportedBytes() const
    {
        return alignUp(bytes() + kPartAlignment - shared::kTopLevelSizeMark, kPartAlignment) - kPartAlignment +
               shared::kTopLevelSizeMark;
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

// The instances that the driver builds a top-level structure from: the application's are brought to the structure's
// tail, and changed there.
// Where the instances come from, which decides what they may reference.
enum class InstanceSource { Build, IndirectBuild, Copy };

// Records the dispatches that make `count` instances in the tail those for the driver. `source`: the application's, or
// the tail, if they were brought there before.
bool patchInstances(InjectedWork &work, const DeviceStructures &device, const SlotRange &slots, uint32_t count,
                    VkDeviceAddress source, VkDeviceAddress tail, InstanceSource from);

} // namespace vellum::layer
