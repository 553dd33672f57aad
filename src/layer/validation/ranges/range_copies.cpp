// SPDX-License-Identifier: Apache-2.0
// Copies, fills, updates, query results and markers.
#include <algorithm>
#include <array>
#include <bit>
#include <utility>

#include "layer/validation/ranges/ranges.h"
#include "layer/validation/rules/rule_check.h"

namespace vellum::layer::ranges
{
namespace
{

constexpr VkDeviceSize kMaxUpdate = 65536;

// A range of which a command accesses `least` bytes.
rules::Range withLeast(rules::Range range, VkDeviceSize least)
{
    range.least = least;
    return range;
}

// A range of a copy.
struct Part {
    MemoryRange at;
    uint32_t region;
    const char *member;
    bool isReported = false; // a source: that it overlaps another range
    [[nodiscard]] bool isSource() const { return member[0] == 's'; }
};

// By its letter, the rule is broken by every copy: no source may overlap "the srcRange or dstRange of any element". As
// Khronos' layer and conformance tests, this takes it for other ranges, of which two sources may not overlap either.
// Each source is reported with one range.
void checkOverlap(const RangeCheck &ranges, const Place &info, std::vector<Part> parts)
{
    std::erase_if(parts, [](const Part &part) { return part.at.begin == part.at.end; });
    std::ranges::sort(parts, {}, [](const Part &part) { return std::tuple(part.at.memory, part.at.begin); });
    std::array<Part *, 2> furthest{}; // of the targets and of the sources before, what ends last
    for (Part &part : parts) {
        for (Part *other : furthest) {
            if (!other || !other->at.overlaps(part.at) || !(part.isSource() || other->isSource()))
                continue;
            Part &source = part.isSource() ? part : *other;
            if (std::exchange(source.isReported, true))
                continue;
            const Part &with = part.isSource() ? *other : part;
            const Place region = info.element("pRegions", source.region);
            ranges.fault(region.member(source.member), "VUID-VkCopyDeviceMemoryInfoKHR-srcRange-13015",
                         "overlaps " + std::string(with.member) + " of pRegions[" + std::to_string(with.region) +
                             "] in memory");
        }
        Part *&own = furthest[part.isSource() ? 1 : 0];
        if (!own || own->at.memory != part.at.memory || part.at.end > own->at.end)
            own = &part;
    }
}

} // namespace

void cmdCopyMemory(const RangeCheck &ranges, const VkCopyDeviceMemoryInfoKHR *copy)
{
    const Place info = ranges.command().member("pCopyMemoryInfo");
    std::vector<Part> parts;
    parts.reserve(size_t{copy->regionCount} * 2);
    for (uint32_t i = 0; i < copy->regionCount; ++i) {
        const VkDeviceMemoryCopyKHR &region = copy->pRegions[i];
        const Place place = info.element("pRegions", i);
        const VkBuffer source =
            ranges.check(place, region.srcRange, region.srcFlags, flagged::kCopySource, rules::kCopySource);
        const VkBuffer target =
            ranges.check(place, region.dstRange, region.dstFlags, flagged::kCopyTarget, rules::kCopyTarget);
        if (region.dstRange.size < region.srcRange.size)
            ranges.fault(place, rules::kCopySizeId,
                         "dstRange has " + std::to_string(region.dstRange.size) + " bytes, srcRange has " +
                             std::to_string(region.srcRange.size));
        ranges.checkProtection(place, "srcFlags", region.srcFlags, "VUID-vkCmdCopyMemoryKHR-commandBuffer-13012",
                               nullptr);
        ranges.checkProtection(place, "dstFlags", region.dstFlags, "VUID-vkCmdCopyMemoryKHR-commandBuffer-13013",
                               "VUID-vkCmdCopyMemoryKHR-commandBuffer-13014");
        parts.push_back(
            {memoryAt(ranges.device(), region.srcRange.address, region.srcRange.size, source), i, "srcRange"});
        parts.push_back(
            {memoryAt(ranges.device(), region.dstRange.address, region.dstRange.size, target), i, "dstRange"});
    }
    checkOverlap(ranges, info, std::move(parts));
}

void cmdUpdateMemory(const RangeCheck &ranges, const VkDeviceAddressRangeKHR *range, VkAddressCommandFlagsKHR flags,
                     VkDeviceSize size, const void *)
{
    const Place &command = ranges.command();
    ranges.check(command, *range, flags, flagged::kUpdate, withLeast(rules::kUpdated, size));
    if (range->size > kMaxUpdate)
        ranges.fault(command.member("pDstRange"), "VUID-vkCmdUpdateMemoryKHR-pDstRange-13007",
                     std::to_string(range->size) + " bytes; at most 65536 are allowed");
    if (size % 4 != 0)
        ranges.fault(command.member("dataSize"), "VUID-vkCmdUpdateMemoryKHR-dataSize-13009",
                     std::to_string(size) + " is not a multiple of 4");
    ranges.checkProtection(command, "dstFlags", flags, "VUID-vkCmdUpdateMemoryKHR-commandBuffer-13010",
                           "VUID-vkCmdUpdateMemoryKHR-commandBuffer-13011");
}

void cmdFillMemory(const RangeCheck &ranges, const VkDeviceAddressRangeKHR *range, VkAddressCommandFlagsKHR flags,
                   uint32_t)
{
    const Place &command = ranges.command();
    ranges.check(command, *range, flags, flagged::kFill, rules::kFilled);
    if (range->size % 4 != 0)
        ranges.fault(command.member("pDstRange"), "VUID-vkCmdFillMemoryKHR-pDstRange-13002",
                     "size " + std::to_string(range->size) + " is not a multiple of 4");
    ranges.checkProtection(command, "dstFlags", flags, "VUID-vkCmdFillMemoryKHR-commandBuffer-13003",
                           "VUID-vkCmdFillMemoryKHR-commandBuffer-13004");
}

void cmdCopyQueryPoolResultsToMemory(const RangeCheck &ranges, VkQueryPool, uint32_t, uint32_t count,
                                     const VkStridedDeviceAddressRangeKHR *range, VkAddressCommandFlagsKHR flags,
                                     VkQueryResultFlags results)
{
    if (count == 0)
        return;
    const Place &command = ranges.command();
    // A lower bound: the number of values of a result depends on the type of the pool.
    const bool wide = (results & VK_QUERY_RESULT_64_BIT) != 0;
    const VkDeviceSize value = wide ? 8 : 4;
    const VkDeviceSize result = (results & VK_QUERY_RESULT_WITH_AVAILABILITY_BIT) != 0 ? 2 * value : value;
    const VkDeviceSize before = count > 1 && range->stride > range->size ? range->size : (count - 1) * range->stride;
    ranges.check(command, *range, flags, flagged::kQueryResults, withLeast(rules::kQueryResults, before + result));
    if (range->address % value != 0 || range->stride % value != 0)
        ranges.fault(command.member("pDstRange"),
                     wide ? "VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-flags-13078"
                          : "VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-flags-13077",
                     textOf({range->address, range->size}) + ", stride " + std::to_string(range->stride) +
                         ": address or stride is not a multiple of " + std::to_string(value));
    if ((flags & VK_ADDRESS_COMMAND_PROTECTED_BIT_KHR) != 0)
        ranges.fault(command.member("dstFlags"), "VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-dstFlags-13085",
                     "PROTECTED; query results are not written to protected memory");
}

void cmdWriteMarkerToMemory(const RangeCheck &ranges, const VkMemoryMarkerInfoAMD *marker)
{
    DeviceModel &device = ranges.device();
    const Place info = ranges.command().member("pInfo");
    if (!device.facts.synchronization2)
        ranges.fault(ranges.command(), "VUID-vkCmdWriteMarkerToMemoryAMD-synchronization2-13042",
                     "the feature synchronization2 is not enabled");
    if (!std::has_single_bit(marker->stage))
        ranges.fault(info.member("stage"), "VUID-VkMemoryMarkerInfoAMD-stage-13038",
                     std::to_string(std::popcount(marker->stage)) + " stages; there must be one");
    checkStage(device, info.member("stage"), marker->stage, "VUID-VkMemoryMarkerInfoAMD-stage-11541",
               ranges.commandBuffer());
    ranges.check(info, marker->dstRange, marker->dstFlags, flagged::kMarker, rules::kMarker);
    ranges.checkProtection(info, "dstFlags", marker->dstFlags, "VUID-vkCmdWriteMarkerToMemoryAMD-commandBuffer-13044",
                           "VUID-vkCmdWriteMarkerToMemoryAMD-commandBuffer-13045");
    const auto buffer = bufferAt(device, marker->dstRange.address);
    const bool flag = (marker->dstFlags & VK_ADDRESS_COMMAND_PROTECTED_BIT_KHR) != 0;
    if (buffer && flag != ((buffer->flags & VK_BUFFER_CREATE_PROTECTED_BIT) != 0))
        ranges.fault(info.member("dstFlags"),
                     flag ? "VUID-vkCmdWriteMarkerToMemoryAMD-pInfo-13046"
                          : "VUID-vkCmdWriteMarkerToMemoryAMD-pInfo-13047",
                     std::string(flag ? "PROTECTED" : "no PROTECTED") + ", for buffer " +
                         device.nameOf(buffer->handle) + ", which is " + (flag ? "not protected" : "protected"));
}

} // namespace vellum::layer::ranges
