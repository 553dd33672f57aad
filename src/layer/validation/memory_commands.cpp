// SPDX-License-Identifier: Apache-2.0
// Copies, fills and updates of buffers and address ranges, and other commands that take address ranges and do more than
// to be passed on.
#include "layer/validation/commands.h"

namespace vellum::layer::validation
{
void cmdCopyBuffer(DeviceValidation &device, VkCommandBuffer commandBuffer, VkBuffer from, VkBuffer to, uint32_t count,
                   const VkBufferCopy *regions)
{
    for (uint32_t r = 0; r < count; ++r)
        sync::recordCopy(device.sync, commandBuffer, "vkCmdCopyBuffer", from, to, regions[r], r);
    device.next.CmdCopyBuffer(commandBuffer, from, to, count, regions);
}

void cmdCopyBuffer2(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkCopyBufferInfo2 *info)
{
    for (uint32_t r = 0; r < info->regionCount; ++r) {
        const VkBufferCopy2 &region = info->pRegions[r];
        sync::recordCopy(device.sync, commandBuffer, "vkCmdCopyBuffer2", info->srcBuffer, info->dstBuffer,
                         {region.srcOffset, region.dstOffset, region.size}, r);
    }
    device.next.CmdCopyBuffer2(commandBuffer, info);
}

void cmdFillBuffer(DeviceValidation &device, VkCommandBuffer commandBuffer, VkBuffer buffer, VkDeviceSize offset,
                   VkDeviceSize size, uint32_t data)
{
    sync::recordWrite(device.sync, commandBuffer, "vkCmdFillBuffer", buffer, offset, size);
    device.next.CmdFillBuffer(commandBuffer, buffer, offset, size, data);
}

void cmdUpdateBuffer(DeviceValidation &device, VkCommandBuffer commandBuffer, VkBuffer buffer, VkDeviceSize offset,
                     VkDeviceSize size, const void *data)
{
    sync::recordWrite(device.sync, commandBuffer, "vkCmdUpdateBuffer", buffer, offset, size);
    device.next.CmdUpdateBuffer(commandBuffer, buffer, offset, size, data);
}

void cmdCopyMemory(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkCopyDeviceMemoryInfoKHR *info)
{
    const CheckedRanges checked(device, commandBuffer, "vkCmdCopyMemoryKHR",
                                [&](const RangeCheck &check) { ranges::cmdCopyMemory(check, info); });
    sync::recordCopy(device.sync, commandBuffer, *info);
    device.next.CmdCopyMemoryKHR(commandBuffer, info);
}

void cmdUpdateMemory(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkDeviceAddressRangeKHR *range,
                     VkAddressCommandFlagsKHR flags, VkDeviceSize size, const void *data)
{
    const CheckedRanges checked(device, commandBuffer, "vkCmdUpdateMemoryKHR", [&](const RangeCheck &check) {
        ranges::cmdUpdateMemory(check, range, flags, size, data);
    });
    sync::recordWrite(device.sync, commandBuffer, "vkCmdUpdateMemoryKHR", *range);
    device.next.CmdUpdateMemoryKHR(commandBuffer, range, flags, size, data);
}

void cmdFillMemory(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkDeviceAddressRangeKHR *range,
                   VkAddressCommandFlagsKHR flags, uint32_t data)
{
    const CheckedRanges checked(device, commandBuffer, "vkCmdFillMemoryKHR",
                                [&](const RangeCheck &check) { ranges::cmdFillMemory(check, range, flags, data); });
    sync::recordWrite(device.sync, commandBuffer, "vkCmdFillMemoryKHR", *range);
    device.next.CmdFillMemoryKHR(commandBuffer, range, flags, data);
}

void cmdCopyQueryPoolResultsToMemory(DeviceValidation &device, VkCommandBuffer commandBuffer, VkQueryPool pool,
                                     uint32_t first, uint32_t count, const VkStridedDeviceAddressRangeKHR *range,
                                     VkAddressCommandFlagsKHR flags, VkQueryResultFlags results)
{
    const char *const name = "vkCmdCopyQueryPoolResultsToMemoryKHR";
    const CheckedRanges checked(device, commandBuffer, name, [&](const RangeCheck &check) {
        ranges::cmdCopyQueryPoolResultsToMemory(check, pool, first, count, range, flags, results);
    });
    sync::recordUse(device.sync, commandBuffer, name, device.objects.queryPools.get(pool));
    device.next.CmdCopyQueryPoolResultsToMemoryKHR(commandBuffer, pool, first, count, range, flags, results);
}

void cmdBeginConditionalRendering2(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                   const VkConditionalRenderingBeginInfo2EXT *info)
{
    const CheckedRanges checked(device, commandBuffer, "vkCmdBeginConditionalRendering2EXT",
                                [&](const RangeCheck &check) { ranges::cmdBeginConditionalRendering2(check, info); });
    // Kept for injected work, and for the end of conditional rendering.
    const auto state = device.commands.states.get(commandBuffer);
    const auto at = device.buffers.addresses.covering(info->addressRange.address, sizeof(uint32_t),
                                                      VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT);
    if (state && at.buffer)
        state->conditionalRendering = {VK_STRUCTURE_TYPE_CONDITIONAL_RENDERING_BEGIN_INFO_EXT, nullptr, at.buffer,
                                       at.offset, info->flags};
    device.next.CmdBeginConditionalRendering2EXT(commandBuffer, info);
}

} // namespace vellum::layer::validation
