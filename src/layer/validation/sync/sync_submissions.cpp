// SPDX-License-Identifier: Apache-2.0
// Submissions, transfers of buffers, and what the host learns of the progress of queues.
#include "layer/base/pnext.h"
#include "layer/validation/device_validation.h"
#include "layer/validation/sync/sync_accesses.h"
#include "layer/validation/sync/sync_commands.h"
#include "layer/validation/sync/sync_ranges.h"
#include "layer/validation/sync/sync_report.h"

namespace vellum::layer
{
namespace sync
{
namespace
{

std::optional<uint64_t> valueOf(const DeviceValidation &device, VkSemaphore semaphore, uint64_t value)
{
    return device.sync.timelines.get(semaphore) ? std::optional(value) : std::nullopt;
}

std::vector<SemaphoreUse> usesOf(const DeviceValidation &device, uint32_t count, const VkSemaphore *semaphores,
                                 const VkPipelineStageFlags *stages, uint32_t valueCount, const uint64_t *values)
{
    std::vector<SemaphoreUse> uses;
    for (uint32_t i = 0; i < count; ++i)
        uses.push_back({uint64_t(semaphores[i]),
                        valueOf(device, semaphores[i], values && i < valueCount ? values[i] : 0),
                        stages ? stages[i] : VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT});
    return uses;
}

std::vector<SemaphoreUse> usesOf(const DeviceValidation &device, uint32_t count, const VkSemaphoreSubmitInfo *infos)
{
    std::vector<SemaphoreUse> uses;
    for (uint32_t i = 0; i < count; ++i)
        uses.push_back(
            {uint64_t(infos[i].semaphore), valueOf(device, infos[i].semaphore, infos[i].value), infos[i].stageMask});
    return uses;
}

const VkTimelineSemaphoreSubmitInfo *valuesOf(const VkSubmitInfo &submit)
{
    return findInChain<VkTimelineSemaphoreSubmitInfo>(submit.pNext, VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO);
}

} // namespace

std::vector<SemaphoreUse> waitsOf(const DeviceValidation &device, const VkSubmitInfo &submit)
{
    const auto *values = valuesOf(submit);
    return usesOf(device, submit.waitSemaphoreCount, submit.pWaitSemaphores, submit.pWaitDstStageMask,
                  values ? values->waitSemaphoreValueCount : 0, values ? values->pWaitSemaphoreValues : nullptr);
}

std::vector<SemaphoreUse> waitsOf(const DeviceValidation &device, const VkSubmitInfo2 &submit)
{
    return usesOf(device, submit.waitSemaphoreInfoCount, submit.pWaitSemaphoreInfos);
}

std::vector<SemaphoreUse> signalsOf(const DeviceValidation &device, const VkSubmitInfo &submit)
{
    const auto *values = valuesOf(submit);
    return usesOf(device, submit.signalSemaphoreCount, submit.pSignalSemaphores, nullptr,
                  values ? values->signalSemaphoreValueCount : 0, values ? values->pSignalSemaphoreValues : nullptr);
}

std::vector<SemaphoreUse> signalsOf(const DeviceValidation &device, const VkSubmitInfo2 &submit)
{
    return usesOf(device, submit.signalSemaphoreInfoCount, submit.pSignalSemaphoreInfos);
}

void beginBatch(DeviceValidation &device, VkQueue queue, const std::vector<SemaphoreUse> &waits)
{
    if (device.checks.sync)
        device.sync.tracker.beginBatch(uint64_t(queue), device.objects.queueFamilies.get(queue), waits);
}

void endBatch(DeviceValidation &device, VkQueue queue, const std::vector<SemaphoreUse> &signals)
{
    if (device.checks.sync)
        device.sync.tracker.endBatch(uint64_t(queue), signals);
}

void signalFence(DeviceValidation &device, VkQueue queue, VkFence fence)
{
    if (device.checks.sync && fence)
        device.sync.tracker.signalFence(uint64_t(queue), uint64_t(fence));
}

void fencesComplete(DeviceValidation &device, VkDevice handle, uint32_t count, const VkFence *fences, bool all)
{
    for (uint32_t i = 0; device.checks.sync && i < count; ++i) {
        if (all || device.next.GetFenceStatus(handle, fences[i]) == VK_SUCCESS)
            device.sync.tracker.fenceComplete(uint64_t(fences[i]));
    }
}

void semaphoresReached(DeviceValidation &device, VkDevice handle, const VkSemaphoreWaitInfo &info)
{
    device.logs.settle();
    const bool all = info.semaphoreCount == 1 || (info.flags & VK_SEMAPHORE_WAIT_ANY_BIT) == 0;
    for (uint32_t i = 0; device.checks.sync && i < info.semaphoreCount; ++i) {
        uint64_t value = info.pValues[i];
        if (all || (device.next.GetSemaphoreCounterValue(handle, info.pSemaphores[i], &value) == VK_SUCCESS &&
                    value >= info.pValues[i]))
            device.sync.tracker.semaphoreReached(uint64_t(info.pSemaphores[i]), value);
    }
}

void checkDestruction(DeviceValidation &device, const char *command, const char *rule,
                      const ValidatedStructure *structure)
{
    if (!device.checks.sync || !structure)
        return;
    if (const auto use = device.sync.tracker.pendingUse(locationOf(structure).range, structure->handle))
        device.fault(Place(command), rule,
                     device.nameOf(structure->handle) + " is used by " + placeOf(*use) +
                         ", which is not known to be complete",
                     structure->handle);
}

void checkDestruction(DeviceValidation &device, const ValidatedBuffer *buffer)
{
    if (!device.checks.sync || !buffer)
        return;
    const Range range = rangeIn(device, buffer->handle, 0, buffer->size);
    if (const auto use = device.sync.tracker.pendingUse(range, buffer->handle))
        device.fault(Place("vkDestroyBuffer"), "VUID-vkDestroyBuffer-buffer-00922",
                     device.nameOf(buffer->handle) + " is used by " + placeOf(*use) + " (" + use->subject +
                         "), which is not known to be complete",
                     buffer->handle);
}

void checkFree(DeviceValidation &device, VkDeviceMemory memory)
{
    const auto use = device.sync.tracker.freeMemory(uint64_t(memory));
    if (use && device.checks.sync)
        device.fault(Place("vkFreeMemory"), "VUID-vkFreeMemory-memory-00677",
                     "memory is used by " + placeOf(*use) + " (" + use->subject + " " + device.nameOf(use->object) +
                         "), which is not known to be complete",
                     {VK_OBJECT_TYPE_DEVICE_MEMORY, uint64_t(memory)});
}

} // namespace sync

namespace validation
{
namespace
{

void allIdle(DeviceValidation &device)
{
    device.logs.settle();
    device.sync.tracker.allIdle();
}

} // namespace

// ------------------------------------------------------------------------------------------ transfers

void cmdCopyBuffer(DeviceValidation &device, VkCommandBuffer commandBuffer, VkBuffer from, VkBuffer to, uint32_t count,
                   const VkBufferCopy *regions)
{
    for (uint32_t r = 0; r < count; ++r)
        sync::recordCopy(device, commandBuffer, "vkCmdCopyBuffer", from, to, regions[r], r);
    device.next.CmdCopyBuffer(commandBuffer, from, to, count, regions);
}

void cmdCopyBuffer2(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkCopyBufferInfo2 *info)
{
    for (uint32_t r = 0; r < info->regionCount; ++r) {
        const VkBufferCopy2 &region = info->pRegions[r];
        sync::recordCopy(device, commandBuffer, "vkCmdCopyBuffer2", info->srcBuffer, info->dstBuffer,
                         {region.srcOffset, region.dstOffset, region.size}, r);
    }
    device.next.CmdCopyBuffer2(commandBuffer, info);
}

void cmdFillBuffer(DeviceValidation &device, VkCommandBuffer commandBuffer, VkBuffer buffer, VkDeviceSize offset,
                   VkDeviceSize size, uint32_t data)
{
    sync::recordWrite(device, commandBuffer, "vkCmdFillBuffer", buffer, offset, size);
    device.next.CmdFillBuffer(commandBuffer, buffer, offset, size, data);
}

void cmdUpdateBuffer(DeviceValidation &device, VkCommandBuffer commandBuffer, VkBuffer buffer, VkDeviceSize offset,
                     VkDeviceSize size, const void *data)
{
    sync::recordWrite(device, commandBuffer, "vkCmdUpdateBuffer", buffer, offset, size);
    device.next.CmdUpdateBuffer(commandBuffer, buffer, offset, size, data);
}

// ------------------------------------------------------------------------------------------ the host

VkResult resetFences(DeviceValidation &device, VkDevice handle, uint32_t count, const VkFence *fences)
{
    const VkResult result = device.next.ResetFences(handle, count, fences);
    for (uint32_t i = 0; result == VK_SUCCESS && i < count; ++i)
        device.sync.tracker.forgetFence(uint64_t(fences[i]));
    return result;
}

void destroyFence(DeviceValidation &device, VkDevice handle, VkFence fence, const VkAllocationCallbacks *allocator)
{
    device.sync.tracker.forgetFence(uint64_t(fence));
    device.next.DestroyFence(handle, fence, allocator);
}

VkResult createSemaphore(DeviceValidation &device, VkDevice handle, const VkSemaphoreCreateInfo *info,
                         const VkAllocationCallbacks *allocator, VkSemaphore *semaphore)
{
    const VkResult result = device.next.CreateSemaphore(handle, info, allocator, semaphore);
    const auto *type =
        findInChain<VkSemaphoreTypeCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO);
    if (result == VK_SUCCESS && type && type->semaphoreType == VK_SEMAPHORE_TYPE_TIMELINE)
        remember([&] {
            device.sync.timelines.set(*semaphore, true);
            device.sync.tracker.hostSignal(uint64_t(*semaphore), type->initialValue);
        });
    return result;
}

void destroySemaphore(DeviceValidation &device, VkDevice handle, VkSemaphore semaphore,
                      const VkAllocationCallbacks *allocator)
{
    device.sync.timelines.take(semaphore);
    {
        const std::lock_guard lock(device.logs.submissions);
        device.logs.signals.erase(uint64_t(semaphore));
    }
    device.sync.tracker.forgetSemaphore(uint64_t(semaphore));
    device.next.DestroySemaphore(handle, semaphore, allocator);
}

VkResult signalSemaphore(DeviceValidation &device, VkDevice handle, const VkSemaphoreSignalInfo *info)
{
    // Known before the driver signals it, as a host wait may end then. CommandLogs::submissions is not held: a
    // submission may hold it in the driver until this signal.
    remember([&] { device.sync.tracker.hostSignal(uint64_t(info->semaphore), info->value); });
    const VkResult result = device.next.SignalSemaphore(handle, info);
    if (result != VK_SUCCESS)
        device.sync.tracker.undoHostSignal(uint64_t(info->semaphore), info->value);
    return result;
}

// Results and events also show that commands are complete; of which queue is not known.
VkResult getQueryPoolResults(DeviceValidation &device, VkDevice handle, VkQueryPool pool, uint32_t first,
                             uint32_t count, size_t size, void *data, VkDeviceSize stride, VkQueryResultFlags flags)
{
    const VkResult result = device.next.GetQueryPoolResults(handle, pool, first, count, size, data, stride, flags);
    if (result == VK_SUCCESS)
        allIdle(device);
    return result;
}

VkResult getEventStatus(DeviceValidation &device, VkDevice handle, VkEvent event)
{
    const VkResult result = device.next.GetEventStatus(handle, event);
    if (result == VK_EVENT_SET)
        allIdle(device);
    return result;
}

// Once the host changes or destroys an event, a later wait for it is not ordered after the commands that set it before.
VkResult setEvent(DeviceValidation &device, VkDevice handle, VkEvent event)
{
    device.sync.tracker.resetEvent(uint64_t(event));
    return device.next.SetEvent(handle, event);
}

VkResult resetEvent(DeviceValidation &device, VkDevice handle, VkEvent event)
{
    device.sync.tracker.resetEvent(uint64_t(event));
    return device.next.ResetEvent(handle, event);
}

void destroyEvent(DeviceValidation &device, VkDevice handle, VkEvent event, const VkAllocationCallbacks *allocator)
{
    device.sync.tracker.resetEvent(uint64_t(event));
    device.next.DestroyEvent(handle, event, allocator);
}

} // namespace validation
} // namespace vellum::layer
