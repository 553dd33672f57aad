// SPDX-License-Identifier: Apache-2.0
// The state of a command buffer that injected work disturbs or depends on.
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
#include "layer/command_buffer/hit_table_copies.h"
#include "layer/memory/scratch_memory.h"
#include "vk/newer.h"

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
    explicit CommandState(MemoryPool &scratchPool) : scratch(scratchPool), hitTables(scratchPool) {}

    VkCommandPool pool = VK_NULL_HANDLE;
    bool secondary = false;

    VkPipeline computePipeline = VK_NULL_HANDLE;
    VkPipeline rayTracingPipeline = VK_NULL_HANDLE;
    std::optional<VkShaderEXT> computeShader; // bound last instead of a pipeline; may be null
    // Shaders find descriptors in heaps: heaps are bound or inherited, or data was pushed. Any such command invalidates
    // descriptor sets and push constants, and any command that sets these invalidates heaps and push data (Using
    // Heaps).
    bool heaps = false;
    // In the order of the commands, without overwritten ones. With `heaps`, push data, which has no layout or stages.
    std::vector<PushedConstants> pushes;
    std::optional<VkConditionalRenderingBeginInfoEXT> conditionalRendering;
    bool inheritsConditionalRendering = false;
    // vkCmdBeginTransformFeedback2EXT was rejected; the next vkCmdEndTransformFeedback2EXT must be, too.
    bool rejectedTransformFeedback = false;
    // A barrier from builds to transfers to structure descriptors was recorded.
    bool descriptorsWait = false;
    ScratchMemory scratch; // of injected work; lives as long as the recorded commands
    HitTableCopies hitTables;
    // The recorded commands use these: buffers that were found by addresses, slots of instances.
    std::unordered_set<std::shared_ptr<const void>> used;

    void forgetBindings();
};

// The states of all command buffers of a device. Every recorded command looks one up, mostly the same as the command
// before it in its thread.
class CommandStates
{
public:
    // A device has states for each of its users, which number themselves: each thread remembers a look-up of each.
    enum class User : uint8_t { Layer, Validation };
    using Make = std::shared_ptr<CommandState> (*)(MemoryPool &scratch);
    // `make`: makes a state, or something derived from it.
    CommandStates(User user, Make make) : user_(user), make_(make) {}
    CommandStates()
        : CommandStates(User::Layer, [](MemoryPool &scratch) { return std::make_shared<CommandState>(scratch); })
    {
    }
    ~CommandStates() { changed(); }
    CommandStates(const CommandStates &) = delete;
    CommandStates &operator=(const CommandStates &) = delete;

    [[nodiscard]] std::shared_ptr<CommandState> makeState(MemoryPool &scratch) const { return make_(scratch); }
    void add(VkCommandBuffer commandBuffer, std::shared_ptr<CommandState> state);
    void remove(VkCommandPool pool, VkCommandBuffer commandBuffer);
    void removePool(VkCommandPool pool); // with all command buffers in it
    // Null for a command buffer that the application did not allocate. Valid until the command buffer is freed.
    [[nodiscard]] CommandState *get(VkCommandBuffer commandBuffer) const;
    // Notes where the shaders of a command buffer find descriptors from now on (CommandState::heaps). Returns its
    // state, or null as get() does.
    CommandState *setHeaps(VkCommandBuffer commandBuffer, bool heaps) const;
    void clear();
    // Keeps what a command uses that is about to be recorded, for as long as the command exists.
    void keep(VkCommandBuffer commandBuffer, std::shared_ptr<const void> used) const;
    // Calls `use` with the state of each command buffer of a pool.
    template <typename Use>
    void forPool(VkCommandPool pool, Use use)
    {
        std::lock_guard lock(poolsMutex_);
        const auto found = pools_.find(pool);
        if (found == pools_.end())
            return;
        for (const VkCommandBuffer commandBuffer : found->second)
            use(*states_.get(commandBuffer));
    }

private:
    static void changed();

    User user_;
    Make make_;
    HandleMap<VkCommandBuffer, std::shared_ptr<CommandState>> states_;
    std::mutex poolsMutex_;
    std::unordered_map<VkCommandPool, std::unordered_set<VkCommandBuffer>> pools_;
};

void cmdPushData(DeviceCommandBuffers &, VkCommandBuffer, const VkPushDataInfoEXT *);

} // namespace vellum::layer
