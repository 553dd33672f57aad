// SPDX-License-Identifier: Apache-2.0
#include "layer/micromaps/micromap_extent.h"

#include <algorithm>

#include "core/curve.h"
#include "core/micromap.h"

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
    return (words * 4 + 255) / 256 * 256;
}

uint64_t MicromapExtent::coarsenedBytes() const
{
    return (triangles * kLossyEntryBytes + 15) / 16 * 16 + units * kDataUnitBytes;
}

uint64_t MicromapExtent::scratchBytes() const
{
    return kBuildScratchAlignment +
           (lossy ? (coarsenedOffset() + coarsenedBytes() + parts() * kLossyPartBytes + 255) / 256 * 256
                  : coarsenedOffset());
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

} // namespace vellum::layer
