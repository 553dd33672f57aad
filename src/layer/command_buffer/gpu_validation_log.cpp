// SPDX-License-Identifier: Apache-2.0
#include "layer/command_buffer/gpu_validation_log.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "core/records.h"
#include "layer/command_buffer/device_command_buffers.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

struct Text {
    const char *id;
    std::string text;
};

Text textOf(const LogEntry &e)
{
    const std::string triangle = "triangle " + std::to_string(e.triangle) + ": ";
    const std::string level = std::to_string(e.value1 & 0xffffu);
    const std::string format = std::to_string(e.value1 >> 16);
    const bool structure = (e.object & kStructureObject) != 0;
    switch (e.what) {
    case kFindingUnreadable:
        return {structure ? "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11554"
                          : "VELLUM-micromap-triangle-array",
                triangle + "lies outside the buffer of triangleArray"};
    case kFindingFormat:
        return {structure ? "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11555"
                          : "VELLUM-VUID-VkMicromapBuildInfoEXT-format-11657",
                triangle + "format " + format + " is neither 2-state nor 4-state"};
    case kFindingLevel:
        return {(e.value1 >> 16) == VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT
                    ? (structure ? "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11556"
                                 : "VELLUM-VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11659")
                    : (structure ? "VELLUM-VUID-VkAccelerationStructureBuildGeometryInfoKHR-subdivisionLevel-11566"
                                 : "VELLUM-VUID-VkMicromapBuildInfoEXT-subdivisionLevel-11660"),
                triangle + "subdivision level " + level + " is above 12"};
    case kFindingUndeclared:
        return {"VELLUM-micromap-usage-counts",
                triangle + "subdivision level " + level + " is not in the usage counts"};
    case kFindingData:
        return {structure ? "VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11553" : "VELLUM-micromap-data",
                triangle + "its data at offset " + std::to_string(e.value0) + " end outside the buffer of data"};
    case kFindingNoCapacity: return {"VELLUM-micromap-usage-counts", triangle + "more data than the usage counts say"};
    case kFindingCounts:
        return {"VELLUM-micromap-usage-counts", "the triangles have " + std::to_string(e.value1) +
                                                    " data units of 16 bytes, the usage counts say " +
                                                    std::to_string(e.value0)};
    case kFindingIndex:
        return {"VELLUM-micromap-index", triangle + "index " + std::to_string(static_cast<int32_t>(e.value0)) +
                                             " plus baseTriangle is outside the micromap's " +
                                             std::to_string(e.value1) + " triangles"};
    case kFindingIndexBuffer:
        return {"VELLUM-micromap-index", triangle + "its index lies outside the buffer of indexBuffer"};
    case kFindingNotBuilt:
        return {"VELLUM-micromap-not-constructed", "the micromap was not constructed before it is used"};
    case kFindingOverlap:
        return {"VELLUM-micromap-copy-overlap", "src and dst of a copy overlap; the target is as it was"};
    case kFindingTooLarge: return {"VELLUM-micromap-copy-size", "the target of a copy is too small"};
    default:
        return {structure ? "VELLUM-VUID-VkCopyMemoryToAccelerationStructureInfoKHR-src-04960"
                          : "VELLUM-VUID-VkCopyMemoryToMicromapInfoEXT-src-07549",
                "the source is not a serialized micromap of this version of the layer, or is cut off"};
    }
}

} // namespace

void reportFinding(Reporter &report, uint32_t what, uint32_t triangle, uint32_t value0, uint32_t value1,
                   uint64_t object)
{
    const Text text = textOf({what, triangle, value0, value1, object});
    const bool structure = (object & kStructureObject) != 0;
    report.error(text.id, text.text,
                 structure ? VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR : VK_OBJECT_TYPE_MICROMAP_EXT,
                 object & ~kStructureObject);
}

VkResult GpuValidationLog::create(const GpuContext &context)
{
    return log_.create(context, (kLogHeaderWords + kLogCapacity * kLogEntryWords) * 4);
}

