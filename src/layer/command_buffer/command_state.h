// What the layer keeps of a command buffer: what the application has set that injected work disturbs or depends on.
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <optional>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/handle_map.h"
#include "layer/base/vulkan_newer.h"
#include "layer/memory/scratch_memory.h"

namespace vellum::layer
{

struct DeviceCommandBuffers;

struct CommandState {
    struct PushedConstants {
        VkPipelineLayout layout;
        VkShaderStageFlags stages;
        uint32_t offset;
        std::vector<std::byte> bytes;
    };
    explicit CommandState(MemoryPool &scratchPool) : scratch(scratchPool) {}

    VkCommandPool pool = VK_NULL_HANDLE;
    bool secondary = false;

    VkPipeline computePipeline = VK_NULL_HANDLE;
    VkPipeline rayTracingPipeline = VK_NULL_HANDLE;
    std::optional<newer::ShaderEXT> computeShader; // bound last instead of a pipeline; may be null
    std::vector<PushedConstants> pushes;           // in the order they were made, without overwritten ones
    std::optional<VkConditionalRenderingBeginInfoEXT> conditionalRendering;
    bool inheritsConditionalRendering = false;
    bool refusedTransformFeedback = false; // by vkCmdBeginTransformFeedback2EXT: its end is to be refused too
    bool descriptorsWait =
        false; // transfers to descriptors wait for what came before in the stage of builds; since it was begun
    ScratchMemory scratch; // of injected work; lives as long as what is recorded

    void forgetBindings();
};

// The states of all command buffers of a device. Every recorded command looks one up, mostly that of the command buffer
// that its thread recorded into before.
class CommandStates
{
public:
    CommandStates() = default;
    ~CommandStates() { changed(); }
    CommandStates(const CommandStates &) = delete;
    CommandStates &operator=(const CommandStates &) = delete;

    void add(VkCommandBuffer commandBuffer, std::shared_ptr<CommandState> state);
    void remove(VkCommandPool pool, VkCommandBuffer commandBuffer);
    void removePool(VkCommandPool pool); // with all command buffers in it
    // Null of one that the application did not allocate. It is there until the command buffer is freed, which is not
    // while something is recorded into it.
    [[nodiscard]] CommandState *get(VkCommandBuffer commandBuffer) const;

private:
    static void changed();

    HandleMap<VkCommandBuffer, std::shared_ptr<CommandState>> states_;
    std::mutex poolsMutex_;
    std::unordered_map<VkCommandPool, std::unordered_set<VkCommandBuffer>> pools_;
};

VkResult allocateCommandBuffers(DeviceCommandBuffers &, VkDevice, const VkCommandBufferAllocateInfo *,
                                VkCommandBuffer *);
void freeCommandBuffers(DeviceCommandBuffers &, VkDevice, VkCommandPool, uint32_t, const VkCommandBuffer *);
void destroyCommandPool(DeviceCommandBuffers &, VkDevice, VkCommandPool, const VkAllocationCallbacks *);
VkResult beginCommandBuffer(DeviceCommandBuffers &, VkCommandBuffer, const VkCommandBufferBeginInfo *);
void cmdBindPipeline(DeviceCommandBuffers &, VkCommandBuffer, VkPipelineBindPoint, VkPipeline);
void cmdBindShaders(DeviceCommandBuffers &, VkCommandBuffer, uint32_t, const VkShaderStageFlagBits *,
                    const newer::ShaderEXT *);
void cmdPushConstants(DeviceCommandBuffers &, VkCommandBuffer, VkPipelineLayout, VkShaderStageFlags, uint32_t, uint32_t,
                      const void *);
void cmdPushConstants2(DeviceCommandBuffers &, VkCommandBuffer, const newer::PushConstantsInfo *);
void cmdExecuteCommands(DeviceCommandBuffers &, VkCommandBuffer, uint32_t, const VkCommandBuffer *);
void cmdBeginConditionalRendering(DeviceCommandBuffers &, VkCommandBuffer, const VkConditionalRenderingBeginInfoEXT *);
void cmdEndConditionalRendering(DeviceCommandBuffers &, VkCommandBuffer);

} // namespace vellum::layer
