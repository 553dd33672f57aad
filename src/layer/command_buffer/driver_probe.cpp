// SPDX-License-Identifier: Apache-2.0
#include "layer/command_buffer/driver_probe.h"

#include <string>

#include "vk/newer.h"

namespace vellum::layer
{
namespace
{

// Longer than any frame. After this time the queue most likely waits for the thread that waits for the probe.
constexpr std::chrono::seconds kTimeout{10};
constexpr std::chrono::seconds kTimeoutOfCpu{60};

// With steady_clock, std::timed_mutex calls pthread_mutex_clocklock, which ThreadSanitizer (GCC 12) does not know.
#if defined(__SANITIZE_THREAD__)
using Clock = std::chrono::system_clock;
#else
using Clock = std::chrono::steady_clock;
#endif

} // namespace

// A submitted probe with its command buffer and fence.
class ProbeQueue::Submission
{
public:
    Submission(const GpuContext &context, std::unique_ptr<Probe> probe) : context_(context), probe_(std::move(probe)) {}
    ~Submission()
    {
        // The probe may be incomplete here only after a timeout. The device is then being destroyed, and must be idle.
        // If it is not, the objects that the GPU may still use are leaked.
        if (submitted_ && !done_)
            wait(kTimeout);
        if (submitted_ && !done_) {
            static_cast<void>(probe_.release());
            return;
        }
        probe_.reset();
        if (fence_)
            next_.DestroyFence(context_.device, fence_, nullptr);
        if (pool_)
            next_.DestroyCommandPool(context_.device, pool_, nullptr);
    }
    Submission(const Submission &) = delete;
    Submission &operator=(const Submission &) = delete;

    bool record(uint32_t family, PFN_vkSetDeviceLoaderData setLoaderData)
    {
        const VkCommandPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr, 0, family};
        if (next_.CreateCommandPool(context_.device, &poolInfo, nullptr, &pool_) != VK_SUCCESS)
            return false;
        const VkCommandBufferAllocateInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr, pool_,
                                               VK_COMMAND_BUFFER_LEVEL_PRIMARY, 1};
        if (next_.AllocateCommandBuffers(context_.device, &info, &commands_) != VK_SUCCESS)
            return false;
        // Dispatchable objects that a layer creates for itself need the loader's table, which layers below read.
        setLoaderData(context_.device, commands_);
        VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
        begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
        if (next_.BeginCommandBuffer(commands_, &begin) != VK_SUCCESS || !probe_->record(commands_))
            return false;
        const VkMemoryBarrier memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, VK_ACCESS_MEMORY_WRITE_BIT,
                                     VK_ACCESS_HOST_READ_BIT};
        next_.CmdPipelineBarrier(commands_, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 1,
                                 &memory, 0, nullptr, 0, nullptr);
        return next_.EndCommandBuffer(commands_) == VK_SUCCESS;
    }

    bool submit(VkQueue queue)
    {
        const VkFenceCreateInfo fenceInfo{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO, nullptr, 0};
        if (next_.CreateFence(context_.device, &fenceInfo, nullptr, &fence_) != VK_SUCCESS)
            return false;
        VkSubmitInfo info{VK_STRUCTURE_TYPE_SUBMIT_INFO};
        info.commandBufferCount = 1;
        info.pCommandBuffers = &commands_;
        submitted_ = next_.QueueSubmit(queue, 1, &info, fence_) == VK_SUCCESS;
        return submitted_;
    }

    VkResult wait(std::chrono::nanoseconds time)
    {
        const VkResult result =
            next_.WaitForFences(context_.device, 1, &fence_, VK_TRUE, static_cast<uint64_t>(time.count()));
        // Objects of a lost device may be destroyed (Vulkan, "Lost Device").
        done_ = result == VK_SUCCESS || result == VK_ERROR_DEVICE_LOST;
        return result;
    }

    void read() { probe_->read(); }

private:
    const GpuContext &context_;
    const DeviceTable &next_ = *context_.next;
    std::unique_ptr<Probe> probe_;
    VkCommandPool pool_ = VK_NULL_HANDLE;
    VkCommandBuffer commands_ = VK_NULL_HANDLE;
    VkFence fence_ = VK_NULL_HANDLE;
    bool submitted_ = false;
    bool done_ = false; // complete, or the device is lost
};

ProbeQueue::ProbeQueue() = default;
ProbeQueue::~ProbeQueue() = default;

void ProbeQueue::choose(const GpuContext &context, Reporter &report, bool slow,
                        const std::vector<VkQueueFamilyProperties> &families, const VkDeviceCreateInfo &info,
                        PFN_vkSetDeviceLoaderData setLoaderData)
{
    context_ = context;
    report_ = &report;
    timeout_ = slow ? kTimeoutOfCpu : kTimeout;
    setLoaderData_ = setLoaderData;
    if (!setLoaderData)
        return;
    for (uint32_t i = 0; i < info.queueCreateInfoCount && !queue_; ++i) {
        const VkDeviceQueueCreateInfo &queues = info.pQueueCreateInfos[i];
        const bool isProtected = (queues.flags & VK_DEVICE_QUEUE_CREATE_PROTECTED_BIT) != 0;
        if (isProtected || queues.queueFamilyIndex >= families.size() ||
            (families[queues.queueFamilyIndex].queueFlags & VK_QUEUE_COMPUTE_BIT) == 0)
            continue;
        family_ = queues.queueFamilyIndex;
        isSynchronized_ = (queues.flags & VK_DEVICE_QUEUE_CREATE_INTERNALLY_SYNCHRONIZED_BIT_KHR) != 0;
        const VkDeviceQueueInfo2 queueInfo{VK_STRUCTURE_TYPE_DEVICE_QUEUE_INFO_2, nullptr, queues.flags, family_, 0};
        context.next->GetDeviceQueue2(context.device, &queueInfo, &queue_);
    }
    // Done here, because no other thread has the queue yet.
    if (queue_)
        setLoaderData(context.device, queue_);
}

bool ProbeQueue::run(std::unique_ptr<Probe> probe)
{
    if (!exists())
        return false;
    auto submission = std::make_unique<Submission>(context_, std::move(probe));
    if (!submission->record(family_, setLoaderData_))
        return false;
    VkResult result = VK_TIMEOUT;
    if (const Lock lock(mutex_, Clock::now() + timeout_); lock)
        result = submission->submit(queue_) ? VK_SUCCESS : VK_ERROR_UNKNOWN;
    if (result == VK_SUCCESS)
        result = submission->wait(timeout_);
    if (result == VK_SUCCESS)
        submission->read();
    if (result != VK_TIMEOUT)
        return result == VK_SUCCESS;
    report_->warning("VELLUM-busy-queue", "the driver could not be probed: the queue has been busy for " +
                                              std::to_string(timeout_.count()) + " seconds");
    std::lock_guard lock(unfinishedMutex_);
    unfinished_.push_back(std::move(submission));
    return false;
}

} // namespace vellum::layer
