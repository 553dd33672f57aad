// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/command_log.h"

#include <algorithm>

#include "layer/validation/device_validation.h"
#include "layer/validation/ranges/ranges.h"
#include "layer/validation/sync/sync_commands.h"
#include "layer/validation/traces/trace_commands.h"

namespace vellum::layer
{

// What only the commands of this file may do with the logs.
struct CommandLogAccess {
    static void add(CommandLogs &logs, VkCommandBuffer commandBuffer, std::shared_ptr<CommandLog> log)
    {
        const std::lock_guard lock(logs.mutex_);
        logs.pools_[log->pool].insert(commandBuffer);
        logs.logs_.set(commandBuffer, std::move(log));
    }
    static void remove(CommandLogs &logs, VkCommandPool pool, uint32_t count, const VkCommandBuffer *commandBuffers)
    {
        const std::lock_guard lock(logs.mutex_);
        const auto known = logs.pools_.find(pool);
        for (uint32_t i = 0; i < count; ++i) {
            logs.logs_.take(commandBuffers[i]);
            if (known != logs.pools_.end())
                known->second.erase(commandBuffers[i]);
        }
    }
    static void removePool(CommandLogs &logs, VkCommandPool pool)
    {
        const std::lock_guard lock(logs.mutex_);
        const auto known = logs.pools_.find(pool);
        if (known == logs.pools_.end())
            return;
        for (const VkCommandBuffer commandBuffer : known->second)
            logs.logs_.take(commandBuffer);
        logs.pools_.erase(known);
    }
    static void reset(CommandLog &log)
    {
        log.steps.clear();
        log.traces = {};
        log.isRecording = log.isRendering = log.suspends = log.isSuspended = false;
    }
    static void resetPool(CommandLogs &logs, VkCommandPool pool)
    {
        const std::lock_guard lock(logs.mutex_);
        if (const auto known = logs.pools_.find(pool); known != logs.pools_.end())
            for (const VkCommandBuffer commandBuffer : known->second)
                if (const auto log = logs.get(commandBuffer))
                    reset(*log);
    }
};

void CommandLogs::add(VkCommandBuffer commandBuffer, CommandLog::Step step)
{
    if (!commandBuffer) {
        const HeldMessages held;
        const std::lock_guard lock(submissions);
        step({});
    } else if (const auto log = get(commandBuffer)) {
        log->steps.push_back(std::move(step));
    }
}

namespace validation
{
namespace
{

// Whether a timeline semaphore is to reach a value that neither the host nor an earlier submission signals.
bool isLater(DeviceValidation &device, uint64_t semaphore, uint64_t value)
{
    const auto signaled = device.logs.signals.find(semaphore);
    if (signaled != device.logs.signals.end() && signaled->second >= value)
        return false;
    uint64_t reached = 0;
    return device.next.GetSemaphoreCounterValue(device.driver.handle, reinterpret_cast<VkSemaphore>(semaphore),
                                                &reached) != VK_SUCCESS ||
           reached < value;
}

void execute(DeviceValidation &device, VkQueue queue, VkCommandBuffer commandBuffer)
{
    const auto log = device.logs.get(commandBuffer);
    if (!log)
        return;
    auto &waits = device.logs.waits[queue];
    std::erase_if(waits, [&](const auto &wait) { return !isLater(device, wait.first, wait.second); });
    const Submission submission{queue, device.objects.queueFamilies.get(queue), waits.empty()};
    for (const CommandLog::Step &step : log->steps)
        step(submission);
}

// `commandBuffers`: gives the command buffer of a number.
template <typename Submit, typename CommandBuffers>
void executeBatch(DeviceValidation &device, VkQueue queue, const Submit &batch, uint32_t count,
                  CommandBuffers commandBuffers)
{
    const std::vector<sync::SemaphoreUse> waits = sync::waitsOf(device, batch);
    for (const sync::SemaphoreUse &use : waits) {
        if (use.value && isLater(device, use.semaphore, *use.value))
            device.logs.waits[queue].emplace_back(use.semaphore, *use.value);
    }
    sync::beginBatch(device, queue, waits);
    for (uint32_t c = 0; c < count; ++c)
        execute(device, queue, commandBuffers(c));
    const std::vector<sync::SemaphoreUse> signals = sync::signalsOf(device, batch);
    sync::endBatch(device, queue, signals);
    for (const sync::SemaphoreUse &use : signals) {
        if (use.value)
            device.logs.signals[use.semaphore] = *use.value;
    }
}

// Submits work by `next()`. Nothing of it was executed if that fails.
template <typename Next, typename Execute>
VkResult submit(DeviceValidation &device, VkQueue queue, VkFence fence, Next next, Execute execute)
{
    device.gpu.log.drain(device);
    const HeldMessages held;
    const std::lock_guard lock(device.logs.submissions);
    const VkResult result = next();
    if (result != VK_SUCCESS)
        return result;
    remember([&] {
        execute();
        sync::signalFence(device, queue, fence);
    });
    return result;
}

} // namespace

VkResult createCommandPool(DeviceValidation &device, VkDevice handle, const VkCommandPoolCreateInfo *info,
                           const VkAllocationCallbacks *allocator, VkCommandPool *pool)
{
    const VkResult result = device.next.CreateCommandPool(handle, info, allocator, pool);
    if (result == VK_SUCCESS)
        remember([&] {
            device.objects.poolFamilies.set(*pool, info->queueFamilyIndex);
            if ((info->flags & VK_COMMAND_POOL_CREATE_PROTECTED_BIT) != 0)
                device.objects.protectedPools.set(*pool, true);
        });
    return result;
}

void destroyCommandPool(DeviceValidation &device, VkDevice handle, VkCommandPool pool,
                        const VkAllocationCallbacks *allocator)
{
    CommandLogAccess::removePool(device.logs, pool);
    device.objects.poolFamilies.take(pool);
    device.objects.protectedPools.take(pool);
    layer::destroyCommandPool(device.commands, handle, pool, allocator);
}

VkResult resetCommandPool(DeviceValidation &device, VkDevice handle, VkCommandPool pool, VkCommandPoolResetFlags flags)
{
    const VkResult result = layer::resetCommandPool(device.commands, handle, pool, flags);
    if (result == VK_SUCCESS)
        CommandLogAccess::resetPool(device.logs, pool);
    return result;
}

VkResult allocateCommandBuffers(DeviceValidation &device, VkDevice handle, const VkCommandBufferAllocateInfo *info,
                                VkCommandBuffer *buffers)
{
    const VkResult result = layer::allocateCommandBuffers(device.commands, handle, info, buffers);
    for (uint32_t i = 0; result == VK_SUCCESS && i < info->commandBufferCount; ++i)
        remember([&] {
            auto log = std::make_shared<CommandLog>();
            log->pool = info->commandPool;
            log->family = device.objects.poolFamilies.get(info->commandPool);
            log->secondary = info->level == VK_COMMAND_BUFFER_LEVEL_SECONDARY;
            CommandLogAccess::add(device.logs, buffers[i], std::move(log));
        });
    return result;
}

void freeCommandBuffers(DeviceValidation &device, VkDevice handle, VkCommandPool pool, uint32_t count,
                        const VkCommandBuffer *buffers)
{
    CommandLogAccess::remove(device.logs, pool, count, buffers);
    layer::freeCommandBuffers(device.commands, handle, pool, count, buffers);
}

VkResult beginCommandBuffer(DeviceValidation &device, VkCommandBuffer commandBuffer,
                            const VkCommandBufferBeginInfo *info)
{
    const VkResult result = layer::beginCommandBuffer(device.commands, commandBuffer, info);
    const auto log = result == VK_SUCCESS ? device.logs.get(commandBuffer) : nullptr;
    if (log) { // it is reset implicitly
        CommandLogAccess::reset(*log);
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
        CommandLogAccess::reset(*log);
    return result;
}

void cmdBindPipeline(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineBindPoint point,
                     VkPipeline pipeline)
{
    bindTracingPipeline(device, commandBuffer, point, pipeline);
    layer::cmdBindPipeline(device.commands, commandBuffer, point, pipeline);
}

void cmdBindShaders(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                    const VkShaderStageFlagBits *stages, const VkShaderEXT *shaders)
{
    bindTracingShaders(device, commandBuffer, count, stages, shaders);
    layer::cmdBindShaders(device.commands, commandBuffer, count, stages, shaders);
}

void cmdPushConstants(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineLayout layout,
                      VkShaderStageFlags stages, uint32_t offset, uint32_t size, const void *values)
{
    layer::cmdPushConstants(device.commands, commandBuffer, layout, stages, offset, size, values);
}

void cmdPushConstants2(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkPushConstantsInfoKHR *info)
{
    layer::cmdPushConstants2(device.commands, commandBuffer, info);
}

void cmdExecuteCommands(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                        const VkCommandBuffer *buffers)
{
    for (uint32_t i = 0; i < count; ++i) {
        device.logs.add(commandBuffer, [log = device.logs.get(buffers[i])](const Submission &submission) {
            for (size_t s = 0; log && s < log->steps.size(); ++s)
                log->steps[s](submission);
        });
    }
    if (const auto log = device.logs.get(commandBuffer))
        log->isSuspended = false; // they may have resumed the render pass instance
    layer::cmdExecuteCommands(device.commands, commandBuffer, count, buffers);
}

void cmdBeginConditionalRendering(DeviceValidation &device, VkCommandBuffer commandBuffer,
                                  const VkConditionalRenderingBeginInfoEXT *info)
{
    layer::cmdBeginConditionalRendering(device.commands, commandBuffer, info);
}

void cmdEndConditionalRendering(DeviceValidation &device, VkCommandBuffer commandBuffer)
{
    layer::cmdEndConditionalRendering(device.commands, commandBuffer);
}

VkResult queueSubmit(DeviceValidation &device, VkQueue queue, uint32_t count, const VkSubmitInfo *submits,
                     VkFence fence)
{
    return submit(
        device, queue, fence, [&] { return device.next.QueueSubmit(queue, count, submits, fence); },
        [&] {
            for (uint32_t i = 0; i < count; ++i)
                executeBatch(device, queue, submits[i], submits[i].commandBufferCount,
                             [&](uint32_t c) { return submits[i].pCommandBuffers[c]; });
        });
}

VkResult queueSubmit2(DeviceValidation &device, VkQueue queue, uint32_t count, const VkSubmitInfo2 *submits,
                      VkFence fence)
{
    const Place command("vkQueueSubmit2");
    for (uint32_t i = 0; i < count && device.checks.core; ++i)
        checkSubmission(device, command.element("pSubmits", i), submits[i]);
    return submit(
        device, queue, fence, [&] { return device.next.QueueSubmit2(queue, count, submits, fence); },
        [&] {
            for (uint32_t i = 0; i < count; ++i)
                executeBatch(device, queue, submits[i], submits[i].commandBufferInfoCount,
                             [&](uint32_t c) { return submits[i].pCommandBufferInfos[c].commandBuffer; });
        });
}

} // namespace validation
} // namespace vellum::layer
