// What the layer keeps of a command buffer: what the application has set that injected work disturbs or depends on.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/ground/vulkan_newer.h"
#include "layer/memory/scratch_memory.h"

namespace vellum::layer
{

struct Device;

struct CommandState {
    struct PushedConstants {
        VkPipelineLayout layout;
        VkShaderStageFlags stages;
        uint32_t offset;
        std::vector<std::byte> bytes;
    };
    Device *device = nullptr;
    VkCommandPool pool = VK_NULL_HANDLE;
    bool secondary = false;

    VkPipeline computePipeline = VK_NULL_HANDLE;
    VkPipeline rayTracingPipeline = VK_NULL_HANDLE;
    std::optional<newer::ShaderEXT> computeShader; // bound last instead of a pipeline; may be null
    std::vector<PushedConstants> pushes;           // in the order they were made, without overwritten ones
    std::optional<VkConditionalRenderingBeginInfoEXT> conditionalRendering;
    bool inheritsConditionalRendering = false;
    bool refusedTransformFeedback = false; // by vkCmdBeginTransformFeedback2EXT: its end is to be refused too
    bool cellsWait = false; // transfers to cells wait for what came before in the stage of builds; since it was begun
    ScratchMemory scratch;  // of injected work; lives as long as what is recorded

    void forgetBindings();
};

// Null for command buffers of devices that the layer does not emulate.
std::shared_ptr<CommandState> commandState(VkCommandBuffer commandBuffer);
void forgetCommandBuffers(const Device &device);

VKAPI_ATTR VkResult VKAPI_CALL allocateCommandBuffers(VkDevice, const VkCommandBufferAllocateInfo *, VkCommandBuffer *);
VKAPI_ATTR void VKAPI_CALL freeCommandBuffers(VkDevice, VkCommandPool, uint32_t, const VkCommandBuffer *);
VKAPI_ATTR void VKAPI_CALL destroyCommandPool(VkDevice, VkCommandPool, const VkAllocationCallbacks *);
VKAPI_ATTR VkResult VKAPI_CALL beginCommandBuffer(VkCommandBuffer, const VkCommandBufferBeginInfo *);
VKAPI_ATTR void VKAPI_CALL cmdBindPipeline(VkCommandBuffer, VkPipelineBindPoint, VkPipeline);
VKAPI_ATTR void VKAPI_CALL cmdBindShaders(VkCommandBuffer, uint32_t, const VkShaderStageFlagBits *,
                                          const newer::ShaderEXT *);
VKAPI_ATTR void VKAPI_CALL cmdPushConstants(VkCommandBuffer, VkPipelineLayout, VkShaderStageFlags, uint32_t, uint32_t,
                                            const void *);
VKAPI_ATTR void VKAPI_CALL cmdPushConstants2(VkCommandBuffer, const newer::PushConstantsInfo *);
VKAPI_ATTR void VKAPI_CALL cmdExecuteCommands(VkCommandBuffer, uint32_t, const VkCommandBuffer *);
VKAPI_ATTR void VKAPI_CALL cmdBeginConditionalRendering(VkCommandBuffer, const VkConditionalRenderingBeginInfoEXT *);
VKAPI_ATTR void VKAPI_CALL cmdEndConditionalRendering(VkCommandBuffer);

} // namespace vellum::layer
