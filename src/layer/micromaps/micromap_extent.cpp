#include "layer/micromaps/micromap_extent.h"

#include <algorithm>
#include <bit>

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
    return kScratchAlignment +
           (lossy ? (coarsenedOffset() + coarsenedBytes() + parts() * kLossyPartBytes + 255) / 256 * 256
                  : coarsenedOffset());
}

MicromapExtent extentOf(const VkMicromapBuildInfoEXT &info)
{
    MicromapExtent extent;
    for (uint32_t i = 0; i < info.usageCountsCount; ++i) {
        const VkMicromapUsageEXT &usage = usageAt(info, i);
        extent.triangles += usage.count;
        if (usage.count > 0)
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

std::optional<Offence> offenceOf(const VkMicromapBuildInfoEXT &info)
{
    if (info.type != VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT)
        return Offence{"VELLUM-VUID-VkMicromapBuildInfoEXT-type-parameter",
                       "type " + std::to_string(info.type) + " is not VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT"};
    if (info.mode != VK_BUILD_MICROMAP_MODE_BUILD_EXT)
        return Offence{"VELLUM-VUID-VkMicromapBuildInfoEXT-mode-parameter",
                       "mode " + std::to_string(info.mode) + " is not VK_BUILD_MICROMAP_MODE_BUILD_EXT"};
    if (info.usageCountsCount > 0 && (info.pUsageCounts != nullptr) == (info.ppUsageCounts != nullptr))
        return Offence{"VELLUM-VUID-VkMicromapBuildInfoEXT-pUsageCounts-07516",
                       info.pUsageCounts
                           ? "both pUsageCounts and ppUsageCounts are given"
                           : "usageCountsCount is not 0, but neither pUsageCounts nor ppUsageCounts is given"};
    for (uint32_t i = 0; i < info.usageCountsCount; ++i) {
        const VkMicromapUsageEXT &usage = usageAt(info, i);
        const std::string where = "usage count " + std::to_string(i) + ": ";
        if (usage.format != VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT &&
            usage.format != VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT)
            return Offence{"VELLUM-VUID-VkMicromapBuildInfoEXT-format-11652",
                           where + "format " + std::to_string(usage.format) + " is neither 2-state nor 4-state"};
        if (usage.subdivisionLevel > kMaxSubdivisionLevel)
            return Offence{usage.format == VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT
                               ? "VELLUM-VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11654"
                               : "VELLUM-VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11655",
                           where + "subdivision level " + std::to_string(usage.subdivisionLevel) + " is above 12"};
    }
    const MicromapExtent extent = extentOf(info);
    if (extent.triangles >= kMostTriangles || extent.units >= kMostUnits)
        return Offence{"VELLUM-micromap-too-large",
                       "the usage counts add up to more than 2^32 triangles or data units"};
    return std::nullopt;
}

std::optional<Offence> buildOffenceOf(const VkMicromapBuildInfoEXT &info)
{
    if (auto offence = offenceOf(info))
        return offence;
    const Micromap *destination = micromapOf(info.dstMicromap);
    if (!destination)
        return Offence{"VELLUM-VUID-vkCmdBuildMicromapsEXT-dstMicromap-07463", "dstMicromap is VK_NULL_HANDLE"};
    const MicromapExtent extent = extentOf(info);
    const uint64_t needed = extent.bytes();
    if (destination->size < needed)
        return Offence{"VELLUM-VUID-vkCmdBuildMicromapsEXT-pInfos-07461",
                       "dstMicromap has " + std::to_string(destination->size) + " bytes, the build needs " +
                           std::to_string(needed)};
    if (extent.triangles == 0)
        return std::nullopt;
    if (info.triangleArrayStride > UINT32_MAX)
        return Offence{"VELLUM-micromap-stride", "triangleArrayStride does not fit 32 bits"};
    // A stride of less than a triangle would still be read safely, but means a mistake.
    if (info.triangleArrayStride < sizeof(VkMicromapTriangleEXT) && extent.triangles > 1)
        return Offence{"VELLUM-micromap-stride", "triangleArrayStride " + std::to_string(info.triangleArrayStride) +
                                                     " is less than the 8 bytes of a VkMicromapTriangleEXT"};
    return std::nullopt;
}

} // namespace vellum::layer
