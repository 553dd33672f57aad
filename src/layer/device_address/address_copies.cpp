// SPDX-License-Identifier: Apache-2.0
// Copies, fills and updates of VK_KHR_device_address_commands. Neither the regions of a command nor commands without a
// barrier between them are ordered, so a command may become one for each pair of buffers.
#include <map>
#include <utility>
#include <vector>

#include "layer/base/commands.h"
#include "layer/device_address/address_lookup.h"
#include "layer/device_address/device_addresses.h"
#include "layer/query_pool/device_query_pools.h"

namespace vellum::layer
{
namespace
{

// Regions by the buffer and image layout that they copy to or from: the older commands take one of each.
using ImageRegions = std::map<std::pair<VkBuffer, VkImageLayout>, std::vector<VkBufferImageCopy2>>;

// Empty if there are no regions, or one is in no buffer.
ImageRegions imageRegions(const AddressLookup &lookup, const VkCopyDeviceMemoryImageInfoKHR &info,
                          const rules::Range &rule)
{
    ImageRegions groups;
    for (uint32_t i = 0; i < info.regionCount; ++i) {
        const VkDeviceMemoryImageCopyKHR &region = info.pRegions[i];
        const auto found =
            lookup.find(region.addressRange, {.member = "addressRange of pRegions", .range = rule, .index = i});
        if (!found)
            return {};
        groups[{found->buffer, region.imageLayout}].push_back(
            {VK_STRUCTURE_TYPE_BUFFER_IMAGE_COPY_2, region.pNext, found->offset, region.addressRowLength,
             region.addressImageHeight, region.imageSubresource, region.imageOffset, region.imageExtent});
    }
    return groups;
}

// The regions for the commands of Vulkan 1.0: devices of Vulkan 1.2 need not have VK_KHR_copy_commands2.
std::vector<VkBufferImageCopy> oldRegions(const std::vector<VkBufferImageCopy2> &regions)
{
    std::vector<VkBufferImageCopy> old;
    for (const VkBufferImageCopy2 &region : regions)
        old.push_back({region.bufferOffset, region.bufferRowLength, region.bufferImageHeight, region.imageSubresource,
                       region.imageOffset, region.imageExtent});
    return old;
}

} // namespace

void cmdCopyMemory(DeviceAddresses &device, VkCommandBuffer commandBuffer, const VkCopyDeviceMemoryInfoKHR *info)
{
    const AddressLookup lookup(device, commandBuffer, "vkCmdCopyMemoryKHR");
    std::map<std::pair<VkBuffer, VkBuffer>, std::vector<VkBufferCopy>> groups;
    for (uint32_t i = 0; i < info->regionCount; ++i) {
        const VkDeviceMemoryCopyKHR &region = info->pRegions[i];
        if (region.dstRange.size < region.srcRange.size) {
            lookup.report(Severity::Reject, rules::kCopySizeId, "a destination is smaller than its source");
            return;
        }
        if (region.srcRange.size == 0) // not allowed in VkBufferCopy
            continue;
        const auto source =
            lookup.find(region.srcRange, {.member = "srcRange of pRegions", .range = rules::kCopySource, .index = i});
        const auto target =
            lookup.find(region.dstRange, {.member = "dstRange of pRegions", .range = rules::kCopyTarget, .index = i});
        if (!source || !target)
            return;
        groups[{source->buffer, target->buffer}].push_back({source->offset, target->offset, region.srcRange.size});
    }
    for (const auto &[buffers, regions] : groups)
        device.driver.next.CmdCopyBuffer(commandBuffer, buffers.first, buffers.second,
                                         static_cast<uint32_t>(regions.size()), regions.data());
}

void cmdCopyMemoryToImage(DeviceAddresses &device, VkCommandBuffer commandBuffer,
                          const VkCopyDeviceMemoryImageInfoKHR *info)
{
    const AddressLookup lookup(device, commandBuffer, "vkCmdCopyMemoryToImageKHR");
    const ImageRegions groups = imageRegions(lookup, *info, rules::kToImage);
    for (const auto &[key, regions] : groups) {
        const auto count = static_cast<uint32_t>(regions.size());
        const VkCopyBufferToImageInfo2 copy{VK_STRUCTURE_TYPE_COPY_BUFFER_TO_IMAGE_INFO_2,
                                            nullptr,
                                            key.first,
                                            info->image,
                                            key.second,
                                            count,
                                            regions.data()};
        if (const auto next = device.driver.next.CmdCopyBufferToImage2)
            next(commandBuffer, &copy);
        else
            device.driver.next.CmdCopyBufferToImage(commandBuffer, key.first, info->image, key.second, count,
                                                    oldRegions(regions).data());
    }
}

void cmdCopyImageToMemory(DeviceAddresses &device, VkCommandBuffer commandBuffer,
                          const VkCopyDeviceMemoryImageInfoKHR *info)
{
    const AddressLookup lookup(device, commandBuffer, "vkCmdCopyImageToMemoryKHR");
    const ImageRegions groups = imageRegions(lookup, *info, rules::kFromImage);
    for (const auto &[key, regions] : groups) {
        const auto count = static_cast<uint32_t>(regions.size());
        const VkCopyImageToBufferInfo2 copy{VK_STRUCTURE_TYPE_COPY_IMAGE_TO_BUFFER_INFO_2,
                                            nullptr,
                                            info->image,
                                            key.second,
                                            key.first,
                                            count,
                                            regions.data()};
        if (const auto next = device.driver.next.CmdCopyImageToBuffer2)
            next(commandBuffer, &copy);
        else
            device.driver.next.CmdCopyImageToBuffer(commandBuffer, info->image, key.second, key.first, count,
                                                    oldRegions(regions).data());
    }
}

void cmdUpdateMemory(DeviceAddresses &device, VkCommandBuffer commandBuffer, const VkDeviceAddressRangeKHR *range,
                     VkAddressCommandFlagsKHR, VkDeviceSize size, const void *data)
{
    const AddressLookup lookup(device, commandBuffer, "vkCmdUpdateMemoryKHR");
    const auto target = lookup.find(*range, {.member = "pDstRange", .range = rules::kUpdated, .least = size});
    if (target)
        device.driver.next.CmdUpdateBuffer(commandBuffer, target->buffer, target->offset, size, data);
}

void cmdFillMemory(DeviceAddresses &device, VkCommandBuffer commandBuffer, const VkDeviceAddressRangeKHR *range,
                   VkAddressCommandFlagsKHR, uint32_t data)
{
    if (range->size == 0) // not allowed in vkCmdFillBuffer
        return;
    const AddressLookup lookup(device, commandBuffer, "vkCmdFillMemoryKHR");
    const auto target = lookup.find(*range, {.member = "pDstRange", .range = rules::kFilled});
    if (target)
        device.driver.next.CmdFillBuffer(commandBuffer, target->buffer, target->offset, range->size, data);
}

void cmdCopyQueryPoolResultsToMemory(DeviceAddresses &device, VkCommandBuffer commandBuffer, VkQueryPool pool,
                                     uint32_t first, uint32_t count, const VkStridedDeviceAddressRangeKHR *range,
                                     VkAddressCommandFlagsKHR, VkQueryResultFlags flags)
{
    if (count == 0)
        return;
    const AddressLookup lookup(device, commandBuffer, "vkCmdCopyQueryPoolResultsToMemoryKHR");
    // Minimum size: the number of values of a result depends on the type of the pool.
    const VkDeviceSize value = (flags & VK_QUERY_RESULT_64_BIT) != 0 ? 8 : 4;
    const bool both = (flags & VK_QUERY_RESULT_WITH_AVAILABILITY_BIT) != 0;
    const bool tooMany =
        range->stride > range->size || (count - 1) > (range->size / std::max(range->stride, VkDeviceSize{1}));
    const auto target =
        lookup.find(*range, {.member = "pDstRange",
                             .range = rules::kQueryResults,
                             .least = tooMany ? UINT64_MAX : (count - 1) * range->stride + value * (both ? 2 : 1)});
    if (target)
        cmdCopyQueryPoolResults(device.queries, commandBuffer, pool, first, count, target->buffer, target->offset,
                                range->stride, flags);
}

void cmdWriteMarkerToMemory(DeviceAddresses &device, VkCommandBuffer commandBuffer, const VkMemoryMarkerInfoAMD *info)
{
    if (!device.driver.ownAddressCommands) {
        VkMemoryMarkerInfoAMD own = *info;
        if (device.driver.emulated())
            own.stage = driverStage(info->stage);
        return device.driver.next.CmdWriteMarkerToMemoryAMD(commandBuffer, &own);
    }
    const AddressLookup lookup(device, commandBuffer, "vkCmdWriteMarkerToMemoryAMD");
    const auto target = lookup.find(info->dstRange, {.member = "dstRange", .range = rules::kMarker});
    if (target)
        cmdWriteBufferMarker2(device.commands, commandBuffer, info->stage, target->buffer, target->offset,
                              info->marker);
}

} // namespace vellum::layer
