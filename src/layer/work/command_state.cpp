#include "layer/work/command_state.h"

#include <cstring>

#include "layer/door/device.h"
#include "layer/ground/pnext.h"
#include "layer/structures/acceleration_structure.h"

namespace vellum::layer
{
namespace
{

HandleMap<VkCommandBuffer, std::shared_ptr<CommandState>> states;

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

std::shared_ptr<CommandState> commandState(VkCommandBuffer commandBuffer)
{
    return states.get(commandBuffer);
}

void forgetCommandBuffers(const Device &device)
{
    states.removeIf([&device](const auto &state) { return state->device == &device; });
}

VKAPI_ATTR VkResult VKAPI_CALL allocateCommandBuffers(VkDevice handle, const VkCommandBufferAllocateInfo *info,
                                                      VkCommandBuffer *buffers)
{
    Device &device = deviceOf(handle);
    const VkResult result = device.next.AllocateCommandBuffers(handle, info, buffers);
    for (uint32_t i = 0; result == VK_SUCCESS && i < info->commandBufferCount; ++i) {
        auto state = std::make_shared<CommandState>();
        state->device = &device;
        state->pool = info->commandPool;
        state->secondary = info->level == VK_COMMAND_BUFFER_LEVEL_SECONDARY;
        states.set(buffers[i], std::move(state));
    }
    return result;
}

VKAPI_ATTR void VKAPI_CALL freeCommandBuffers(VkDevice handle, VkCommandPool pool, uint32_t count,
                                              const VkCommandBuffer *buffers)
{
    for (uint32_t i = 0; i < count; ++i)
        states.take(buffers[i]);
    deviceOf(handle).next.FreeCommandBuffers(handle, pool, count, buffers);
}

VKAPI_ATTR void VKAPI_CALL destroyCommandPool(VkDevice handle, VkCommandPool pool,
                                              const VkAllocationCallbacks *allocator)
{
    Device &device = deviceOf(handle);
    if (pool)
        states.removeIf([&](const auto &state) { return state->device == &device && state->pool == pool; });
    device.next.DestroyCommandPool(handle, pool, allocator);
}

VKAPI_ATTR VkResult VKAPI_CALL beginCommandBuffer(VkCommandBuffer commandBuffer, const VkCommandBufferBeginInfo *info)
{
    // A command buffer is implicitly reset when it is begun again.
    if (const auto state = commandState(commandBuffer)) {
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
    Device &device = deviceOf(commandBuffer);
    reportNotices(device);
    return device.next.BeginCommandBuffer(commandBuffer, info);
}

VKAPI_ATTR void VKAPI_CALL cmdBindPipeline(VkCommandBuffer commandBuffer, VkPipelineBindPoint point,
                                           VkPipeline pipeline)
{
    if (const auto state = commandState(commandBuffer); state && point == VK_PIPELINE_BIND_POINT_COMPUTE) {
        state->computePipeline = pipeline;
        state->computeShader.reset();
    } else if (state && point == VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR) {
        state->rayTracingPipeline = pipeline;
    }
    deviceOf(commandBuffer).next.CmdBindPipeline(commandBuffer, point, pipeline);
}

VKAPI_ATTR void VKAPI_CALL cmdBindShaders(VkCommandBuffer commandBuffer, uint32_t count,
                                          const VkShaderStageFlagBits *stages, const newer::ShaderEXT *shaders)
{
    if (const auto state = commandState(commandBuffer)) {
        for (uint32_t i = 0; i < count; ++i) {
            if (stages[i] != VK_SHADER_STAGE_COMPUTE_BIT)
                continue;
            state->computePipeline = VK_NULL_HANDLE;
            state->computeShader = shaders ? shaders[i] : nullptr;
        }
    }
    deviceOf(commandBuffer).next.CmdBindShadersEXT(commandBuffer, count, stages, shaders);
}

VKAPI_ATTR void VKAPI_CALL cmdPushConstants(VkCommandBuffer commandBuffer, VkPipelineLayout layout,
                                            VkShaderStageFlags stages, uint32_t offset, uint32_t size,
                                            const void *values)
{
    if (const auto state = commandState(commandBuffer))
        rememberPush(*state, layout, stages, offset, size, values);
    deviceOf(commandBuffer).next.CmdPushConstants(commandBuffer, layout, stages, offset, size, values);
}

VKAPI_ATTR void VKAPI_CALL cmdPushConstants2(VkCommandBuffer commandBuffer, const newer::PushConstantsInfo *info)
{
    // With a null layout the structure carries a VkPipelineLayoutCreateInfo, which cannot be kept for a later
    // vkCmdPushConstants; no driver that Vellum knows has that feature (dynamicPipelineLayout of
    // VK_NV_per_stage_descriptor_set) beside ray tracing.
    if (const auto state = commandState(commandBuffer); state && info->layout)
        rememberPush(*state, info->layout, info->stageFlags, info->offset, info->size, info->pValues);
    deviceOf(commandBuffer).next.CmdPushConstants2(commandBuffer, info);
}

VKAPI_ATTR void VKAPI_CALL cmdExecuteCommands(VkCommandBuffer commandBuffer, uint32_t count,
                                              const VkCommandBuffer *buffers)
{
    // All state of the primary is undefined after it ("Secondary Command Buffer Execution").
    if (const auto state = commandState(commandBuffer))
        state->forgetBindings();
    deviceOf(commandBuffer).next.CmdExecuteCommands(commandBuffer, count, buffers);
}

VKAPI_ATTR void VKAPI_CALL cmdBeginConditionalRendering(VkCommandBuffer commandBuffer,
                                                        const VkConditionalRenderingBeginInfoEXT *info)
{
    if (const auto state = commandState(commandBuffer)) {
        state->conditionalRendering = *info;
        state->conditionalRendering->pNext = nullptr;
    }
    deviceOf(commandBuffer).next.CmdBeginConditionalRenderingEXT(commandBuffer, info);
}

VKAPI_ATTR void VKAPI_CALL cmdEndConditionalRendering(VkCommandBuffer commandBuffer)
{
    if (const auto state = commandState(commandBuffer)) {
        // It was begun in this command buffer; where it was not, vkCmdBeginConditionalRendering2EXT was refused.
        if (!state->conditionalRendering)
            return;
        state->conditionalRendering.reset();
    }
    deviceOf(commandBuffer).next.CmdEndConditionalRenderingEXT(commandBuffer);
}

} // namespace vellum::layer
