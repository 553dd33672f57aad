// SPDX-License-Identifier: Apache-2.0
// Copies, fills and updates of buffers and address ranges, and the other commands that take address ranges.
#include "layer/validation/commands.h"
#include "layer/validation/ranges/ranges.h"

namespace vellum::layer::validation
{
namespace
{

// An indirect draw by address.
template <typename Info>
void draw(DeviceValidation &device, VkCommandBuffer commandBuffer, const Info *info, ranges::DrawKind kind,
          const char *command, void (VKAPI_PTR *DeviceTable::*next)(VkCommandBuffer, const Info *))
{
    const CheckedRanges checked(device, commandBuffer,
                                [&] { return ranges::checkDraw(device, commandBuffer, kind, *info); });
    runTracing(device.traces, commandBuffer, VK_PIPELINE_BIND_POINT_GRAPHICS, command);
    (device.next.*next)(commandBuffer, info);
}

} // namespace

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
    const CheckedRanges checked(device, commandBuffer, [&] { return ranges::checkCopy(device, commandBuffer, *info); });
    sync::recordCopy(device.sync, commandBuffer, *info);
    device.next.CmdCopyMemoryKHR(commandBuffer, info);
}

void cmdUpdateMemory(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkDeviceAddressRangeKHR *range,
                     VkAddressCommandFlagsKHR flags, VkDeviceSize size, const void *data)
{
    const CheckedRanges checked(device, commandBuffer,
                                [&] { return ranges::checkUpdate(device, commandBuffer, *range, flags, size); });
    sync::recordWrite(device.sync, commandBuffer, "vkCmdUpdateMemoryKHR", *range);
    device.next.CmdUpdateMemoryKHR(commandBuffer, range, flags, size, data);
}

void cmdFillMemory(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkDeviceAddressRangeKHR *range,
                   VkAddressCommandFlagsKHR flags, uint32_t data)
{
    const CheckedRanges checked(device, commandBuffer,
                                [&] { return ranges::checkFill(device, commandBuffer, *range, flags); });
    sync::recordWrite(device.sync, commandBuffer, "vkCmdFillMemoryKHR", *range);
    device.next.CmdFillMemoryKHR(commandBuffer, range, flags, data);
}

void cmdCopyQueryPoolResultsToMemory(DeviceValidation &device, VkCommandBuffer commandBuffer, VkQueryPool pool,
                                     uint32_t first, uint32_t count, const VkStridedDeviceAddressRangeKHR *range,
                                     VkAddressCommandFlagsKHR flags, VkQueryResultFlags results)
{
    const CheckedRanges checked(device, commandBuffer, [&] {
        return count == 0 || ranges::checkQueryResults(device, commandBuffer, count, *range, flags, results);
    });
    sync::recordUse(device.sync, commandBuffer, "vkCmdCopyQueryPoolResultsToMemoryKHR",
                    device.objects.queryPools.get(pool));
    device.next.CmdCopyQueryPoolResultsToMemoryKHR(commandBuffer, pool, first, count, range, flags, results);
}

void cmdWriteMarkerToMemory(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkMemoryMarkerInfoAMD *info)
{
    const CheckedRanges checked(device, commandBuffer,
                                [&] { return ranges::checkMarker(device, commandBuffer, *info); });
    device.next.CmdWriteMarkerToMemoryAMD(commandBuffer, info);
}

void cmdCopyMemoryToImage(DeviceValidation &device, VkCommandBuffer commandBuffer,
                          const VkCopyDeviceMemoryImageInfoKHR *info)
{
    const CheckedRanges checked(device, commandBuffer,
                                [&] { return ranges::checkCopyToImage(device, commandBuffer, *info); });
    device.next.CmdCopyMemoryToImageKHR(commandBuffer, info);
}

void cmdCopyImageToMemory(DeviceValidation &device, VkCommandBuffer commandBuffer,
                          const VkCopyDeviceMemoryImageInfoKHR *info)
{
    const CheckedRanges checked(device, commandBuffer,
                                [&] { return ranges::checkCopyFromImage(device, commandBuffer, *info); });
    device.next.CmdCopyImageToMemoryKHR(commandBuffer, info);
}

void cmdBindIndexBuffer3(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkBindIndexBuffer3InfoKHR *info)
{
    const CheckedRanges checked(device, commandBuffer,
                                [&] { return ranges::checkIndexBuffer(device, commandBuffer, *info); });
    device.next.CmdBindIndexBuffer3KHR(commandBuffer, info);
}

void cmdBindVertexBuffers3(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t first, uint32_t count,
                           const VkBindVertexBuffer3InfoKHR *infos)
{
    const CheckedRanges checked(device, commandBuffer,
                                [&] { return ranges::checkVertexBuffers(device, commandBuffer, first, count, infos); });
    device.next.CmdBindVertexBuffers3KHR(commandBuffer, first, count, infos);
}

void cmdDrawIndirect2(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkDrawIndirect2InfoKHR *info)
{
    draw(device, commandBuffer, info, ranges::DrawKind::Vertices, "vkCmdDrawIndirect2KHR",
         &DeviceTable::CmdDrawIndirect2KHR);
}

