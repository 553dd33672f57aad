// SPDX-License-Identifier: Apache-2.0
#include "layer/command_buffer/command_state.h"

#include <algorithm>
#include <atomic>

#include "layer/base/commands.h"
#include "layer/base/pnext.h"
#include "layer/base/undo.h"
#include "layer/command_buffer/device_command_buffers.h"
#include "layer/memory/device_buffers.h"

namespace vellum::layer
{
namespace
{

bool covers(VkShaderStageFlags stages, uint32_t offset, uint32_t size, const CommandState::PushedConstants &earlier)
{
    return (earlier.stages & ~stages) == 0 && offset <= earlier.offset &&
           offset + size >= earlier.offset + earlier.bytes.size();
}

void rememberPush(CommandState &state, VkPipelineLayout layout, VkShaderStageFlags stages, uint32_t offset,
                  uint32_t size, const void *values)
{
    CommandState::PushedConstants push{layout, stages, offset, {}};
    // The usual push replaces an earlier one; its memory is reused.
    std::erase_if(state.pushes, [&](auto &earlier) {
        const bool gone = covers(stages, offset, size, earlier);
        if (gone && push.bytes.capacity() < earlier.bytes.capacity())
            std::swap(push.bytes, earlier.bytes);
        return gone;
    });
    const auto *const bytes = static_cast<const std::byte *>(values);
    push.bytes.assign(bytes, bytes + size);
    state.pushes.push_back(std::move(push));
}

// Gives back what the recorded commands used; with `all`, also memory for further ones.
void releaseCommands(CommandState &state, bool all)
{
    if (all)
        state.scratch.release();
    else
        state.scratch.reset();
    state.hitTables.reset();
    state.used.clear();
}

// Changed whenever a command buffer of this process is allocated or freed, which invalidates the last lookup of each
// thread.
std::atomic<uint64_t> changes{1};

struct LastState {
    const CommandStates *states = nullptr;
    VkCommandBuffer commandBuffer = VK_NULL_HANDLE;
    uint64_t changes = 0;
    CommandState *state = nullptr;
};
thread_local LastState lastStates[2]; // by user

} // namespace

void CommandStates::changed()
{
    changes.fetch_add(1, std::memory_order_relaxed);
}

void CommandStates::add(VkCommandBuffer commandBuffer, std::shared_ptr<CommandState> state)
{
    changed();
    {
        std::lock_guard lock(poolsMutex_);
        pools_[state->pool].insert(commandBuffer);
    }
    states_.set(commandBuffer, std::move(state));
}

void CommandStates::remove(VkCommandPool pool, VkCommandBuffer commandBuffer)
{
    changed();
    {
        std::lock_guard lock(poolsMutex_);
        if (const auto found = pools_.find(pool); found != pools_.end())
            found->second.erase(commandBuffer);
    }
    states_.take(commandBuffer);
}

void CommandStates::removePool(VkCommandPool pool)
{
    changed();
    std::unordered_set<VkCommandBuffer> buffers;
    {
        std::lock_guard lock(poolsMutex_);
        if (auto node = pools_.extract(pool))
            buffers = std::move(node.mapped());
    }
    for (const VkCommandBuffer commandBuffer : buffers)
        states_.take(commandBuffer);
}

void CommandStates::clear()
{
    while (!pools_.empty())
        removePool(pools_.begin()->first);
}

// The application orders freeing a command buffer before reusing its handle, so a thread that uses the new command
// buffer sees the changed count.
CommandState *CommandStates::get(VkCommandBuffer commandBuffer) const
{
    const uint64_t now = changes.load(std::memory_order_relaxed);
    LastState &last = lastStates[static_cast<size_t>(user_)];
    if (last.commandBuffer == commandBuffer && last.changes == now && last.states == this)
        return last.state;
    CommandState *const state = states_.get(commandBuffer).get();
    last = {this, commandBuffer, now, state};
    return state;
}

void CommandStates::keep(VkCommandBuffer commandBuffer, std::shared_ptr<const void> used) const
{
    if (CommandState *const state = get(commandBuffer); state && used)
        state->used.insert(std::move(used));
}

CommandState *CommandStates::setHeaps(VkCommandBuffer commandBuffer, bool heaps) const
{
    CommandState *const state = get(commandBuffer);
    if (state && state->heaps != heaps) {
        state->pushes.clear();
        state->heaps = heaps;
    }
    return state;
}

void CommandState::forgetBindings()
{
    computePipeline = VK_NULL_HANDLE;
    rayTracingPipeline = VK_NULL_HANDLE;
    computeShader.reset();
    pushes.clear();
}

VkResult allocateCommandBuffers(DeviceCommandBuffers &device, VkDevice handle, const VkCommandBufferAllocateInfo *info,
                                VkCommandBuffer *buffers)
{
    const VkResult result = device.driver.next.AllocateCommandBuffers(handle, info, buffers);
    if (result != VK_SUCCESS)
        return result;
    Undo undo([&] {
        freeCommandBuffers(device, handle, info->commandPool, info->commandBufferCount, buffers);
        std::fill_n(buffers, info->commandBufferCount, VK_NULL_HANDLE);
    });
    for (uint32_t i = 0; i < info->commandBufferCount; ++i) {
        auto state = device.states.makeState(device.buffers.scratch);
        state->pool = info->commandPool;
        state->secondary = info->level == VK_COMMAND_BUFFER_LEVEL_SECONDARY;
        device.states.add(buffers[i], std::move(state));
    }
    undo.keep();
    return result;
}

void freeCommandBuffers(DeviceCommandBuffers &device, VkDevice handle, VkCommandPool pool, uint32_t count,
                        const VkCommandBuffer *buffers)
{
    for (uint32_t i = 0; i < count; ++i)
        device.states.remove(pool, buffers[i]);
    device.driver.next.FreeCommandBuffers(handle, pool, count, buffers);
}

VkResult resetCommandBuffer(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer,
                            VkCommandBufferResetFlags flags)
{
    const VkResult result = device.driver.next.ResetCommandBuffer(commandBuffer, flags);
    const auto state = device.states.get(commandBuffer);
    if (result == VK_SUCCESS && state) // if it failed, there may still be commands
        releaseCommands(*state, (flags & VK_COMMAND_BUFFER_RESET_RELEASE_RESOURCES_BIT) != 0);
    return result;
}

VkResult resetCommandPool(DeviceCommandBuffers &device, VkDevice handle, VkCommandPool pool,
                          VkCommandPoolResetFlags flags)
{
    const VkResult result = device.driver.next.ResetCommandPool(handle, pool, flags);
    const bool all = (flags & VK_COMMAND_POOL_RESET_RELEASE_RESOURCES_BIT) != 0;
    if (result == VK_SUCCESS)
        device.states.forPool(pool, [all](CommandState &state) { releaseCommands(state, all); });
    return result;
}

void trimCommandPool(DeviceCommandBuffers &device, VkDevice handle, VkCommandPool pool, VkCommandPoolTrimFlags flags)
{
    device.buffers.scratch.trim();
    device.driver.next.TrimCommandPool(handle, pool, flags);
}

void destroyCommandPool(DeviceCommandBuffers &device, VkDevice handle, VkCommandPool pool,
                        const VkAllocationCallbacks *allocator)
{
    if (pool)
        device.states.removePool(pool);
    device.driver.next.DestroyCommandPool(handle, pool, allocator);
}

VkResult beginCommandBuffer(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer,
                            const VkCommandBufferBeginInfo *info)
{
    // A command buffer is implicitly reset when it is begun again.
    if (const auto state = device.states.get(commandBuffer)) {
        state->forgetBindings();
        releaseCommands(*state, false);
        state->conditionalRendering.reset();
        state->rejectedTransformFeedback = false;
        state->descriptorsWait = false;
        const bool shared = (info->flags & VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT) == 0;
        state->scratch.setShared(shared);
        state->hitTables.setShared(shared);
        // pInheritanceInfo is ignored for primary command buffers, and may be anything.
        const void *inherited = state->secondary && info->pInheritanceInfo ? info->pInheritanceInfo->pNext : nullptr;
        const auto *condition = findInChain<VkCommandBufferInheritanceConditionalRenderingInfoEXT>(
            inherited, VK_STRUCTURE_TYPE_COMMAND_BUFFER_INHERITANCE_CONDITIONAL_RENDERING_INFO_EXT);
        state->inheritsConditionalRendering = condition && condition->conditionalRenderingEnable;
        const auto *heaps = findInChain<VkCommandBufferInheritanceDescriptorHeapInfoEXT>(
            inherited, VK_STRUCTURE_TYPE_COMMAND_BUFFER_INHERITANCE_DESCRIPTOR_HEAP_INFO_EXT);
        state->heaps = device.driver.enabled.descriptorHeaps && heaps &&
                       (heaps->pSamplerHeapBindInfo || heaps->pResourceHeapBindInfo);
    }
    device.onBegin();
    return device.driver.next.BeginCommandBuffer(commandBuffer, info);
}

void cmdBindPipeline(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, VkPipelineBindPoint point,
                     VkPipeline pipeline)
{
    if (const auto state = device.states.get(commandBuffer); state && point == VK_PIPELINE_BIND_POINT_COMPUTE) {
        state->computePipeline = pipeline;
        state->computeShader.reset();
    } else if (state && point == VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR) {
        state->rayTracingPipeline = pipeline;
    }
    device.driver.next.CmdBindPipeline(commandBuffer, point, pipeline);
}

void cmdBindShaders(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, uint32_t count,
                    const VkShaderStageFlagBits *stages, const VkShaderEXT *shaders)
{
    if (const auto state = device.states.get(commandBuffer)) {
        for (uint32_t i = 0; i < count; ++i) {
            if (stages[i] != VK_SHADER_STAGE_COMPUTE_BIT)
                continue;
            state->computePipeline = VK_NULL_HANDLE;
            state->computeShader = shaders ? shaders[i] : nullptr;
        }
    }
    device.driver.next.CmdBindShadersEXT(commandBuffer, count, stages, shaders);
}

void cmdPushConstants(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, VkPipelineLayout layout,
                      VkShaderStageFlags stages, uint32_t offset, uint32_t size, const void *values)
{
    if (CommandState *const state = device.states.setHeaps(commandBuffer, false))
        rememberPush(*state, layout, stages, offset, size, values);
    device.driver.next.CmdPushConstants(commandBuffer, layout, stages, offset, size, values);
}

void cmdPushConstants2(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, const VkPushConstantsInfoKHR *info)
{
    // With a null layout the structure carries a VkPipelineLayoutCreateInfo, which cannot be kept for a later
    // vkCmdPushConstants. No known driver has both that feature (dynamicPipelineLayout of
    // VK_NV_per_stage_descriptor_set) and ray tracing.
    if (CommandState *const state = device.states.setHeaps(commandBuffer, false); state && info->layout)
        rememberPush(*state, info->layout, info->stageFlags, info->offset, info->size, info->pValues);
    device.driver.next.CmdPushConstants2KHR(commandBuffer, info);
}

void cmdPushData(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, const VkPushDataInfoEXT *info)
{
    if (CommandState *const state = device.states.setHeaps(commandBuffer, true))
        rememberPush(*state, VK_NULL_HANDLE, VK_SHADER_STAGE_ALL, info->offset, static_cast<uint32_t>(info->data.size),
                     info->data.address);
    device.driver.next.CmdPushDataEXT(commandBuffer, info);
}

void cmdBindDescriptorBuffers(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, uint32_t count,
                              const VkDescriptorBufferBindingInfoEXT *infos)
{
    device.states.setHeaps(commandBuffer, false);
    bindDescriptorBuffers(device.buffers, commandBuffer, count, infos);
}

void cmdExecuteCommands(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, uint32_t count,
                        const VkCommandBuffer *buffers)
{
    // All state of the primary is undefined after it, except heaps that every secondary inherited ("Secondary Command
    // Buffer Execution").
    if (const auto state = device.states.get(commandBuffer)) {
        state->forgetBindings();
        state->hitTables.forget();
    }
    device.driver.next.CmdExecuteCommands(commandBuffer, count, buffers);
}

void cmdBeginConditionalRendering(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer,
                                  const VkConditionalRenderingBeginInfoEXT *info)
{
    if (const auto state = device.states.get(commandBuffer)) {
        state->conditionalRendering = *info;
        state->conditionalRendering->pNext = nullptr;
    }
    device.driver.next.CmdBeginConditionalRenderingEXT(commandBuffer, info);
}

void cmdEndConditionalRendering(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer)
{
    if (const auto state = device.states.get(commandBuffer)) {
        // If none is active, vkCmdBeginConditionalRendering2EXT was rejected.
        if (!state->conditionalRendering)
            return;
        state->conditionalRendering.reset();
    }
    device.driver.next.CmdEndConditionalRenderingEXT(commandBuffer);
}

} // namespace vellum::layer
