// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/command_log.h"

#include <algorithm>

#include "layer/base/pnext.h"
#include "layer/validation/device_validation.h"
#include "layer/validation/ranges/ranges.h"
#include "layer/validation/sync/sync_commands.h"
#include "layer/validation/traces/trace_commands.h"

namespace vellum::layer
{

// What only the commands of this file may do with the logs.
struct CommandLogAccess {
    static void set(CommandLogs &logs, VkCommandBuffer commandBuffer, std::shared_ptr<CommandLog> log)
    {
        std::lock_guard lock(logs.mutex_);
        logs.logs_[commandBuffer] = std::move(log);
    }
    template <typename Predicate>
    static void remove(CommandLogs &logs, Predicate predicate)
    {
        std::lock_guard lock(logs.mutex_);
        std::erase_if(logs.logs_, predicate);
    }
    static void clearPool(CommandLogs &logs, VkCommandPool pool)
    {
        std::lock_guard lock(logs.mutex_);
        for (auto &[handle, log] : logs.logs_) {
            if (log->pool == pool)
                log->steps.clear();
        }
    }
};

std::shared_ptr<CommandLog> CommandLogs::get(VkCommandBuffer commandBuffer)
{
    std::lock_guard lock(mutex_);
    const auto found = logs_.find(commandBuffer);
    return found == logs_.end() ? nullptr : found->second;
}

void CommandLogs::add(VkCommandBuffer commandBuffer, CommandLog::Step step)
{
    if (const auto log = get(commandBuffer))
        log->steps.push_back(std::move(step));
}

namespace validation
{
namespace
{

// Whether the value is one that the host and earlier submissions do not signal.
bool isLater(DeviceValidation &device, VkSemaphore semaphore, uint64_t value)
{
    const auto signaled = device.logs.signals.find(semaphore);
    if (signaled != device.logs.signals.end() && signaled->second >= value)
        return false;
    uint64_t reached = 0;
    return device.next.GetSemaphoreCounterValue(device.driver.handle, semaphore, &reached) != VK_SUCCESS ||
           reached < value;
}

void wait(DeviceValidation &device, VkQueue queue, VkSemaphore semaphore, uint64_t value)
{
    const std::lock_guard lock(device.logs.submissions);
    if (device.sync.timelines.get(semaphore) && isLater(device, semaphore, value))
        device.logs.waits[queue].emplace_back(semaphore, value);
}

void signal(DeviceValidation &device, VkSemaphore semaphore, uint64_t value)
{
    const std::lock_guard lock(device.logs.submissions);
    if (device.sync.timelines.get(semaphore))
        device.logs.signals[semaphore] = value;
}

const VkTimelineSemaphoreSubmitInfo &valuesOf(const VkSubmitInfo &submit)
{
    static constexpr VkTimelineSemaphoreSubmitInfo kNone{};
    const auto *values =
        findInChain<VkTimelineSemaphoreSubmitInfo>(submit.pNext, VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO);
    return values ? *values : kNone;
}

void submit(DeviceValidation &device, VkQueue queue, VkCommandBuffer commandBuffer)
{
    const auto log = device.logs.get(commandBuffer);
    if (!log)
        return;
    std::lock_guard lock(device.logs.submissions);
    auto &waits = device.logs.waits[queue];
    std::erase_if(waits, [&](const auto &wait) { return !isLater(device, wait.first, wait.second); });
    const Submission submission{queue, device.objects.queueFamilies.get(queue), waits.empty()};
    for (const CommandLog::Step &step : log->steps)
        step(submission);
}

} // namespace

VkResult createCommandPool(DeviceValidation &device, VkDevice handle, const VkCommandPoolCreateInfo *info,
                           const VkAllocationCallbacks *allocator, VkCommandPool *pool)
{
    const VkResult result = device.next.CreateCommandPool(handle, info, allocator, pool);
    if (result == VK_SUCCESS)
        device.objects.poolFamilies.set(*pool, info->queueFamilyIndex);
    if (result == VK_SUCCESS && (info->flags & VK_COMMAND_POOL_CREATE_PROTECTED_BIT) != 0)
        device.objects.protectedPools.set(*pool, true);
    return result;
}

void destroyCommandPool(DeviceValidation &device, VkDevice handle, VkCommandPool pool,
                        const VkAllocationCallbacks *allocator)
{
    CommandLogAccess::remove(device.logs, [pool](const auto &entry) { return entry.second->pool == pool; });
    device.objects.poolFamilies.take(pool);
    device.objects.protectedPools.take(pool);
    layer::destroyCommandPool(device.commands, handle, pool, allocator);
}

VkResult resetCommandPool(DeviceValidation &device, VkDevice handle, VkCommandPool pool, VkCommandPoolResetFlags flags)
{
    CommandLogAccess::clearPool(device.logs, pool);
    return device.next.ResetCommandPool(handle, pool, flags);
}

VkResult allocateCommandBuffers(DeviceValidation &device, VkDevice handle, const VkCommandBufferAllocateInfo *info,
                                VkCommandBuffer *buffers)
{
    const VkResult result = layer::allocateCommandBuffers(device.commands, handle, info, buffers);
    for (uint32_t i = 0; result == VK_SUCCESS && i < info->commandBufferCount; ++i) {
        auto log = std::make_shared<CommandLog>();
        log->pool = info->commandPool;
        log->family = device.objects.poolFamilies.get(info->commandPool);
        log->secondary = info->level == VK_COMMAND_BUFFER_LEVEL_SECONDARY;
        CommandLogAccess::set(device.logs, buffers[i], std::move(log));
    }
    return result;
}

void freeCommandBuffers(DeviceValidation &device, VkDevice handle, VkCommandPool pool, uint32_t count,
                        const VkCommandBuffer *buffers)
{
    for (uint32_t i = 0; i < count; ++i)
        CommandLogAccess::remove(device.logs, [&](const auto &entry) { return entry.first == buffers[i]; });
    layer::freeCommandBuffers(device.commands, handle, pool, count, buffers);
}

VkResult beginCommandBuffer(DeviceValidation &device, VkCommandBuffer commandBuffer,
                            const VkCommandBufferBeginInfo *info)
{
    if (const auto log = device.logs.get(commandBuffer)) { // it is reset implicitly
        log->steps.clear();
        log->traces = {};
    }
    return layer::beginCommandBuffer(device.commands, commandBuffer, info);
}

VkResult resetCommandBuffer(DeviceValidation &device, VkCommandBuffer commandBuffer, VkCommandBufferResetFlags flags)
{
    if (const auto log = device.logs.get(commandBuffer))
        log->steps.clear();
    return device.next.ResetCommandBuffer(commandBuffer, flags);
}

void cmdBindPipeline(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineBindPoint point,
                     VkPipeline pipeline)
{
    bindTracingPipeline(device, commandBuffer, point, pipeline);
    layer::cmdBindPipeline(device.commands, commandBuffer, point, pipeline);
}

void cmdBindShaders(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count,
                    const VkShaderStageFlagBits *stages, const newer::ShaderEXT *shaders)
{
    bindTracingShaders(device, commandBuffer, count, stages, shaders);
    layer::cmdBindShaders(device.commands, commandBuffer, count, stages, shaders);
}

void cmdPushConstants(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineLayout layout,
                      VkShaderStageFlags stages, uint32_t offset, uint32_t size, const void *values)
{
    layer::cmdPushConstants(device.commands, commandBuffer, layout, stages, offset, size, values);
}

void cmdPushConstants2(DeviceValidation &device, VkCommandBuffer commandBuffer, const newer::PushConstantsInfo *info)
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
    device.gpu.log.drain(device);
    for (uint32_t i = 0; i < count; ++i) {
        const VkTimelineSemaphoreSubmitInfo &values = valuesOf(submits[i]);
        for (uint32_t s = 0; s < std::min(submits[i].waitSemaphoreCount, values.waitSemaphoreValueCount); ++s)
            wait(device, queue, submits[i].pWaitSemaphores[s], values.pWaitSemaphoreValues[s]);
        sync::beginBatch(device, queue, submits[i]);
        for (uint32_t c = 0; c < submits[i].commandBufferCount; ++c)
            submit(device, queue, submits[i].pCommandBuffers[c]);
        sync::endBatch(device, queue, submits[i]);
        for (uint32_t s = 0; s < std::min(submits[i].signalSemaphoreCount, values.signalSemaphoreValueCount); ++s)
            signal(device, submits[i].pSignalSemaphores[s], values.pSignalSemaphoreValues[s]);
    }
    sync::signalFence(device, queue, fence);
    return device.next.QueueSubmit(queue, count, submits, fence);
}

VkResult queueSubmit2(DeviceValidation &device, VkQueue queue, uint32_t count, const VkSubmitInfo2 *submits,
                      VkFence fence)
{
    const Place command("vkQueueSubmit2");
    device.gpu.log.drain(device);
    for (uint32_t i = 0; i < count; ++i) {
        if (device.checks.core)
            checkSubmission(device, command.element("pSubmits", i), submits[i]);
        for (uint32_t s = 0; s < submits[i].waitSemaphoreInfoCount; ++s)
            wait(device, queue, submits[i].pWaitSemaphoreInfos[s].semaphore, submits[i].pWaitSemaphoreInfos[s].value);
        sync::beginBatch(device, queue, submits[i]);
        for (uint32_t c = 0; c < submits[i].commandBufferInfoCount; ++c)
            submit(device, queue, submits[i].pCommandBufferInfos[c].commandBuffer);
        sync::endBatch(device, queue, submits[i]);
        for (uint32_t s = 0; s < submits[i].signalSemaphoreInfoCount; ++s)
            signal(device, submits[i].pSignalSemaphoreInfos[s].semaphore, submits[i].pSignalSemaphoreInfos[s].value);
    }
    sync::signalFence(device, queue, fence);
    return device.next.QueueSubmit2(queue, count, submits, fence);
}

} // namespace validation
} // namespace vellum::layer
