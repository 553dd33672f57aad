// SPDX-License-Identifier: Apache-2.0
// Command pools and command buffers, what they bind, and what they order: barriers, events and render passes.
#include "layer/validation/commands.h"

namespace vellum::layer::validation
{
namespace
{

void setRendering(DeviceValidation &device, VkCommandBuffer commandBuffer, bool isRendering)
{
    if (const auto log = device.logs.get(commandBuffer))
        log->isRendering = isRendering;
}

void endRendering(DeviceValidation &device, VkCommandBuffer commandBuffer)
{
    setRendering(device, commandBuffer, false);
    if (const auto log = device.logs.get(commandBuffer))
        log->isSuspended = log->suspends;
}

} // namespace

VkResult createCommandPool(DeviceValidation &device, VkDevice handle, const VkCommandPoolCreateInfo *info,
                           const VkAllocationCallbacks *allocator, VkCommandPool *pool)
{
    const VkResult result = device.next.CreateCommandPool(handle, info, allocator, pool);
    if (result == VK_SUCCESS)
        remember(device.objects, [&] {
            const bool isProtected = (info->flags & VK_COMMAND_POOL_CREATE_PROTECTED_BIT) != 0;
            device.objects.commandPools.set(*pool, {info->queueFamilyIndex, isProtected});
        });
    return result;
}

void destroyCommandPool(DeviceValidation &device, VkDevice handle, VkCommandPool pool,
                        const VkAllocationCallbacks *allocator)
{
    device.objects.commandPools.take(pool);
    layer::destroyCommandPool(device.commands, handle, pool, allocator);
}

VkResult resetCommandPool(DeviceValidation &device, VkDevice handle, VkCommandPool pool, VkCommandPoolResetFlags flags)
{
    const VkResult result = layer::resetCommandPool(device.commands, handle, pool, flags);
    if (result == VK_SUCCESS)
        device.logs.resetPool(pool);
    return result;
}

VkResult allocateCommandBuffers(DeviceValidation &device, VkDevice handle, const VkCommandBufferAllocateInfo *info,
                                VkCommandBuffer *buffers)
{
    const VkResult result = layer::allocateCommandBuffers(device.commands, handle, info, buffers);
    const ValidatedCommandPool pool = device.objects.commandPools.get(info->commandPool);
    for (uint32_t i = 0; result == VK_SUCCESS && i < info->commandBufferCount; ++i) {
        CommandLog &log = *device.logs.get(buffers[i]);
        log.family = pool.family;
        log.isProtected = pool.isProtected;
    }
    return result;
}

void freeCommandBuffers(DeviceValidation &device, VkDevice handle, VkCommandPool pool, uint32_t count,
                        const VkCommandBuffer *buffers)
{
    layer::freeCommandBuffers(device.commands, handle, pool, count, buffers);
}

VkResult beginCommandBuffer(DeviceValidation &device, VkCommandBuffer commandBuffer,
                            const VkCommandBufferBeginInfo *info)
{
    const VkResult result = layer::beginCommandBuffer(device.commands, commandBuffer, info);
    const auto log = result == VK_SUCCESS ? device.logs.get(commandBuffer) : nullptr;
    if (log) { // it is reset implicitly
        log->reset();
        log->isRecording = true;
        log->isRendering = log->secondary && (info->flags & VK_COMMAND_BUFFER_USAGE_RENDER_PASS_CONTINUE_BIT) != 0;
    }
    return result;
}

VkResult endCommandBuffer(DeviceValidation &device, VkCommandBuffer commandBuffer)
{
    if (const auto log = device.logs.get(commandBuffer))
        log->isRecording = false;
    return device.next.EndCommandBuffer(commandBuffer);
}

VkResult resetCommandBuffer(DeviceValidation &device, VkCommandBuffer commandBuffer, VkCommandBufferResetFlags flags)
{
    const VkResult result = layer::resetCommandBuffer(device.commands, commandBuffer, flags);
    const auto log = result == VK_SUCCESS ? device.logs.get(commandBuffer) : nullptr;
    if (log)
        log->reset();
    return result;
}

void cmdBindPipeline(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineBindPoint point,
                     VkPipeline pipeline)
{
    bindTracingPipeline(device.traces, commandBuffer, point, pipeline);
    layer::cmdBindPipeline(device.commands, commandBuffer, point, pipeline);
}

void cmdBindShaders(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                    const VkShaderStageFlagBits *stages, const VkShaderEXT *shaders)
{
    bindTracingShaders(device.traces, commandBuffer, count, stages, shaders);
    layer::cmdBindShaders(device.commands, commandBuffer, count, stages, shaders);
}

void cmdExecuteCommands(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                        const VkCommandBuffer *buffers)
{
    for (uint32_t i = 0; i < count; ++i) {
        const CommandLog *log = device.logs.get(buffers[i]);
        if (!log)
            continue;
        const auto include = [steps = log->steps](auto which) {
            return [steps, which](const Submission &submission) { steps->run(submission, which); };
        };
        device.logs.addCheck(commandBuffer, include(&CommandLog::Steps::checks));
        device.logs.add(commandBuffer, include(&CommandLog::Steps::effects));
    }
    if (const auto log = device.logs.get(commandBuffer))
        log->isSuspended = false; // they may have resumed the render pass instance
    layer::cmdExecuteCommands(device.commands, commandBuffer, count, buffers);
}

void cmdPipelineBarrier(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineStageFlags from,
                        VkPipelineStageFlags to, VkDependencyFlags flags, uint32_t memoryCount,
                        const VkMemoryBarrier *memory, uint32_t bufferCount, const VkBufferMemoryBarrier *buffers,
                        uint32_t imageCount, const VkImageMemoryBarrier *images)
{
    sync::recordBarriers(device.sync, commandBuffer,
                         sync::PipelineBarrier{from, to, memoryCount, memory, bufferCount, buffers});
    device.next.CmdPipelineBarrier(commandBuffer, from, to, flags, memoryCount, memory, bufferCount, buffers,
                                   imageCount, images);
}

void cmdBeginRenderPass(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkRenderPassBeginInfo *info,
                        VkSubpassContents contents)
{
    sync::recordAll(device.sync, commandBuffer);
    setRendering(device, commandBuffer, true);
    device.next.CmdBeginRenderPass(commandBuffer, info, contents);
}

void cmdBeginRenderPass2(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkRenderPassBeginInfo *info,
                         const VkSubpassBeginInfo *subpass)
{
    sync::recordAll(device.sync, commandBuffer);
    setRendering(device, commandBuffer, true);
    device.next.CmdBeginRenderPass2(commandBuffer, info, subpass);
}

void cmdEndRenderPass(DeviceValidation &device, VkCommandBuffer commandBuffer)
{
    sync::recordAll(device.sync, commandBuffer);
    setRendering(device, commandBuffer, false);
    device.next.CmdEndRenderPass(commandBuffer);
}

void cmdEndRenderPass2(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkSubpassEndInfo *info)
{
    sync::recordAll(device.sync, commandBuffer);
    setRendering(device, commandBuffer, false);
    device.next.CmdEndRenderPass2(commandBuffer, info);
}

void cmdBeginRendering(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkRenderingInfo *info)
{
    setRendering(device, commandBuffer, true);
    if (const auto log = device.logs.get(commandBuffer)) {
        log->suspends = (info->flags & VK_RENDERING_SUSPENDING_BIT) != 0;
        log->isSuspended = false;
    }
    device.next.CmdBeginRendering(commandBuffer, info);
}

void cmdEndRendering(DeviceValidation &device, VkCommandBuffer commandBuffer)
{
    endRendering(device, commandBuffer);
    device.next.CmdEndRendering(commandBuffer);
}

void cmdEndRendering2(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkRenderingEndInfoKHR *info)
{
    endRendering(device, commandBuffer);
    device.next.CmdEndRendering2KHR(commandBuffer, info);
}

void cmdSetEvent(DeviceValidation &device, VkCommandBuffer commandBuffer, VkEvent event, VkPipelineStageFlags stages)
{
    sync::recordSet(device.sync, commandBuffer, event);
    device.next.CmdSetEvent(commandBuffer, event, stages);
}

void cmdResetEvent(DeviceValidation &device, VkCommandBuffer commandBuffer, VkEvent event, VkPipelineStageFlags stages)
{
    sync::recordReset(device.sync, commandBuffer, event);
    device.next.CmdResetEvent(commandBuffer, event, stages);
}

void cmdWaitEvents(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count, const VkEvent *events,
                   VkPipelineStageFlags from, VkPipelineStageFlags to, uint32_t memoryCount,
                   const VkMemoryBarrier *memory, uint32_t bufferCount, const VkBufferMemoryBarrier *buffers,
                   uint32_t imageCount, const VkImageMemoryBarrier *images)
{
    sync::recordWait(device.sync, commandBuffer, count, events,
                     sync::PipelineBarrier{from, to, memoryCount, memory, bufferCount, buffers});
    device.next.CmdWaitEvents(commandBuffer, count, events, from, to, memoryCount, memory, bufferCount, buffers,
                              imageCount, images);
}

void cmdPipelineBarrier2(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkDependencyInfo *info)
{
    const CheckedRanges checked(device, commandBuffer, "vkCmdPipelineBarrier2", [&](const RangeCheck &ranges) {
        ranges::checkDependency(ranges, ranges.command().member("pDependencyInfo"), *info);
    });
    sync::recordBarriers(device.sync, commandBuffer, *info);
    device.next.CmdPipelineBarrier2(commandBuffer, info);
}

void cmdSetEvent2(DeviceValidation &device, VkCommandBuffer commandBuffer, VkEvent event, const VkDependencyInfo *info)
{
    const CheckedRanges checked(device, commandBuffer, "vkCmdSetEvent2", [&](const RangeCheck &ranges) {
        ranges::checkDependency(ranges, ranges.command().member("pDependencyInfo"), *info);
    });
    sync::recordSet(device.sync, commandBuffer, event);
    device.next.CmdSetEvent2(commandBuffer, event, info);
}

void cmdWaitEvents2(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count, const VkEvent *events,
                    const VkDependencyInfo *infos)
{
    const CheckedRanges checked(device, commandBuffer, "vkCmdWaitEvents2", [&](const RangeCheck &ranges) {
        for (uint32_t i = 0; i < count; ++i)
            ranges::checkDependency(ranges, ranges.command().element("pDependencyInfos", i), infos[i]);
    });
    sync::recordWait(device.sync, commandBuffer, count, events, infos);
    device.next.CmdWaitEvents2(commandBuffer, count, events, infos);
}

void cmdResetEvent2(DeviceValidation &device, VkCommandBuffer commandBuffer, VkEvent event,
                    VkPipelineStageFlags2 stages)
{
    const Place command("vkCmdResetEvent2");
    if (device.checks.core)
        ranges::checkStage(device, command.member("stageMask"), stages, "VUID-vkCmdResetEvent2-stageMask-11541",
                           commandBuffer);
    sync::recordReset(device.sync, commandBuffer, event);
    device.next.CmdResetEvent2(commandBuffer, event, stages);
}

void cmdWriteTimestamp2(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineStageFlags2 stage,
                        VkQueryPool pool, uint32_t query)
{
    const Place command("vkCmdWriteTimestamp2");
    if (device.checks.core)
        ranges::checkStage(device, command.member("stage"), stage, "VUID-vkCmdWriteTimestamp2-stage-11541",
                           commandBuffer);
    device.next.CmdWriteTimestamp2(commandBuffer, stage, pool, query);
}

void cmdWriteBufferMarker2(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineStageFlags2 stage,
                           VkBuffer buffer, VkDeviceSize offset, uint32_t marker)
{
    const Place command("vkCmdWriteBufferMarker2AMD");
    if (device.checks.core)
        ranges::checkStage(device, command.member("stage"), stage, "VUID-vkCmdWriteBufferMarker2AMD-stage-11541",
                           commandBuffer);
    device.next.CmdWriteBufferMarker2AMD(commandBuffer, stage, buffer, offset, marker);
}

} // namespace vellum::layer::validation
