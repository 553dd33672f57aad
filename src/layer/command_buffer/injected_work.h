// GPU work that the layer adds to the application's command buffers.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include <vulkan/vulkan.h>

#include "core/push.h"
#include "layer/command_buffer/command_state.h"
#include "layer/command_buffer/injected_shader.h"
#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

struct DeviceCommandBuffers;

inline constexpr uint32_t kPushBytes = 128; // the least that every device has

// The compute pipelines of the injected work; each is made when it is needed first.
class InjectedPipelines
{
public:
    ~InjectedPipelines();
    // `pushBytes`: of the layout, kPushBytes or more.
    VkResult create(const GpuContext &context, uint32_t pushBytes);
    // VK_NULL_HANDLE where the driver could not make it.
    VkPipeline get(InjectedShader shader);
    [[nodiscard]] VkPipelineLayout layout() const { return layout_; }
    [[nodiscard]] uint32_t pushBytes() const { return pushBytes_; }

private:
    GpuContext context_;
    uint32_t pushBytes_ = kPushBytes;
    std::mutex mutex_;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    std::array<VkPipeline, kInjectedShaders> pipelines_{};
};

// One stretch of injected work. At its end the command buffer's compute pipeline or shader, push constants and
// conditional rendering are as the application set them.
//
// Barriers are full ones (all commands before -> compute -> all commands after): what the application ordered against
// acceleration structure or micromap builds is ordered against the injected dispatches too.
class InjectedWork
{
public:
    InjectedWork(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer);
    ~InjectedWork();
    InjectedWork(const InjectedWork &) = delete;
    InjectedWork &operator=(const InjectedWork &) = delete;

    // True, with a message, where `command` cannot be carried out because a secondary command buffer inherits
    // conditional rendering: it cannot be suspended there, and would discard the layer's dispatches but not the
    // driver's builds.
    static bool refusedIn(const DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, const char *command);

    // Runs at least `invocations` invocations of a shader. Returns false, and reports, where it has no pipeline.
    template <typename Push>
    bool dispatch(InjectedShader shader, const Push &push, uint64_t invocations, uint32_t groupSize)
    {
        static_assert(sizeof(Push) <= kPushBytes);
        return run(shader, &push, sizeof(Push), groupsOf(invocations, groupSize));
    }
    template <typename Push>
    bool dispatch(InjectedShader shader, const Push &push, const VkDispatchIndirectCommand &groups)
    {
        static_assert(sizeof(Push) <= kPushBytes);
        return run(shader, &push, sizeof(Push), groups);
    }
    // The same with a number of groups that a VkDispatchIndirectCommand says.
    template <typename Push>
    bool dispatchIndirect(InjectedShader shader, const Push &push, VkBuffer buffer, VkDeviceSize offset)
    {
        static_assert(sizeof(Push) <= kPushBytes);
        return runIndirect(shader, &push, sizeof(Push), buffer, offset);
    }
    // How the invocations of a dispatch are laid out, in groups.
    static VkDispatchIndirectCommand groupsOf(uint64_t invocations, uint32_t groupSize);
    // Orders what came before in the command buffer, ours and the application's, before what comes after; and before
    // what the host reads.
    void barrier(bool forHost = false);

private:
    bool run(InjectedShader shader, const void *push, uint32_t pushBytes, const VkDispatchIndirectCommand &groups);
    bool runIndirect(InjectedShader shader, const void *push, uint32_t pushBytes, VkBuffer buffer, VkDeviceSize offset);
    // What the application has pushed; zeros, as in a new command buffer, where it has not.
    [[nodiscard]] std::vector<std::byte> pushedConstants() const;
    // Makes ready for a dispatch of the shader.
    bool bind(InjectedShader shader, const void *push, uint32_t pushBytes);

    DeviceCommandBuffers &device_;
    VkCommandBuffer commandBuffer_;
    CommandState *state_;           // null of a command buffer that is not the application's
    std::vector<std::byte> pushed_; // for Driver::keepsOldPushConstants, once disturbed
    bool disturbed_ = false;
};

} // namespace vellum::layer
