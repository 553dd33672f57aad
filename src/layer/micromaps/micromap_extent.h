// What a micromap build is asked for: the sizes that follow from it, and what is wrong with it. Device and host builds.
#pragma once

#include <cstdint>

#include <vulkan/vulkan.h>

#include "core/records.h"
#include "layer/ground/judge.h"

namespace vellum::layer
{

// Among VkMicromapBuildInfoEXT::flags: the build is lossy. KHR's flag, which is none of EXT's.
inline constexpr VkBuildMicromapFlagsEXT kLossyBuild = 0x400;

// Usage count i of a build, however it gives them. One of a format that there is not counts as one of the format that
// takes most.
inline VkMicromapUsageEXT usageAt(const VkMicromapBuildInfoEXT &info, uint32_t i)
{
    VkMicromapUsageEXT usage = info.pUsageCounts ? info.pUsageCounts[i] : *info.ppUsageCounts[i];
    if (usage.format != VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT)
        usage.format = VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT;
    return usage;
}

// Of the triangles of a build, which its shaders place block by block.
constexpr uint64_t blocksOf(uint64_t triangles)
{
    return (triangles + shared::kPlaceBlock - 1) / shared::kPlaceBlock;
}

// What shaders need of scratch memory. Drivers may ask for less (minAccelerationStructureScratchOffsetAlignment;
// lavapipe says 8), so a build begins at the first such address, and needs so many bytes more. Less than the other no
// driver asks for.
inline constexpr uint64_t kBuildScratchAlignment = 16;
inline constexpr uint64_t kLeastScratchAlignment = 4;

// What a micromap of these usage counts takes.
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
};
MicromapExtent extentOf(const VkMicromapBuildInfoEXT &info);

// Whether the sizes of a build may be told, by its type, mode and usage counts.
bool mayMeasure(const Judge &judge, const VkMicromapBuildInfoEXT &info);
// Whether it may be carried out, as far as the device and the host have the same rules.
bool mayBuild(const Judge &judge, const VkMicromapBuildInfoEXT &info);
// What VK_KHR_opacity_micromap has rules of its own for: a subdivision level that is too high, the stride that
// triangles lie apart, and how much there is in all.
bool mayHaveLevel(const Judge &judge, uint32_t usage, uint32_t level, uint32_t most, uint32_t count, const char *id);
bool mayHaveStride(const Judge &judge, VkDeviceSize stride, const MicromapExtent &extent, const char *id);
bool mayBeSoLarge(const Judge &judge, const MicromapExtent &extent);

} // namespace vellum::layer
