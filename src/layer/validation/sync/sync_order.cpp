// SPDX-License-Identifier: Apache-2.0
// What orders commands: barriers, events, semaphores, fences, and what the host learns of the progress of queues.
#include <functional>

#include "layer/base/pnext.h"
#include "layer/validation/sync/sync_checks.h"

namespace vellum::layer::sync
{
namespace
{

// The barriers of a command, as the tracker has them.
struct Dependency {
    std::vector<Barrier> barriers;
    std::vector<Transfer> transfers;

    void addMemory(VkPipelineStageFlags2 from, VkAccessFlags2 fromAccess, VkPipelineStageFlags2 to,
                   VkAccessFlags2 toAccess)
    {
        const Barrier barrier{firstScope(from, fromAccess), secondScope(to, toAccess), {}};
        barriers.push_back(barrier);
    }
    void addRange(VkPipelineStageFlags2 from, VkAccessFlags2 fromAccess, VkPipelineStageFlags2 to,
                  VkAccessFlags2 toAccess, const Range &range)
    {
        addMemory(from, fromAccess, to, toAccess);
        barriers.back().range = range; // one that is unknown: all memory
    }
    void addTransfer(uint32_t from, uint32_t to, const Range &range)
    {
        if (from != to)
            transfers.push_back({to, range});
    }
    void addBuffer(const DeviceModel &device, const VkBufferMemoryBarrier &barrier, VkPipelineStageFlags2 from,
                   VkPipelineStageFlags2 to)
    {
        const auto range = rangeIn(device, barrier.buffer, barrier.offset, barrier.size);
        addRange(from, barrier.srcAccessMask, to, barrier.dstAccessMask, range);
        addTransfer(barrier.srcQueueFamilyIndex, barrier.dstQueueFamilyIndex, range);
    }
};

Dependency dependencyOf(const DeviceModel &device, const PipelineBarrier &barrier)
{
    const auto &[from, to, memoryCount, memory, bufferCount, buffers] = barrier;
    Dependency dependency;
    for (uint32_t i = 0; i < memoryCount; ++i)
        dependency.addMemory(from, memory[i].srcAccessMask, to, memory[i].dstAccessMask);
    for (uint32_t i = 0; i < bufferCount; ++i)
        dependency.addBuffer(device, buffers[i], from, to);
    if (memoryCount == 0)
        dependency.addMemory(from, 0, to, 0);
    return dependency;
}

Range checkedRange(const DeviceModel &device, const VkDeviceAddressRangeKHR &range)
{
    return locationAt(device, range.address, range.size).range;
}

Dependency dependencyOf(const DeviceModel &device, const VkDependencyInfo &info)
{
    Dependency dependency;
    for (uint32_t i = 0; i < info.memoryBarrierCount; ++i) {
        const VkMemoryBarrier2 &b = info.pMemoryBarriers[i];
        dependency.addMemory(b.srcStageMask, b.srcAccessMask, b.dstStageMask, b.dstAccessMask);
    }
    for (uint32_t i = 0; i < info.bufferMemoryBarrierCount; ++i) {
        const VkBufferMemoryBarrier2 &b = info.pBufferMemoryBarriers[i];
        const auto range = rangeIn(device, b.buffer, b.offset, b.size);
        dependency.addRange(b.srcStageMask, b.srcAccessMask, b.dstStageMask, b.dstAccessMask, range);
        dependency.addTransfer(b.srcQueueFamilyIndex, b.dstQueueFamilyIndex, range);
    }
    for (uint32_t i = 0; i < info.imageMemoryBarrierCount; ++i)
        dependency.addMemory(info.pImageMemoryBarriers[i].srcStageMask, 0, info.pImageMemoryBarriers[i].dstStageMask,
                             0);
    const auto *ranges =
        findInChain<VkMemoryRangeBarriersInfoKHR>(info.pNext, VK_STRUCTURE_TYPE_MEMORY_RANGE_BARRIERS_INFO_KHR);
    for (uint32_t i = 0; ranges && i < ranges->memoryRangeBarrierCount; ++i) {
        const VkMemoryRangeBarrierKHR &b = ranges->pMemoryRangeBarriers[i];
        const auto range = checkedRange(device, b.addressRange);
        dependency.addRange(b.srcStageMask, b.srcAccessMask, b.dstStageMask, b.dstAccessMask, range);
        dependency.addTransfer(b.srcQueueFamilyIndex, b.dstQueueFamilyIndex, range);
    }
    return dependency;
}

using Order = std::function<void(Tracker &, QueueKey)>;

void record(DeviceSync &sync, VkCommandBuffer commandBuffer, Order order)
{
    if (sync.device.checks.sync)
        sync.device.logs.add(commandBuffer, [&sync, order = std::move(order)](const Submission &submission) {
            order(sync.tracker, uint64_t(submission.queue));
        });
}

void addBarriers(DeviceSync &sync, VkCommandBuffer commandBuffer, Dependency dependency)
{
    record(sync, commandBuffer, [dependency = std::move(dependency)](Tracker &tracker, QueueKey queue) {
        tracker.barriers(queue, dependency.barriers);
        tracker.transfers(queue, dependency.transfers);
    });
}

void addWait(DeviceSync &sync, VkCommandBuffer commandBuffer, VkEvent event, Dependency dependency)
{
    record(sync, commandBuffer, [event, dependency = std::move(dependency)](Tracker &tracker, QueueKey queue) {
        tracker.waitEvent(queue, uint64_t(event), dependency.barriers);
        tracker.transfers(queue, dependency.transfers);
    });
}

std::optional<uint64_t> valueOf(const DeviceSync &sync, VkSemaphore semaphore, uint64_t value)
{
    return sync.timelines.get(semaphore) ? std::optional(value) : std::nullopt;
}

std::vector<SemaphoreUse> usesOf(const DeviceSync &sync, uint32_t count, const VkSemaphore *semaphores,
                                 const VkPipelineStageFlags *stages, uint32_t valueCount, const uint64_t *values)
{
    std::vector<SemaphoreUse> uses;
    for (uint32_t i = 0; i < count; ++i)
        uses.push_back({uint64_t(semaphores[i]), valueOf(sync, semaphores[i], values && i < valueCount ? values[i] : 0),
                        stages ? stages[i] : VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT});
    return uses;
}

std::vector<SemaphoreUse> usesOf(const DeviceSync &sync, uint32_t count, const VkSemaphoreSubmitInfo *infos)
{
    std::vector<SemaphoreUse> uses;
    for (uint32_t i = 0; i < count; ++i)
        uses.push_back(
            {uint64_t(infos[i].semaphore), valueOf(sync, infos[i].semaphore, infos[i].value), infos[i].stageMask});
    return uses;
}

const VkTimelineSemaphoreSubmitInfo *valuesOf(const VkSubmitInfo &submit)
{
    return findInChain<VkTimelineSemaphoreSubmitInfo>(submit.pNext, VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO);
}

} // namespace

void recordBarriers(DeviceSync &sync, VkCommandBuffer commandBuffer, const VkDependencyInfo &info)
{
    addBarriers(sync, commandBuffer, dependencyOf(sync.device, info));
}

void recordSet(DeviceSync &sync, VkCommandBuffer commandBuffer, VkEvent event)
{
    record(sync, commandBuffer,
           [event](Tracker &tracker, QueueKey queue) { tracker.setEvent(queue, uint64_t(event)); });
}

void recordReset(DeviceSync &sync, VkCommandBuffer commandBuffer, VkEvent event)
{
    record(sync, commandBuffer, [event](Tracker &tracker, QueueKey) { tracker.resetEvent(uint64_t(event)); });
}

void recordWait(DeviceSync &sync, VkCommandBuffer commandBuffer, uint32_t count, const VkEvent *events,
                const VkDependencyInfo *infos)
{
    for (uint32_t e = 0; e < count; ++e)
        addWait(sync, commandBuffer, events[e], dependencyOf(sync.device, infos[e]));
}

void recordBarriers(DeviceSync &sync, VkCommandBuffer commandBuffer, const PipelineBarrier &barrier)
{
    addBarriers(sync, commandBuffer, dependencyOf(sync.device, barrier));
}

void recordAll(DeviceSync &sync, VkCommandBuffer commandBuffer)
{
    constexpr VkAccessFlags kAny = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT;
    const VkMemoryBarrier memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, kAny, kAny};
    recordBarriers(sync, commandBuffer,
                   PipelineBarrier{VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 1, &memory,
                                   0, nullptr});
}