bool GpuValidationLog::hasNew() const
{
    const uint32_t *words = log_.words();
    return words && __atomic_load_n(words + kLogCount, __ATOMIC_ACQUIRE) != seen_.load(std::memory_order_relaxed);
}

std::optional<LogEntry> GpuValidationLog::take()
{
    std::lock_guard lock(mutex_);
    const uint32_t *words = log_.words();
    const uint32_t logged = __atomic_load_n(words + kLogCount, __ATOMIC_ACQUIRE);
    if (reported_ == std::min(logged, kLogCapacity)) {
        seen_.store(logged, std::memory_order_relaxed);
        return std::nullopt;
    }
    const uint32_t *at = words + kLogHeaderWords + reported_ * kLogEntryWords;
    LogEntry entry{__atomic_load_n(at, __ATOMIC_ACQUIRE), at[1], at[2], at[3], 0};
    if (entry.what == 0)
        return std::nullopt; // still being written
    std::memcpy(&entry.object, at + 4, sizeof entry.object);
    ++reported_;
    return entry;
}

void GpuValidationLog::drain(Reporter &report)
{
    if (!hasNew())
        return;
    while (const auto entry = take())
        reportFinding(report, entry->what, entry->triangle, entry->value0, entry->value1, entry->object);
    bool overflows = false;
    {
        std::lock_guard lock(mutex_);
        overflows = seen_.load(std::memory_order_relaxed) > kLogCapacity && !reportedOverflow_;
        reportedOverflow_ |= overflows;
    }
    if (overflows)
        report.error("VELLUM-validation-log", "there are more findings than the " + std::to_string(kLogCapacity) +
                                                  " reported; further ones are reported after vkDeviceWaitIdle");
}

void GpuValidationLog::drainIdle(Reporter &report)
{
    drain(report);
    std::lock_guard lock(mutex_);
    if (reported_ == 0)
        return;
    std::memset(log_.words(), 0, (kLogHeaderWords + reported_ * kLogEntryWords) * 4);
    reported_ = 0;
    seen_.store(0, std::memory_order_relaxed);
    reportedOverflow_ = false;
}

VkResult queueWaitIdle(DeviceCommandBuffers &device, VkQueue queue)
{
    VkResult result;
    {
        const ProbeQueue::Lock lock = device.probes.lock(queue);
        result = device.driver.next.QueueWaitIdle(queue);
    }
    device.validationLog.drain(device.driver.report());
    return result;
}

VkResult deviceWaitIdle(DeviceCommandBuffers &device, VkDevice handle)
{
    VkResult result;
    {
        const ProbeQueue::Lock lock = device.probes.lock();
        result = device.driver.next.DeviceWaitIdle(handle);
    }
    if (result == VK_SUCCESS)
        device.validationLog.drainIdle(device.driver.report());
    return result;
}

VkResult waitForFences(DeviceCommandBuffers &device, VkDevice handle, uint32_t count, const VkFence *fences,
                       VkBool32 all, uint64_t timeout)
{
    const VkResult result = device.driver.next.WaitForFences(handle, count, fences, all, timeout);
    device.validationLog.drain(device.driver.report());
    return result;
}

VkResult getFenceStatus(DeviceCommandBuffers &device, VkDevice handle, VkFence fence)
{
    const VkResult result = device.driver.next.GetFenceStatus(handle, fence);
    device.validationLog.drain(device.driver.report());
    return result;
}

VkResult waitSemaphores(DeviceCommandBuffers &device, VkDevice handle, const VkSemaphoreWaitInfo *info,
                        uint64_t timeout)
{
    const VkResult result = device.driver.next.WaitSemaphores(handle, info, timeout);
    device.validationLog.drain(device.driver.report());
    return result;
}

VkResult queueSubmit(DeviceCommandBuffers &device, VkQueue queue, uint32_t count, const VkSubmitInfo *submits,
                     VkFence fence)
{
    device.validationLog.drain(device.driver.report());
    const ProbeQueue::Lock lock = device.probes.lock(queue);
    return device.driver.next.QueueSubmit(queue, count, submits, fence);
}

} // namespace vellum::layer
