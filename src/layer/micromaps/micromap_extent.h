// The sizes that follow from the usage counts of a micromap build. Device and host builds.
#pragma once

#include <cstdint>
#include <span>

#include <vulkan/vulkan.h>

#include "core/records.h"

namespace vellum::layer
{

// Among VkMicromapBuildInfoEXT::flags: the build is lossy, a flag that only VK_KHR_opacity_micromap has.
inline constexpr VkBuildMicromapFlagsEXT kLossyBuild = 0x400;

// Blocks that the shaders of a build place its triangles by.
constexpr uint64_t blocksOf(uint64_t triangles)
{
    return (triangles + shared::kPlaceBlock - 1) / shared::kPlaceBlock;
}

// What shaders need of scratch memory. Drivers may ask for less (minAccelerationStructureScratchOffsetAlignment; 8 on
// lavapipe), so a build begins at the first such address, and needs up to so many bytes more. No known driver asks for
// less than the second.
inline constexpr uint64_t kBuildScratchAlignment = 16;
inline constexpr uint64_t kLeastScratchAlignment = 4;

// What a micromap of some usage counts takes.
struct MicromapExtent {
    uint64_t triangles = 0;
    uint64_t units = 0; // of kDataUnitBytes
    uint32_t maxLevel = 0;
    bool share = false; // identical data is kept once
    bool lossy = false; // triangles are coarsened first

    [[nodiscard]] uint64_t bytes() const;
    // Entries of the list of parts in the scratch memory.
    [[nodiscard]] uint64_t parts() const;
    // Slots of the hash table in the scratch memory, a power of two.
    [[nodiscard]] uint64_t tableSlots() const;
    [[nodiscard]] uint64_t scratchBytes() const;
    // Where the scratch memory holds the coarsened micromap of a lossy build: behind everything else. Its bytes.
    [[nodiscard]] uint64_t coarsenedOffset() const;
    [[nodiscard]] uint64_t coarsenedBytes() const;
    // Whether the build's shaders can count its triangles and units.
    [[nodiscard]] bool countable() const;
};
// `usages`: with counts above 0.
MicromapExtent extentOf(std::span<const VkMicromapUsageEXT> usages, VkBuildMicromapFlagsEXT flags);

} // namespace vellum::layer