void recordWait(DeviceSync &sync, VkCommandBuffer commandBuffer, uint32_t count, const VkEvent *events,
                const PipelineBarrier &barrier)
{
    for (uint32_t e = 0; e < count; ++e)
        addWait(sync, commandBuffer, events[e], dependencyOf(sync.device, barrier));
}

std::vector<SemaphoreUse> waitsOf(const DeviceSync &sync, const VkSubmitInfo &submit)
{
    const auto *values = valuesOf(submit);
    return usesOf(sync, submit.waitSemaphoreCount, submit.pWaitSemaphores, submit.pWaitDstStageMask,
                  values ? values->waitSemaphoreValueCount : 0, values ? values->pWaitSemaphoreValues : nullptr);
}

std::vector<SemaphoreUse> waitsOf(const DeviceSync &sync, const VkSubmitInfo2 &submit)
{
    return usesOf(sync, submit.waitSemaphoreInfoCount, submit.pWaitSemaphoreInfos);
}

std::vector<SemaphoreUse> signalsOf(const DeviceSync &sync, const VkSubmitInfo &submit)
{
    const auto *values = valuesOf(submit);
    return usesOf(sync, submit.signalSemaphoreCount, submit.pSignalSemaphores, nullptr,
                  values ? values->signalSemaphoreValueCount : 0, values ? values->pSignalSemaphoreValues : nullptr);
}

