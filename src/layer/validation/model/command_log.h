// SPDX-License-Identifier: Apache-2.0
// What the host can know of the order in which a device executes commands. Each command buffer keeps the effects of its
// commands on validation's state, and the checks that depend on that state. Submission carries them out, in the order
// of the submissions.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/handle_map.h"
#include "layer/validation/model/descriptors.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct TracingCode;

// What a command buffer has bound, for one bind point.
struct PointBindings {
    std::map<uint32_t, std::shared_ptr<const TracingCode>> code; // by stage; of a pipeline: by 0
    BoundSets sets;
};
struct TraceBindings {
    PointBindings points[4];
    PointBindings &at(VkPipelineBindPoint point)
    {
        return points[point == VK_PIPELINE_BIND_POINT_SUBPASS_SHADING_HUAWEI ? 3
                      : point == VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR      ? 2
                      : point == VK_PIPELINE_BIND_POINT_COMPUTE              ? 1
                                                                             : 0];
    }
};

// The submission that carries out the steps of command buffers.
struct Submission {
    VkQueue queue = VK_NULL_HANDLE;
    uint32_t family = 0;
    // All that it waits for was submitted before. Otherwise what structures hold when it is executed is not known.
    bool ordered = true;
};

struct CommandLog {
    using Step = std::function<void(const Submission &)>;

    VkCommandPool pool = VK_NULL_HANDLE;
    uint32_t family = 0;
    bool secondary = false;
    bool isRecording = false;
    bool isRendering = false; // inside a render pass instance
    bool suspends = false;    // that will be suspended
    bool isSuspended = false; // between two such instances
    std::vector<Step> steps;
    TraceBindings traces;

    // Forgets what was recorded.
    void reset();
};

class CommandLogs
{
public:
    // The log of a command buffer; null for one that the application did not allocate.
    [[nodiscard]] std::shared_ptr<CommandLog> get(VkCommandBuffer commandBuffer) const
    {
        return logs_.get(commandBuffer);
    }
    void add(VkCommandBuffer commandBuffer, std::shared_ptr<CommandLog> log);
    void remove(VkCommandPool pool, uint32_t count, const VkCommandBuffer *commandBuffers);
    void removePool(VkCommandPool pool);
    void clear();
    void resetPool(VkCommandPool pool);
    // Adds a step to the log. Its check or effect happens when the command buffer is submitted; without one, that is
    // for host commands, at once.
    void add(VkCommandBuffer commandBuffer, CommandLog::Step step);

    // Held while work is submitted and its steps run: those of several queues change the same structures, and what a
    // submission signals is known before the host learns that it was signaled.
    std::mutex submissions;
    // Waits until submissions that have begun are known.
    void settle() { const std::lock_guard lock(submissions); }
    // Of timeline semaphores the largest value that a submission or the host signals; of queues what they wait for
    // before it is submitted.
    std::unordered_map<uint64_t, uint64_t> signals;
    std::unordered_map<VkQueue, std::vector<std::pair<uint64_t, uint64_t>>> waits;

private:
    HandleMap<VkCommandBuffer, std::shared_ptr<CommandLog>> logs_;
    std::mutex mutex_; // guards what is below
    std::unordered_map<VkCommandPool, std::unordered_set<VkCommandBuffer>> pools_;
};

} // namespace vellum::layer
