// SPDX-License-Identifier: Apache-2.0
// Sizes of a micromap build, computed from its usage counts. For device and host builds.
#pragma once

#include <cstdint>

#include <vulkan/vulkan.h>

#include "core/records.h"
#include "layer/input/builds.h"

namespace vellum::layer
{

// A flag in MicromapBuild::flags: the build is lossy. Only VK_KHR_opacity_micromap has the flag.
inline constexpr VkBuildMicromapFlagsEXT kLossyBuild = 0x400;

// Number of blocks of triangles.
constexpr uint64_t blocksOf(uint64_t triangles)
{
    return (triangles + shared::kPlaceBlock - 1) / shared::kPlaceBlock;
}

// Alignment of scratch memory that the shaders need. Drivers may require less
// (minAccelerationStructureScratchOffsetAlignment; 8 on lavapipe), so a build begins at the next aligned address, and
// its scratch size includes up to so many bytes.
inline constexpr uint64_t kBuildScratchAlignment = 16;

// The extent of a micromap with some usage counts.
struct MicromapExtent {
    uint64_t triangles = 0;
    uint64_t units = 0; // of kDataUnitBytes
    uint32_t maxLevel = 0;
    bool lossy = false; // triangles are coarsened first

    [[nodiscard]] uint64_t bytes() const;
    // Entries of the list of parts in the scratch memory.
    [[nodiscard]] uint64_t parts() const;
    [[nodiscard]] uint64_t scratchBytes() const;
    // The coarsened micromap of a lossy build: its offset in the scratch memory, after everything else, and its bytes.
    [[nodiscard]] uint64_t coarsenedOffset() const;
    [[nodiscard]] uint64_t coarsenedBytes() const;
    // Returns whether the build's shaders can count its triangles and units.
    [[nodiscard]] bool countable() const;
};
MicromapExtent extentOf(const input::UsageCounts &usages, VkBuildMicromapFlagsEXT flags);
// A usage count with one of the two formats: unknown ones count as 4-state, which takes most.
constexpr VkMicromapUsageEXT knownUsage(VkMicromapUsageEXT usage)
{
    if (usage.format != VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT)
        usage.format = VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT;
    return usage;
}

} // namespace vellum::layer