std::vector<SemaphoreUse> signalsOf(const DeviceSync &sync, const VkSubmitInfo2 &submit)
{
    return usesOf(sync, submit.signalSemaphoreInfoCount, submit.pSignalSemaphoreInfos);
}

void beginBatch(DeviceSync &sync, VkQueue queue, const std::vector<SemaphoreUse> &waits)
{
    if (sync.device.checks.sync)
        sync.tracker.beginBatch(uint64_t(queue), sync.device.objects.queueFamilies.get(queue), waits);
}

void endBatch(DeviceSync &sync, VkQueue queue, const std::vector<SemaphoreUse> &signals)
{
    if (sync.device.checks.sync)
        sync.tracker.endBatch(uint64_t(queue), signals);
}

void signalFence(DeviceSync &sync, VkQueue queue, VkFence fence)
{
    if (sync.device.checks.sync && fence)
        sync.tracker.signalFence(uint64_t(queue), uint64_t(fence));
}

void fencesComplete(DeviceSync &sync, VkDevice handle, uint32_t count, const VkFence *fences, bool all)
{
    for (uint32_t i = 0; sync.device.checks.sync && i < count; ++i) {
        if (all || sync.device.next.GetFenceStatus(handle, fences[i]) == VK_SUCCESS)
            sync.tracker.fenceComplete(uint64_t(fences[i]));
    }
}

void semaphoresReached(DeviceSync &sync, VkDevice handle, const VkSemaphoreWaitInfo &info)
{
    sync.device.logs.settle();
    const bool all = info.semaphoreCount == 1 || (info.flags & VK_SEMAPHORE_WAIT_ANY_BIT) == 0;
    for (uint32_t i = 0; sync.device.checks.sync && i < info.semaphoreCount; ++i) {
        uint64_t value = info.pValues[i];
        if (all || (sync.device.next.GetSemaphoreCounterValue(handle, info.pSemaphores[i], &value) == VK_SUCCESS &&
                    value >= info.pValues[i]))
            sync.tracker.semaphoreReached(uint64_t(info.pSemaphores[i]), value);
    }
}

void checkDestruction(DeviceSync &sync, const char *command, const char *rule, const ValidatedStructure *structure)
{
    if (!sync.device.checks.sync || !structure)
        return;
    if (const auto use = sync.tracker.pendingUse(locationOf(structure).range, structure->handle))
        sync.device.fault(Place(command), rule,
                          sync.device.nameOf(structure->handle) + " is used by " + placeOf(*use) +
                              ", which is not known to be complete",
                          structure->handle);
}

void checkDestruction(DeviceSync &sync, const ValidatedBuffer *buffer)
{
    if (!sync.device.checks.sync || !buffer)
        return;
    const Range range = rangeIn(sync.device, buffer->handle, 0, buffer->size);
    if (const auto use = sync.tracker.pendingUse(range, buffer->handle))
        sync.device.fault(Place("vkDestroyBuffer"), "VUID-vkDestroyBuffer-buffer-00922",
                          sync.device.nameOf(buffer->handle) + " is used by " + placeOf(*use) + " (" + use->subject +
                              "), which is not known to be complete",
                          buffer->handle);
}

void checkFree(DeviceSync &sync, VkDeviceMemory memory)
{
    const auto use = sync.tracker.freeMemory(uint64_t(memory));
    if (use && sync.device.checks.sync)
        sync.device.fault(Place("vkFreeMemory"), "VUID-vkFreeMemory-memory-00677",
                          "memory is used by " + placeOf(*use) + " (" + use->subject + " " +
                              sync.device.nameOf(use->object) + "), which is not known to be complete",
                          {VK_OBJECT_TYPE_DEVICE_MEMORY, uint64_t(memory)});
}

} // namespace vellum::layer::sync
