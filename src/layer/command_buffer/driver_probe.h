// SPDX-License-Identifier: Apache-2.0
// Probes of the driver: GPU work whose result shows how the driver behaves. A probe runs when its result is first
// needed.
//
// It runs on one of the application's queues. Queue commands of the application therefore hold ProbeQueue::lock(); a
// probe holds it while it is submitted. Waiting for a probe has a timeout, because the queue may be waiting for a
// semaphore that the application would signal next in the same thread.
#pragma once

#include <chrono>
#include <memory>
#include <mutex>
#include <vector>

#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

#include "layer/base/report.h"
#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

// One probe. Owns what its commands use until they are complete.
class Probe
{
public:
    virtual ~Probe() = default;
    // Returns false if the driver could not create what is needed; nothing is submitted then.
    virtual bool record(VkCommandBuffer commands) = 0;
    // Reads the result. Called when the commands are complete.
    virtual void read() = 0;
};

class ProbeQueue
{
public:
    ProbeQueue();
    ~ProbeQueue();
    ProbeQueue(const ProbeQueue &) = delete;
    ProbeQueue &operator=(const ProbeQueue &) = delete;

    // Chooses a queue that can run compute shaders. Called while the device is created. `info` is the application's.
    // `slow`: the device is a CPU, which gets a longer timeout.
    void choose(const GpuContext &context, Reporter &report, bool slow,
                const std::vector<VkQueueFamilyProperties> &families, const VkDeviceCreateInfo &info,
                PFN_vkSetDeviceLoaderData setLoaderData);
    // False if the application created no such queue.
    [[nodiscard]] bool exists() const { return queue_ != VK_NULL_HANDLE; }

    // Returns whether the probe is complete. May be called by any thread, except in queue commands.
    bool run(std::unique_ptr<Probe> probe);

    using Lock = std::unique_lock<std::timed_mutex>;
    // Held by queue commands of the application. Empty for a queue that probes do not use, and for one that the driver
    // synchronizes (VK_KHR_internally_synchronized_queues): there, vkQueueWaitIdle may wait for later submissions.
    [[nodiscard]] Lock lock(VkQueue queue) { return queue == queue_ ? lock() : Lock(); }
    // Locks every queue (vkDeviceWaitIdle).
    [[nodiscard]] Lock lock() { return isSynchronized_ ? Lock() : Lock(mutex_); }

private:
    class Submission;

    GpuContext context_;
    Reporter *report_ = nullptr;
    PFN_vkSetDeviceLoaderData setLoaderData_ = nullptr;
    std::chrono::seconds timeout_{};
    uint32_t family_ = 0;
    VkQueue queue_ = VK_NULL_HANDLE;
    bool isSynchronized_ = false; // by the driver
    std::timed_mutex mutex_;      // guards queue_
    std::mutex unfinishedMutex_;
    std::vector<std::unique_ptr<Submission>> unfinished_; // may still be in use by the GPU
};

} // namespace vellum::layer
