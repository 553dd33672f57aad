// What can only be found out about a driver by trying is tried on the device when something first depends on it: a
// device that never asks pays nothing.
//
// A trial runs on a queue of the application's, which may be using it meanwhile. So the application's own queue
// commands take ProbeQueue::lock(), and a trial only has the queue to itself while it is submitted. It does not wait
// for ever: the queue may be waiting for a semaphore that the application would signal next, in the very thread that
// asked.
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

// One thing to be tried. It keeps what the commands use until they have been carried out.
class Probe
{
public:
    virtual ~Probe() = default;
    // Returns false where the driver could not make what is needed: then nothing is submitted.
    virtual bool record(VkCommandBuffer commands) = 0;
    // After the commands were carried out.
    virtual void read() = 0;
};

class ProbeQueue
{
public:
    ProbeQueue();
    ~ProbeQueue();
    ProbeQueue(const ProbeQueue &) = delete;
    ProbeQueue &operator=(const ProbeQueue &) = delete;

    // Chooses one that can run compute shaders, while the device is being made. `info` as the application passed it to
    // vkCreateDevice.
    // `slow`: the device is a CPU, whose work may take long.
    void choose(const GpuContext &context, Reporter &report, bool slow,
                const std::vector<VkQueueFamilyProperties> &families, const VkDeviceCreateInfo &info,
                PFN_vkSetDeviceLoaderData setLoaderData);
    // False where the application asked for no such queue.
    [[nodiscard]] bool exists() const { return queue_ != VK_NULL_HANDLE; }

    // Returns whether everything was carried out. Any thread may call it, in any command but those of queues.
    bool run(std::unique_ptr<Probe> probe);

    using Lock = std::unique_lock<std::timed_mutex>;
    // To be held while the application has the queue; nothing is locked for a queue that trials do not use.
    [[nodiscard]] Lock lock(VkQueue queue) { return queue == queue_ ? Lock(mutex_) : Lock(); }
    // Of vkDeviceWaitIdle, which takes all queues.
    [[nodiscard]] Lock lock() { return Lock(mutex_); }

private:
    class Attempt;

    GpuContext context_;
    Reporter *report_ = nullptr;
    PFN_vkSetDeviceLoaderData setLoaderData_ = nullptr;
    std::chrono::seconds patience_{};
    uint32_t family_ = 0;
    VkQueue queue_ = VK_NULL_HANDLE;
    std::timed_mutex mutex_; // the queue's
    std::mutex unfinishedMutex_;
    std::vector<std::unique_ptr<Attempt>> unfinished_; // the GPU may still come to them
};

} // namespace vellum::layer
