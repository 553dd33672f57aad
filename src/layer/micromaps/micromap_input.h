// SPDX-License-Identifier: Apache-2.0
// A build of a micromap by either extension, as the back ends record it: made of an accepted input. Its sizes follow
// from the usage counts, for device and host builds.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <vulkan/vulkan.h>

#include "core/curve.h"
#include "core/records.h"
#include "layer/input/builds.h"
#include "layer/rules/rule.h"
#include "layer/state/acceleration_structure.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct AccelerationStructure;

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

// The builds that emulation supports.
inline constexpr MicromapSupport kEmulatedSupport{{shared::kMaxSubdivisionLevel, shared::kMaxSubdivisionLevel,
                                                   shared::kMaxSubdivisionLevel, shared::kMaxMicromapTriangles},
                                                  true};

struct MicromapBuild {
    Micromap target;                                  // null for a query of sizes
    std::shared_ptr<AccelerationStructure> structure; // the target, in VK_KHR_opacity_micromap
    VkDeviceSize bytes = 0;                           // the most that the build writes
    VkBuildMicromapFlagsEXT flags = 0;                // may hold kLossyBuild
    std::vector<VkMicromapUsageEXT> usages;           // only counts above 0; unknown formats count as 4-state
    MicromapExtent extent;
    VkDeviceOrHostAddressConstKHR data{};
    VkDeviceOrHostAddressConstKHR triangles{};
    VkDeviceSize triangleStride = 0;
    VkDeviceAddress scratch = 0;
};
// The build without its target.
MicromapBuild micromapBuildOf(const input::MicromapBuild &given);
// The memory that an emulated build needs; nullopt: its shaders cannot count its triangles or units.
std::optional<input::BuildNeeds> emulatedNeeds(const input::MicromapBuild &build);

// The size of a micromap as queries report it. It marks GENERIC structures that are created for micromaps.
VkDeviceSize markedMicromapSize(VkDeviceSize bytes);

// A VkMicromapEXT, as rules see it.
inline ObjectFacts micromapFacts(ObjectHandle handle)
{
    const auto *micromap = reinterpret_cast<const Micromap *>(handle.handle);
    return {.exists = micromap != nullptr,
            .type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR,
            .size = micromap ? micromap->size : 0};
}

} // namespace vellum::layer
