// SPDX-License-Identifier: Apache-2.0
// GPU validation: with the setting `validate`, the layer's shaders log findings about their input in host-visible
// memory. Commands that submit work or learn that work is complete report them.
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

// Bit of a logged object: it is an acceleration structure, not a VkMicromapEXT. Handles are pointers, so the bit is
// free.
inline constexpr uint64_t kStructureObject = 1;
constexpr uint64_t findingObject(VkObjectType type, uint64_t handle)
{
    return type == VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR ? handle | kStructureObject : handle;
}

// Reports one finding. `what`: kFinding* of core/records.h, which document the values.
void reportFinding(Reporter &report, uint32_t what, uint32_t triangle, uint32_t value0, uint32_t value1,
                   uint64_t object);

// One finding, as logged by the device.
struct LogEntry {
    uint32_t what, triangle, value0, value1;
    uint64_t object;
};

class GpuValidationLog
{
public:
    VkResult create(const GpuContext &context);
    // Address of the log, for push constants; 0 without GPU validation.
    [[nodiscard]] VkDeviceAddress address() const { return log_.address(); }
    // Reports the findings since the last call.
    void drain(Reporter &report);
    // Reports them and clears the log. The device must be idle until the call returns: in vkDeviceWaitIdle all queues
    // are externally synchronized, and probes do not log.
    void drainIdle(Reporter &report);

private:
    // Whether the log has grown. Takes no lock, because every poll of a fence calls it.
    [[nodiscard]] bool hasNew() const;
    // The next entry to report, if it is complete.
    std::optional<LogEntry> take();

    GpuBuffer log_;
    std::mutex mutex_;              // guards the members below; not held while messages are sent
    uint32_t reported_ = 0;         // entries
    std::atomic<uint32_t> seen_{0}; // logged findings, including those beyond the capacity; read without the mutex
    bool reportedOverflow_ = false;
};

VkResult queueWaitIdle(DeviceCommandBuffers &, VkQueue);
VkResult deviceWaitIdle(DeviceCommandBuffers &, VkDevice);
VkResult waitForFences(DeviceCommandBuffers &, VkDevice, uint32_t, const VkFence *, VkBool32, uint64_t);
VkResult getFenceStatus(DeviceCommandBuffers &, VkDevice, VkFence);
VkResult waitSemaphores(DeviceCommandBuffers &, VkDevice, const VkSemaphoreWaitInfo *, uint64_t);
VkResult queueSubmit(DeviceCommandBuffers &, VkQueue, uint32_t, const VkSubmitInfo *, VkFence);

} // namespace vellum::layer
