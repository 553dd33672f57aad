// Wrong input that only the device sees: with the setting `validate`, the layer's shaders log it in host-visible
// memory, and the host tells of it where it learns that work is done, or hands in more work.
#pragma once

#include <atomic>
#include <mutex>
#include <optional>

#include <vulkan/vulkan.h>

#include "layer/base/report.h"
#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

struct DeviceCommandBuffers;

// What the log names a micromap by: its handle, which is a pointer, and this bit where it is an acceleration structure.
inline constexpr uint64_t kStructureObject = 1;
constexpr uint64_t findingObject(VkObjectType type, uint64_t handle)
{
    return type == VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR ? handle | kStructureObject : handle;
}

// Tells of one wrong input; what: kComplaint* of core/records.h, which say what the values are.
void reportFinding(Reporter &report, uint32_t what, uint32_t triangle, uint32_t value0, uint32_t value1,
                   uint64_t object);

// One wrong input, as the device has logged it.
struct LogEntry {
    uint32_t what, triangle, value0, value1;
    uint64_t object;
};

class GpuValidationLog
{
public:
    VkResult create(const GpuContext &context);
    // Of the log, for push constants; 0 where nothing is validated.
    [[nodiscard]] VkDeviceAddress address() const { return log_.address(); }
    // Reports what the device has logged since the last call, each entry once.
    void drain(Reporter &report);
    // The same while the device does nothing, and cannot begin to: then the log can begin anew. vkDeviceWaitIdle has
    // all queues to itself until it returns ("externally synchronized"), and the layer's own trials do not log.
    void drainIdle(Reporter &report);

private:
    // Whether the log has grown. Every poll of a fence asks, so no lock is taken.
    [[nodiscard]] bool hasNew() const;
    // The next entry to be reported; none, where there are no more yet.
    std::optional<LogEntry> take();

    GpuBuffer log_;
    std::mutex mutex_;              // guards what is below; not held while messages are sent
    uint32_t reported_ = 0;         // entries
    std::atomic<uint32_t> seen_{0}; // of all that were logged, also beyond the log's end; read without the mutex
    bool reportedOverflow_ = false;
};

VkResult queueWaitIdle(DeviceCommandBuffers &, VkQueue);
VkResult deviceWaitIdle(DeviceCommandBuffers &, VkDevice);
VkResult waitForFences(DeviceCommandBuffers &, VkDevice, uint32_t, const VkFence *, VkBool32, uint64_t);
VkResult getFenceStatus(DeviceCommandBuffers &, VkDevice, VkFence);
VkResult waitSemaphores(DeviceCommandBuffers &, VkDevice, const VkSemaphoreWaitInfo *, uint64_t);
VkResult queueSubmit(DeviceCommandBuffers &, VkQueue, uint32_t, const VkSubmitInfo *, VkFence);

} // namespace vellum::layer
