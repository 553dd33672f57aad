// SPDX-License-Identifier: Apache-2.0
// GPU work that the layer adds to the application's command buffers.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <vulkan/vulkan.h>

#include "core/push.h"
#include "layer/command_buffer/command_state.h"
#include "layer/command_buffer/injected_shader.h"
#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

struct DeviceCommandBuffers;

inline constexpr uint32_t kPushBytes = 128; // required minimum of maxPushConstantsSize

// The compute pipelines of the injected work. Each is created when it is first needed, without a lock: compilation
// takes long, and other threads record meanwhile. Of threads that create the same one, the first to finish provides it.
// Where a command buffer uses descriptor heaps, pipelines must be made for these, and push constants are push data.
class InjectedPipelines
{
public:
    ~InjectedPipelines();
    // `pushBytes`: size of the layout's push constants, at least kPushBytes.
    VkResult create(const GpuContext &context, uint32_t pushBytes);
    // VK_NULL_HANDLE if the driver could not create it.
    VkPipeline get(InjectedShader shader, bool heaps = false);
    [[nodiscard]] VkPipelineLayout layout() const { return layout_; }
    [[nodiscard]] uint32_t pushBytes() const { return pushBytes_; }

private:
    GpuContext context_;
    uint32_t pushBytes_ = kPushBytes;
    [[nodiscard]] VkPipeline createPipeline(InjectedShader shader, bool heaps) const;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    std::array<std::array<std::atomic<VkPipeline>, kInjectedShaders>, 2> pipelines_{}; // without and with heaps
};

// A sequence of injected commands. The destructor restores the application's compute pipeline or shader, push constants
// and conditional rendering.
//
// Barriers are full ones (all commands before -> compute -> all commands after): the application orders its commands
// against builds of acceleration structures and micromaps, and that must hold for the injected dispatches.
class InjectedWork
{
public:
    InjectedWork(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer);
    ~InjectedWork();
    InjectedWork(const InjectedWork &) = delete;
    InjectedWork &operator=(const InjectedWork &) = delete;

    // Reports an error and returns true if `command` is not available because a secondary command buffer inherits
    // conditional rendering. It cannot be suspended there, and would discard the layer's dispatches but not the
    // driver's builds.
    static bool rejectedIn(const DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, const char *command);

    // Creates the pipeline of a shader, if there is none yet: for work that must not stop in the middle. Returns false
    // and reports an error if that fails.
    bool prepare(InjectedShader shader) { return pipelineOf(shader) != VK_NULL_HANDLE; }
    // Runs at least `invocations` invocations of a shader. Returns false and reports an error if it has no pipeline.
    template <typename Push>
    bool dispatch(InjectedShader shader, const Push &values, uint64_t invocations, uint32_t groupSize)
    {
        static_assert(sizeof(Push) <= kPushBytes);
        return run(shader, &values, sizeof(Push), groupsOf(invocations, groupSize));
    }
    template <typename Push>
    bool dispatch(InjectedShader shader, const Push &values, const VkDispatchIndirectCommand &groups)
    {
        static_assert(sizeof(Push) <= kPushBytes);
        return run(shader, &values, sizeof(Push), groups);
    }
    // As above, with the number of groups in a VkDispatchIndirectCommand.
    template <typename Push>
    bool dispatchIndirect(InjectedShader shader, const Push &values, VkBuffer buffer, VkDeviceSize offset)
    {
        static_assert(sizeof(Push) <= kPushBytes);
        return runIndirect(shader, &values, sizeof(Push), buffer, offset);
    }
    // The groups of a dispatch with this number of invocations.
    static VkDispatchIndirectCommand groupsOf(uint64_t invocations, uint32_t groupSize);
    // Orders all earlier commands of the command buffer before all later ones, and before reads of the host.
    void barrier(bool forHost = false);

private:
    bool run(InjectedShader shader, const void *values, uint32_t bytes, const VkDispatchIndirectCommand &groups);
    bool runIndirect(InjectedShader shader, const void *values, uint32_t bytes, VkBuffer buffer, VkDeviceSize offset);
    // The application's push constants; zero where it has pushed none.
    [[nodiscard]] std::vector<std::byte> pushedConstants() const;
    [[nodiscard]] VkPipeline pipelineOf(InjectedShader shader);
    // Binds the pipeline of a shader and its push constants.
    bool bind(InjectedShader shader, const void *values, uint32_t bytes);
    // Push data where the command buffer uses heaps, which has no layout or stages; else push constants.
    void push(VkPipelineLayout layout, VkShaderStageFlags stages, uint32_t offset, const void *data, size_t bytes);
    [[nodiscard]] bool usesHeaps() const { return state_ && state_->heaps; }

    DeviceCommandBuffers &device_;
    VkCommandBuffer commandBuffer_;
    CommandState *state_;           // null for a command buffer of the layer
    std::vector<std::byte> pushed_; // application's push constants, with Driver::keepsOldPushConstants
    bool disturbed_ = false;
};

} // namespace vellum::layer
