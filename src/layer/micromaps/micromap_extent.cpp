#include "layer/micromaps/micromap_extent.h"

#include <algorithm>
#include <bit>
#include <string>

#include "core/curve.h"
#include "core/micromap.h"
#include "layer/objects/micromap_object.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

// The build's shaders count in 32 bits, and add the units of a block to a sum that may have reached the limit.
constexpr uint64_t kMostTriangles = UINT32_MAX;
constexpr uint64_t kMostUnits = UINT32_MAX - (uint64_t{kPlaceBlock} << 18);
// Above it, tables for sharing would have to be addressed in 64 bits.
constexpr uint64_t kMostSharing = uint64_t{1} << 26;
} // namespace

uint64_t MicromapExtent::bytes() const
{
    return kMicromapHeaderWords * 4 + (triangles + 1) / 2 * 16 + units * kDataUnitBytes;
}

uint64_t MicromapExtent::parts() const
{
    return units / kPartUnits;
}

uint64_t MicromapExtent::tableSlots() const
{
    return share ? std::bit_ceil(std::max<uint64_t>(2 * triangles, 2)) : 1;
}

uint64_t MicromapExtent::coarsenedOffset() const
{
    uint64_t words = kScratchTables + blocksOf(triangles) + 2 * parts();
    if (share)
        words += 2 * triangles + tableSlots();
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

MicromapExtent extentOf(const VkMicromapBuildInfoEXT &info)
{
    MicromapExtent extent;
    for (uint32_t i = 0; i < info.usageCountsCount; ++i) {
        const VkMicromapUsageEXT usage = usageAt(info, i);
        if (usage.count == 0) // of any level and format
            continue;
        extent.triangles += usage.count;
        extent.maxLevel = std::max(extent.maxLevel, usage.subdivisionLevel);
        // States of up to level 2 are kept in the triangle record itself.
        if (usage.subdivisionLevel > kCoarseLevel) {
            const uint64_t bytes = packedBytes(usage.subdivisionLevel, static_cast<Format>(usage.format));
            extent.units += usage.count * ((bytes + kDataUnitBytes - 1) / kDataUnitBytes);
        }
    }
    // Sharing reads all data twice more, so that compaction has something to save. No frame was found that is faster
    // with it (docs/measurements.md): PREFER_FAST_TRACE does not ask for it.
    extent.share = (info.flags & VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT) != 0 &&
                   (info.flags & VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT) == 0 && extent.triangles > 0 &&
                   extent.triangles <= kMostSharing;
    // Nothing is gained where there is no data. And offsets of triangles' data have 32 bits: a build may be lossy, it
    // need not.
    extent.lossy = (info.flags & kLossyBuild) != 0 && extent.units > 0 && extent.coarsenedBytes() <= UINT32_MAX;
    return extent;
}

bool mayHaveLevel(const Judge &judge, uint32_t usage, uint32_t level, uint32_t most, uint32_t count, const char *id)
{
    // How large a micromap would be that has such triangles, nobody can say.
    return judge.weigh(count == 0, id,
                       "usage count " + std::to_string(usage) + ": subdivision level " + std::to_string(level) +
                           " is above " + std::to_string(most));
}

bool mayHaveStride(const Judge &judge, VkDeviceSize stride, const MicromapExtent &extent, const char *id)
{
    if (stride > UINT32_MAX && extent.triangles > 1)
        return judge.refuse("VELLUM-micromap-stride", "triangleArrayStride does not fit 32 bits");
    // Triangles that overlap are read as they lie.
    return stride >= sizeof(VkMicromapTriangleEXT) ||
           judge.tolerate(id, "triangleArrayStride " + std::to_string(stride) +
                                  " is less than the 8 bytes of a VkMicromapTriangleEXT");
}

bool mayBeSoLarge(const Judge &judge, const MicromapExtent &extent)
{
    return (extent.triangles < kMostTriangles && extent.units < kMostUnits) ||
           judge.refuse("VELLUM-micromap-too-large",
                        "the usage counts add up to more than 2^32 triangles or data units");
}

bool mayMeasure(const Judge &judge, const VkMicromapBuildInfoEXT &info)
{
    if (info.type != VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT)
        return judge.refuse("VELLUM-VUID-VkMicromapBuildInfoEXT-type-parameter",
                            "type " + std::to_string(info.type) + " is not VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT");
    // There is only one thing to do.
    if (info.mode != VK_BUILD_MICROMAP_MODE_BUILD_EXT &&
        !judge.tolerate("VELLUM-VUID-VkMicromapBuildInfoEXT-mode-parameter",
                        "mode " + std::to_string(info.mode) + " is not VK_BUILD_MICROMAP_MODE_BUILD_EXT"))
        return false;
    constexpr const char *kUsageCounts = "VELLUM-VUID-VkMicromapBuildInfoEXT-pUsageCounts-07516";
    if (info.usageCountsCount > 0 && !info.pUsageCounts && !info.ppUsageCounts)
        return judge.refuse(kUsageCounts,
                            "usageCountsCount is not 0, but neither pUsageCounts nor ppUsageCounts is given");
    if (info.usageCountsCount > 0 && info.pUsageCounts && info.ppUsageCounts &&
        !judge.tolerate(kUsageCounts, "both pUsageCounts and ppUsageCounts are given"))
        return false;
    for (uint32_t i = 0; i < info.usageCountsCount; ++i) {
        const VkMicromapUsageEXT &usage = info.pUsageCounts ? info.pUsageCounts[i] : *info.ppUsageCounts[i];
        const bool twoState = usage.format == VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT;
        if (!twoState && usage.format != VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT &&
            !judge.tolerate("VELLUM-VUID-VkMicromapBuildInfoEXT-format-11652",
                            "usage count " + std::to_string(i) + ": format " + std::to_string(usage.format) +
                                " is neither 2-state nor 4-state"))
            return false;
        if (usage.subdivisionLevel > kMaxSubdivisionLevel &&
            !mayHaveLevel(judge, i, usage.subdivisionLevel, kMaxSubdivisionLevel, usage.count,
                          twoState ? "VELLUM-VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11654"
                                   : "VELLUM-VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11655"))
            return false;
    }
    return mayBeSoLarge(judge, extentOf(info));
}

bool mayBuild(const Judge &judge, const VkMicromapBuildInfoEXT &info)
{
    if (!mayMeasure(judge, info))
        return false;
    const Micromap *destination = micromapOf(info.dstMicromap);
    if (!destination)
        return judge.refuse("VELLUM-VUID-vkCmdBuildMicromapsEXT-dstMicromap-07463", "dstMicromap is VK_NULL_HANDLE");
    const MicromapExtent extent = extentOf(info);
    if (destination->size < extent.bytes())
        return judge.refuse("VELLUM-VUID-vkCmdBuildMicromapsEXT-pInfos-07461",
                            "dstMicromap has " + std::to_string(destination->size) + " bytes, the build needs " +
                                std::to_string(extent.bytes()));
    return extent.triangles <= 1 || mayHaveStride(judge, info.triangleArrayStride, extent, "VELLUM-micromap-stride");
}

} // namespace vellum::layer
