// SPDX-License-Identifier: Apache-2.0
// The host's knowledge of the order in which a device executes commands. Each command buffer keeps the effects of its
// commands on validation's state, and the checks that depend on that state. Submission carries them out, in the order
// of the submissions.
#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/command_buffer/command_state.h"
#include "layer/input/objects.h"
#include "layer/validation/model/descriptors.h"

namespace vellum::layer
{

struct TracingCode;

// The bindings of a command buffer, for one bind point.
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
    // The rule that command buffers refer to no object that was destroyed.
    const char *invalidId = nullptr;
    uint64_t batch =
        0; // the number of the batch on its queue, as sync::Tracker counts; 0: when it is complete is not known
    // All that it waits for was submitted before. Otherwise what structures hold when it is executed is not known.
    bool ordered = true;
};

// An address that a command accesses when it is executed. Its buffer must not be destroyed before.
struct AccessedAddress {
    VkDeviceAddress address = 0;
    const char *command = nullptr;
    uint32_t info = kNone, geometry = kNone; // indices, in pInfos and its pGeometries
    const char *member = nullptr;
    const char *vuid = nullptr;
    ObjectHandle object{}; // for the message
    static constexpr uint32_t kNone = UINT32_MAX;
};
struct AccessedAddresses {
    uint64_t losses = 0; // ValidatedObjects::bufferLosses when they were last known to be valid
    std::vector<AccessedAddress> addresses;
};

struct CommandLog : CommandState {
    using Step = std::function<void(const Submission &)>;
    struct Steps {
        std::vector<Step> checks;  // of what the host knows, before the driver gets the submission: it may crash
        std::vector<Step> effects; // on what objects hold, and checks of that, in the order of the commands
        void run(const Submission &submission, const std::vector<Step> Steps::*which) const
        {
            for (const Step &step : this->*which)
                step(submission);
        }
    };
    using CommandState::CommandState;

    uint32_t family = 0;
    bool isProtected = false;
    bool isRecording = false;
    bool isRendering = false; // inside a render pass instance
    bool suspends = false;    // rendering will be suspended
    bool isSuspended = false; // between two such instances
    // Shared with submissions: once the driver has the work, another thread may learn that it is complete and reset or
    // free the command buffer before the steps have run. Never null.
    std::shared_ptr<Steps> steps = std::make_shared<Steps>();
    std::shared_ptr<AccessedAddresses> accessed; // null: none
    TraceBindings traces;

    // Forgets what was recorded.
    void reset();
};

class CommandLogs
{
public:
    // `states`: those that makeStates() made.
    explicit CommandLogs(CommandStates &states) : states_(states) {}
    static CommandStates makeStates()
    {
        return {CommandStates::User::Validation, [](MemoryPool &scratch) -> std::shared_ptr<CommandState> {
                    return std::make_shared<CommandLog>(scratch);
                }};
    }

    // The log of a command buffer; null for one that the application did not allocate. Valid until it is freed.
    [[nodiscard]] CommandLog *get(VkCommandBuffer commandBuffer) const
    {
        return static_cast<CommandLog *>(states_.get(commandBuffer));
    }
    void resetPool(VkCommandPool pool)
    {
        states_.forPool(pool, [](CommandState &state) { static_cast<CommandLog &>(state).reset(); });
    }
    // Adds an effect to the log, which happens when the command buffer is submitted; without one, that is for host
    // commands, at once.
    void add(VkCommandBuffer commandBuffer, CommandLog::Step effect);
    void addCheck(VkCommandBuffer commandBuffer, CommandLog::Step check);

    // Held while the steps of submissions run: those of several queues change the same structures. The driver is given
    // work without it, because it may block until another thread signals what the work waits for.
    std::mutex submissions;
    // Waits until submissions that have begun are known: the host may learn that one is complete before that. One that
    // blocks is overtaken.
    void settle();
    // signals: for each timeline semaphore, the largest value that a submission or the host signals. waits: for each
    // queue, what it waits for before it is submitted.
    std::unordered_map<uint64_t, uint64_t> signals;
    std::unordered_map<VkQueue, std::vector<std::pair<uint64_t, uint64_t>>> waits;

private:
    friend class SubmissionTurn;
    // Waits until those before a turn are known, or have been overtaken. Returns whether all are known.
    bool waitForEarlier(std::unique_lock<std::mutex> &lock, uint64_t turn);

    CommandStates &states_;
    // Guarded by `submissions`:
    uint64_t turns_ = 0;
    std::map<uint64_t, bool> begun_; // by turn, those that the driver has not returned from; whether one is overtaken
    std::condition_variable known_;
};

// The turn of a submission among those of all queues, taken before the driver gets it. Its destructor ends it.
class SubmissionTurn
{
public:
    explicit SubmissionTurn(CommandLogs &logs);
    ~SubmissionTurn();
    SubmissionTurn(const SubmissionTurn &) = delete;
    SubmissionTurn &operator=(const SubmissionTurn &) = delete;
    // After the driver's command: locks CommandLogs::submissions until the end. False: the order in which the driver
    // got this one and others is not known.
    [[nodiscard]] bool await();

private:
    CommandLogs &logs_;
    uint64_t number_;
    std::unique_lock<std::mutex> lock_;
};

} // namespace vellum::layer
