// SPDX-License-Identifier: Apache-2.0
// Barriers and events of command buffers.
#include <functional>

#include "layer/base/pnext.h"
#include "layer/validation/device_validation.h"
#include "layer/validation/sync/sync_commands.h"
#include "layer/validation/sync/sync_ranges.h"

namespace vellum::layer
{
namespace
{

using sync::Barrier;
using sync::Transfer;

// The barriers of a command, as the tracker has them.
struct Dependency {
    std::vector<Barrier> barriers;
    std::vector<Transfer> transfers;

    void addMemory(VkPipelineStageFlags2 from, VkAccessFlags2 fromAccess, VkPipelineStageFlags2 to,
                   VkAccessFlags2 toAccess)
    {
        const Barrier barrier{sync::firstScope(from, fromAccess), sync::secondScope(to, toAccess), {}};
        barriers.push_back(barrier);
    }
    void addRange(VkPipelineStageFlags2 from, VkAccessFlags2 fromAccess, VkPipelineStageFlags2 to,
                  VkAccessFlags2 toAccess, const sync::Range &range)
    {
        addMemory(from, fromAccess, to, toAccess);
        barriers.back().range = range; // one that is unknown: all memory
    }
    void addTransfer(uint32_t from, uint32_t to, const sync::Range &range)
    {
        if (from != to)
            transfers.push_back({to, range});
    }
    void addBuffer(const DeviceValidation &device, const VkBufferMemoryBarrier &barrier, VkPipelineStageFlags2 from,
                   VkPipelineStageFlags2 to)
    {
        const auto range = sync::rangeIn(device, barrier.buffer, barrier.offset, barrier.size);
        addRange(from, barrier.srcAccessMask, to, barrier.dstAccessMask, range);
        addTransfer(barrier.srcQueueFamilyIndex, barrier.dstQueueFamilyIndex, range);
    }
};

Dependency dependencyOf(const DeviceValidation &device, VkPipelineStageFlags from, VkPipelineStageFlags to,
                        uint32_t memoryCount, const VkMemoryBarrier *memory, uint32_t bufferCount,
                        const VkBufferMemoryBarrier *buffers)
{
    Dependency dependency;
    for (uint32_t i = 0; i < memoryCount; ++i)
        dependency.addMemory(from, memory[i].srcAccessMask, to, memory[i].dstAccessMask);
    for (uint32_t i = 0; i < bufferCount; ++i)
        dependency.addBuffer(device, buffers[i], from, to);
    if (memoryCount == 0)
        dependency.addMemory(from, 0, to, 0);
    return dependency;
}

sync::Range rangeOf(const DeviceValidation &device, const VkDeviceAddressRangeKHR &range)
{
    return sync::locationAt(device, range.address, range.size).range;
}

Dependency dependencyOf(const DeviceValidation &device, const VkDependencyInfo &info)
{
    Dependency dependency;
    for (uint32_t i = 0; i < info.memoryBarrierCount; ++i) {
        const VkMemoryBarrier2 &b = info.pMemoryBarriers[i];
        dependency.addMemory(b.srcStageMask, b.srcAccessMask, b.dstStageMask, b.dstAccessMask);
    }
    for (uint32_t i = 0; i < info.bufferMemoryBarrierCount; ++i) {
        const VkBufferMemoryBarrier2 &b = info.pBufferMemoryBarriers[i];
        const auto range = sync::rangeIn(device, b.buffer, b.offset, b.size);
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
        const auto range = rangeOf(device, b.addressRange);
        dependency.addRange(b.srcStageMask, b.srcAccessMask, b.dstStageMask, b.dstAccessMask, range);
        dependency.addTransfer(b.srcQueueFamilyIndex, b.dstQueueFamilyIndex, range);
    }
    return dependency;
}

using Order = std::function<void(sync::Tracker &, sync::QueueKey)>;

void record(DeviceValidation &device, VkCommandBuffer commandBuffer, Order order)
{
    if (device.checks.sync)
        device.logs.add(commandBuffer, [&device, order = std::move(order)](const Submission &submission) {
            order(device.sync.tracker, uint64_t(submission.queue));
        });
}

void addBarriers(DeviceValidation &device, VkCommandBuffer commandBuffer, Dependency dependency)
{
    record(device, commandBuffer, [dependency = std::move(dependency)](sync::Tracker &tracker, sync::QueueKey queue) {
        tracker.barriers(queue, dependency.barriers);
        tracker.transfers(queue, dependency.transfers);
    });
}

void addWait(DeviceValidation &device, VkCommandBuffer commandBuffer, VkEvent event, Dependency dependency)
{
    record(device, commandBuffer,
           [event, dependency = std::move(dependency)](sync::Tracker &tracker, sync::QueueKey queue) {
               tracker.waitEvent(queue, uint64_t(event), dependency.barriers);
               tracker.transfers(queue, dependency.transfers);
           });
}

} // namespace

namespace sync
{

void recordBarriers(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkDependencyInfo &info)
{
    addBarriers(device, commandBuffer, dependencyOf(device, info));
}

void recordSet(DeviceValidation &device, VkCommandBuffer commandBuffer, VkEvent event)
{
    record(device, commandBuffer,
           [event](Tracker &tracker, QueueKey queue) { tracker.setEvent(queue, uint64_t(event)); });
}

void recordReset(DeviceValidation &device, VkCommandBuffer commandBuffer, VkEvent event)
{
    record(device, commandBuffer, [event](Tracker &tracker, QueueKey) { tracker.resetEvent(uint64_t(event)); });
}

void recordWait(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count, const VkEvent *events,
                const VkDependencyInfo *infos)
{
    for (uint32_t e = 0; e < count; ++e)
        addWait(device, commandBuffer, events[e], dependencyOf(device, infos[e]));
}

} // namespace sync

namespace validation
{
namespace
{

// Subpass dependencies may order anything, and are not followed.
void recordAll(DeviceValidation &device, VkCommandBuffer commandBuffer)
{
    constexpr VkAccessFlags kAny = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT;
    const VkMemoryBarrier memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, kAny, kAny};
    addBarriers(device, commandBuffer,
                dependencyOf(device, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 1, &memory,
                             0, nullptr));
}

} // namespace

void cmdPipelineBarrier(DeviceValidation &device, VkCommandBuffer commandBuffer, VkPipelineStageFlags from,
                        VkPipelineStageFlags to, VkDependencyFlags flags, uint32_t memoryCount,
                        const VkMemoryBarrier *memory, uint32_t bufferCount, const VkBufferMemoryBarrier *buffers,
                        uint32_t imageCount, const VkImageMemoryBarrier *images)
{
    addBarriers(device, commandBuffer, dependencyOf(device, from, to, memoryCount, memory, bufferCount, buffers));
    device.next.CmdPipelineBarrier(commandBuffer, from, to, flags, memoryCount, memory, bufferCount, buffers,
                                   imageCount, images);
}

namespace
{

void setRendering(DeviceValidation &device, VkCommandBuffer commandBuffer, bool isRendering)
{
    if (const auto log = device.logs.get(commandBuffer))
        log->isRendering = isRendering;
}

void endRendering(DeviceValidation &device, VkCommandBuffer commandBuffer)
{
    setRendering(device, commandBuffer, false);
    if (const auto log = device.logs.get(commandBuffer))
        log->isSuspended = log->suspends;
}

} // namespace

void cmdBeginRenderPass(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkRenderPassBeginInfo *info,
                        VkSubpassContents contents)
{
    recordAll(device, commandBuffer);
    setRendering(device, commandBuffer, true);
    device.next.CmdBeginRenderPass(commandBuffer, info, contents);
}

void cmdBeginRenderPass2(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkRenderPassBeginInfo *info,
                         const VkSubpassBeginInfo *subpass)
{
    recordAll(device, commandBuffer);
    setRendering(device, commandBuffer, true);
    device.next.CmdBeginRenderPass2(commandBuffer, info, subpass);
}

void cmdEndRenderPass(DeviceValidation &device, VkCommandBuffer commandBuffer)
{
    recordAll(device, commandBuffer);
    setRendering(device, commandBuffer, false);
    device.next.CmdEndRenderPass(commandBuffer);
}

void cmdEndRenderPass2(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkSubpassEndInfo *info)
{
    recordAll(device, commandBuffer);
    setRendering(device, commandBuffer, false);
    device.next.CmdEndRenderPass2(commandBuffer, info);
}

void cmdBeginRendering(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkRenderingInfo *info)
{
    setRendering(device, commandBuffer, true);
    if (const auto log = device.logs.get(commandBuffer)) {
        log->suspends = (info->flags & VK_RENDERING_SUSPENDING_BIT) != 0;
        log->isSuspended = false;
    }
    device.next.CmdBeginRendering(commandBuffer, info);
}

void cmdEndRendering(DeviceValidation &device, VkCommandBuffer commandBuffer)
{
    endRendering(device, commandBuffer);
    device.next.CmdEndRendering(commandBuffer);
}

void cmdEndRendering2(DeviceValidation &device, VkCommandBuffer commandBuffer, const VkRenderingEndInfoKHR *info)
{
    endRendering(device, commandBuffer);
    device.next.CmdEndRendering2KHR(commandBuffer, info);
}

void cmdSetEvent(DeviceValidation &device, VkCommandBuffer commandBuffer, VkEvent event, VkPipelineStageFlags stages)
{
    sync::recordSet(device, commandBuffer, event);
    device.next.CmdSetEvent(commandBuffer, event, stages);
}

void cmdResetEvent(DeviceValidation &device, VkCommandBuffer commandBuffer, VkEvent event, VkPipelineStageFlags stages)
{
    sync::recordReset(device, commandBuffer, event);
    device.next.CmdResetEvent(commandBuffer, event, stages);
}

void cmdWaitEvents(DeviceValidation &device, VkCommandBuffer commandBuffer, uint32_t count, const VkEvent *events,
                   VkPipelineStageFlags from, VkPipelineStageFlags to, uint32_t memoryCount,
                   const VkMemoryBarrier *memory, uint32_t bufferCount, const VkBufferMemoryBarrier *buffers,
                   uint32_t imageCount, const VkImageMemoryBarrier *images)
{
    for (uint32_t e = 0; e < count; ++e)
        addWait(device, commandBuffer, events[e],
                dependencyOf(device, from, to, memoryCount, memory, bufferCount, buffers));
    device.next.CmdWaitEvents(commandBuffer, count, events, from, to, memoryCount, memory, bufferCount, buffers,
                              imageCount, images);
}

} // namespace validation
} // namespace vellum::layer
