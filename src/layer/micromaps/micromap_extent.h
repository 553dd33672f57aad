// What a micromap build is asked for: the sizes that follow from it, and what is wrong with it. Device and host builds.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <vulkan/vulkan.h>

#include "core/records.h"

namespace vellum::layer
{

// Among VkMicromapBuildInfoEXT::flags: the build is lossy. KHR's flag, which is none of EXT's.
inline constexpr VkBuildMicromapFlagsEXT kLossyBuild = 0x400;

// Usage count i of a build, however it gives them.
inline const VkMicromapUsageEXT &usageAt(const VkMicromapBuildInfoEXT &info, uint32_t i)
{
    return info.pUsageCounts ? info.pUsageCounts[i] : *info.ppUsageCounts[i];
}

// Of the triangles of a build, which its shaders place block by block.
constexpr uint64_t blocksOf(uint64_t triangles)
{
    return (triangles + shared::kPlaceBlock - 1) / shared::kPlaceBlock;
}

// What shaders need of scratch memory. Drivers may ask for less (minAccelerationStructureScratchOffsetAlignment;
// lavapipe says 8), so a build begins at the first such address, and needs so many bytes more. Less than the other no
// driver asks for.
inline constexpr uint64_t kScratchAlignment = 16;
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

struct Offence {
    const char *id;
    std::string text;
};
// The first rule that the usage counts and the type break.
std::optional<Offence> offenceOf(const VkMicromapBuildInfoEXT &info);
// The same, and with the destination and the stride.
std::optional<Offence> buildOffenceOf(const VkMicromapBuildInfoEXT &info);

} // namespace vellum::layer
