#include "layer/commands/command_state.h"

#include <cstring>

#include "layer/commands/device_commands.h"
#include "layer/ground/pnext.h"

namespace vellum::layer
{
namespace
{

bool covers(const CommandState::PushedConstants &later, const CommandState::PushedConstants &earlier)
{
    return (earlier.stages & ~later.stages) == 0 && later.offset <= earlier.offset &&
           later.offset + later.bytes.size() >= earlier.offset + earlier.bytes.size();
}

void rememberPush(CommandState &state, VkPipelineLayout layout, VkShaderStageFlags stages, uint32_t offset,
                  uint32_t size, const void *values)
{
    CommandState::PushedConstants push{layout, stages, offset, std::vector<std::byte>(size)};
    std::memcpy(push.bytes.data(), values, size);
    std::erase_if(state.pushes, [&push](const auto &earlier) { return covers(push, earlier); });
    state.pushes.push_back(std::move(push));
}

} // namespace

void CommandState::forgetBindings()
{
    computePipeline = VK_NULL_HANDLE;
    rayTracingPipeline = VK_NULL_HANDLE;
    computeShader.reset();
    pushes.clear();
}

VkResult allocateCommandBuffers(DeviceCommands &device, VkDevice handle, const VkCommandBufferAllocateInfo *info,
                                VkCommandBuffer *buffers)
{
    const VkResult result = device.driver.next.AllocateCommandBuffers(handle, info, buffers);
    for (uint32_t i = 0; result == VK_SUCCESS && i < info->commandBufferCount; ++i) {
        auto state = std::make_shared<CommandState>();
        state->pool = info->commandPool;
        state->secondary = info->level == VK_COMMAND_BUFFER_LEVEL_SECONDARY;
        device.states.set(buffers[i], std::move(state));
    }
    return result;
}

void freeCommandBuffers(DeviceCommands &device, VkDevice handle, VkCommandPool pool, uint32_t count,
                        const VkCommandBuffer *buffers)
{
    for (uint32_t i = 0; i < count; ++i)
        device.states.take(buffers[i]);
    device.driver.next.FreeCommandBuffers(handle, pool, count, buffers);
}

void destroyCommandPool(DeviceCommands &device, VkDevice handle, VkCommandPool pool,
                        const VkAllocationCallbacks *allocator)
{
    if (pool)
        device.states.removeIf([&](const auto &state) { return state->pool == pool; });
    device.driver.next.DestroyCommandPool(handle, pool, allocator);
}

VkResult beginCommandBuffer(DeviceCommands &device, VkCommandBuffer commandBuffer, const VkCommandBufferBeginInfo *info)
{
    // A command buffer is implicitly reset when it is begun again.
    if (const auto state = device.states.get(commandBuffer)) {
        state->forgetBindings();
        state->scratch.reset();
        state->conditionalRendering.reset();
        state->refusedTransformFeedback = false;
        state->cellsWait = false;
        // pInheritanceInfo is ignored for primary command buffers, and may be anything.
        const auto *inherited = state->secondary && info->pInheritanceInfo
                                    ? findInChain<VkCommandBufferInheritanceConditionalRenderingInfoEXT>(
                                          info->pInheritanceInfo->pNext,
                                          VK_STRUCTURE_TYPE_COMMAND_BUFFER_INHERITANCE_CONDITIONAL_RENDERING_INFO_EXT)
                                    : nullptr;
        state->inheritsConditionalRendering = inherited && inherited->conditionalRenderingEnable;
    }
    reportNotices(device.objects);
    return device.driver.next.BeginCommandBuffer(commandBuffer, info);
}

void cmdBindPipeline(DeviceCommands &device, VkCommandBuffer commandBuffer, VkPipelineBindPoint point,
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

void cmdBindShaders(DeviceCommands &device, VkCommandBuffer commandBuffer, uint32_t count,
                    const VkShaderStageFlagBits *stages, const newer::ShaderEXT *shaders)
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

void cmdPushConstants(DeviceCommands &device, VkCommandBuffer commandBuffer, VkPipelineLayout layout,
                      VkShaderStageFlags stages, uint32_t offset, uint32_t size, const void *values)
{
    if (const auto state = device.states.get(commandBuffer))
        rememberPush(*state, layout, stages, offset, size, values);
    device.driver.next.CmdPushConstants(commandBuffer, layout, stages, offset, size, values);
}

void cmdPushConstants2(DeviceCommands &device, VkCommandBuffer commandBuffer, const newer::PushConstantsInfo *info)
{
    // With a null layout the structure carries a VkPipelineLayoutCreateInfo, which cannot be kept for a later
    // vkCmdPushConstants; no driver that Vellum knows has that feature (dynamicPipelineLayout of
    // VK_NV_per_stage_descriptor_set) beside ray tracing.
    if (const auto state = device.states.get(commandBuffer); state && info->layout)
        rememberPush(*state, info->layout, info->stageFlags, info->offset, info->size, info->pValues);
    device.driver.next.CmdPushConstants2(commandBuffer, info);
}

void cmdExecuteCommands(DeviceCommands &device, VkCommandBuffer commandBuffer, uint32_t count,
                        const VkCommandBuffer *buffers)
{
    // All state of the primary is undefined after it ("Secondary Command Buffer Execution").
    if (const auto state = device.states.get(commandBuffer))
        state->forgetBindings();
    device.driver.next.CmdExecuteCommands(commandBuffer, count, buffers);
}

void cmdBeginConditionalRendering(DeviceCommands &device, VkCommandBuffer commandBuffer,
                                  const VkConditionalRenderingBeginInfoEXT *info)
{
    if (const auto state = device.states.get(commandBuffer)) {
        state->conditionalRendering = *info;
        state->conditionalRendering->pNext = nullptr;
    }
    device.driver.next.CmdBeginConditionalRenderingEXT(commandBuffer, info);
}

void cmdEndConditionalRendering(DeviceCommands &device, VkCommandBuffer commandBuffer)
{
    if (const auto state = device.states.get(commandBuffer)) {
        // It was begun in this command buffer; where it was not, vkCmdBeginConditionalRendering2EXT was refused.
        if (!state->conditionalRendering)
            return;
        state->conditionalRendering.reset();
    }
    device.driver.next.CmdEndConditionalRenderingEXT(commandBuffer);
}

} // namespace vellum::layer