void cmdDrawIndexedIndirect2(DeviceValidation &device, VkCommandBuffer commandBuffer,
                             const VkDrawIndirect2InfoKHR *info)
{
    draw(device, commandBuffer, info, ranges::DrawKind::Indexed, "vkCmdDrawIndexedIndirect2KHR",
         &DeviceTable::CmdDrawIndexedIndirect2KHR);
}

void cmdDrawMeshTasksIndirect2(DeviceValidation &device, VkCommandBuffer commandBuffer,
                               const VkDrawIndirect2InfoKHR *info)
{
    draw(device, commandBuffer, info, ranges::DrawKind::MeshTasks, "vkCmdDrawMeshTasksIndirect2EXT",
         &DeviceTable::CmdDrawMeshTasksIndirect2EXT);
}

void cmdDrawIndirectCount2(DeviceValidation &device, VkCommandBuffer commandBuffer,
                           const VkDrawIndirectCount2InfoKHR *info)
{
    draw(device, commandBuffer, info, ranges::DrawKind::Vertices, "vkCmdDrawIndirectCount2KHR",
         &DeviceTable::CmdDrawIndirectCount2KHR);
}

void cmdDrawIndexedIndirectCount2(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                  const VkDrawIndirectCount2InfoKHR *info)
{
    draw(device, commandBuffer, info, ranges::DrawKind::Indexed, "vkCmdDrawIndexedIndirectCount2KHR",
         &DeviceTable::CmdDrawIndexedIndirectCount2KHR);
}

void cmdDrawMeshTasksIndirectCount2(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                    const VkDrawIndirectCount2InfoKHR *info)
{
    draw(device, commandBuffer, info, ranges::DrawKind::MeshTasks, "vkCmdDrawMeshTasksIndirectCount2EXT",
         &DeviceTable::CmdDrawMeshTasksIndirectCount2EXT);
}

void cmdDispatchIndirect2(DeviceValidation &device, VkCommandBuffer commandBuffer,
                          const VkDispatchIndirect2InfoKHR *info)
{
    const CheckedRanges checked(device, commandBuffer,
                                [&] { return ranges::checkDispatch(device, commandBuffer, *info); });
    runTracing(device.traces, commandBuffer, VK_PIPELINE_BIND_POINT_COMPUTE, "vkCmdDispatchIndirect2KHR");
    device.next.CmdDispatchIndirect2KHR(commandBuffer, info);
}

void cmdBeginConditionalRendering2(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                   const VkConditionalRenderingBeginInfo2EXT *info)
{
    const auto state = device.commands.states.get(commandBuffer);
    const CheckedRanges checked(device, commandBuffer, [&] {
        return ranges::checkCondition(device, commandBuffer, *info, state && state->conditionalRendering);
    });
    // Kept for injected work, and for the end of conditional rendering.
    const auto at = device.buffers.addresses.covering(info->addressRange.address, sizeof(uint32_t),
                                                      VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT);
    if (state && at.buffer)
        state->conditionalRendering = {VK_STRUCTURE_TYPE_CONDITIONAL_RENDERING_BEGIN_INFO_EXT, nullptr, at.buffer,
                                       at.offset, info->flags};
    device.next.CmdBeginConditionalRendering2EXT(commandBuffer, info);
}

void cmdBindTransformFeedbackBuffers2(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t first,
                                      uint32_t count, const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    const CheckedRanges checked(device, commandBuffer,
                                [&] { return ranges::checkFeedbackBuffers(device, commandBuffer, count, infos); });
    device.next.CmdBindTransformFeedbackBuffers2EXT(commandBuffer, first, count, infos);
}

void cmdBeginTransformFeedback2(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t first, uint32_t count,
                                const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    const CheckedRanges checked(device, commandBuffer,
                                [&] { return ranges::checkFeedbackBegin(device, commandBuffer, count, infos); });
    device.next.CmdBeginTransformFeedback2EXT(commandBuffer, first, count, infos);
}

void cmdEndTransformFeedback2(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t first, uint32_t count,
                              const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    const CheckedRanges checked(device, commandBuffer,
                                [&] { return ranges::checkFeedbackEnd(device, commandBuffer, count, infos); });
    device.next.CmdEndTransformFeedback2EXT(commandBuffer, first, count, infos);
}

void cmdDrawIndirectByteCount2(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t instanceCount,
                               uint32_t firstInstance, const VkBindTransformFeedbackBuffer2InfoEXT *info,
                               uint32_t counterOffset, uint32_t vertexStride)
{
    const CheckedRanges checked(device, commandBuffer,
                                [&] { return ranges::checkByteCount(device, commandBuffer, *info); });
    runTracing(device.traces, commandBuffer, VK_PIPELINE_BIND_POINT_GRAPHICS, "vkCmdDrawIndirectByteCount2EXT");
    device.next.CmdDrawIndirectByteCount2EXT(commandBuffer, instanceCount, firstInstance, info, counterOffset,
                                             vertexStride);
}

} // namespace vellum::layer::validation
