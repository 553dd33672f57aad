// SPDX-License-Identifier: Apache-2.0
#include "layer/micromaps/micromap_input.h"

#include <algorithm>

#include "core/align.h"
#include "core/curve.h"
#include "core/micromap.h"
#include "core/records.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

// The build's shaders use 32-bit sums, and add the units of a block to a sum that may have reached the limit.
// Shaders number blocks of triangles, and the invocations of a grid that is rounded up, in 32 bits.
constexpr uint64_t kMostTriangles = UINT32_MAX - (uint64_t{1} << 17);
constexpr uint64_t kMostUnits = UINT32_MAX - (uint64_t{kPlaceBlock} << 18);

} // namespace

uint64_t MicromapExtent::bytes() const
{
    return kMicromapHeaderWords * 4 + (triangles + 1) / 2 * 16 + units * kDataUnitBytes;
}

uint64_t MicromapExtent::parts() const
{
    return lossy ? units / kPartUnits : 0;
}

uint64_t MicromapExtent::coarsenedOffset() const
{
    const uint64_t words = kScratchTables + blocksOf(triangles) + 2 * parts();
    return alignUp(words * 4, 256);
}

uint64_t MicromapExtent::coarsenedBytes() const
{
    return alignUp(triangles * kLossyEntryBytes, 16) + units * kDataUnitBytes;
}

uint64_t MicromapExtent::scratchBytes() const
{
    return kBuildScratchAlignment +
           (lossy ? alignUp(coarsenedOffset() + coarsenedBytes() + parts() * kLossyPartBytes, 256) : coarsenedOffset());
}

bool MicromapExtent::countable() const
{
    return triangles < kMostTriangles && units < kMostUnits;
}

MicromapExtent extentOf(const input::UsageCounts &usages, VkBuildMicromapFlagsEXT flags)
{
    MicromapExtent extent;
    uint64_t inlineBytes = 0;
    for (uint32_t i = 0; i < usages.size(); ++i) {
        const VkMicromapUsageEXT usage = knownUsage(usages[i]);
        if (usage.count == 0) // level and format may have any value
            continue;
        extent.triangles += usage.count;
        extent.maxLevel = std::max(extent.maxLevel, usage.subdivisionLevel);
        const uint64_t bytes = packedBytes(usage.subdivisionLevel, static_cast<Format>(usage.format));
        // States of up to level 2 are kept in the triangle record itself.
        if (usage.subdivisionLevel > kCoarseLevel)
            extent.units += usage.count * ((bytes + kDataUnitBytes - 1) / kDataUnitBytes);
        else
            inlineBytes += usage.count * bytes;
    }
    // Without data there is nothing to save. Data offsets of triangles have 32 bits; a larger lossy build is built
    // without losses, which is allowed.
    extent.lossy = (flags & kLossyBuild) != 0 && extent.units > 0 && extent.coarsenedBytes() <= UINT32_MAX;
    // Data that stays in its order may have that of inline triangles between.
    if (!extent.lossy && extent.units > 0)
        extent.units += (inlineBytes + kDataUnitBytes - 1) / kDataUnitBytes;
    return extent;
}

namespace
{

constexpr VkBuildMicromapFlagsEXT kFlagsExt = VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT |
                                              VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT |
                                              VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;

VkBuildMicromapFlagsEXT flagsOf(const input::MicromapBuild &build)
{
    if (!build.khr)
        return build.flags & kFlagsExt; // kLossyBuild is not among them
    VkBuildMicromapFlagsEXT result = 0;
    if (build.flags & VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR)
        result |= VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT;
    if (build.flags & VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR)
        result |= VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT;
    if (build.flags & VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR)
        result |= VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
    if (build.flags & VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR)
        result |= kLossyBuild;
    return result;
}

} // namespace

MicromapBuild micromapBuildOf(const input::MicromapBuild &given)
{
    MicromapBuild build;
    build.bytes = given.needs.written;
    build.flags = flagsOf(given);
    build.data = given.data;
    build.triangles = given.triangles;
    build.triangleStride = given.triangleStride;
    build.scratch = given.scratch.deviceAddress;
    for (uint32_t i = 0; i < given.usages.size(); ++i) {
        if (given.usages[i].count > 0)
            build.usages.push_back(knownUsage(given.usages[i]));
    }
    build.extent = extentOf(given.usages, build.flags);
    return build;
}

std::optional<input::BuildNeeds> emulatedNeeds(const input::MicromapBuild &build)
{
    const MicromapExtent extent = extentOf(build.usages, flagsOf(build));
    if (!extent.countable())
        return std::nullopt;
    const VkDeviceSize bytes = extent.bytes();
    // Host builds need no scratch memory.
    return input::BuildNeeds{build.khr ? markedMicromapSize(bytes) : alignUp(bytes, 256), bytes,
                             build.host ? 0 : extent.scratchBytes()};
}

VkDeviceSize markedMicromapSize(VkDeviceSize bytes)
{
    return (bytes + 255 - kMicromapSizeMark) / 256 * 256 + kMicromapSizeMark;
}

} // namespace vellum::layer
