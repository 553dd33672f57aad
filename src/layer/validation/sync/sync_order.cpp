// SPDX-License-Identifier: Apache-2.0
// The order of commands: barriers, events, semaphores, fences, and what the host learns of the progress of queues.
#include "layer/base/pnext.h"
#include "layer/validation/sync/sync_checks.h"

namespace vellum::layer::sync
{
namespace
{

// The dependency that a command states. Parts in a row with the same masks are one barrier with several ranges. Their
// memory is looked up when the command is executed.
class Dependency
{
public:
    explicit Dependency(const PipelineBarrier &barrier)
    {
        const auto &[from, to, memoryCount, memory, bufferCount, buffers] = barrier;
        parts_.reserve(bufferCount);
        groups_.reserve(2);
        for (uint32_t i = 0; i < memoryCount; ++i)
            add({from, memory[i].srcAccessMask, to, memory[i].dstAccessMask});
        for (uint32_t i = 0; i < bufferCount; ++i) {
            const VkBufferMemoryBarrier &b = buffers[i];
            add({from, b.srcAccessMask, to, b.dstAccessMask}, {b.buffer, b.offset, b.size}, b);
        }
        if (memoryCount == 0)
            add({from, 0, to, 0});
    }
    explicit Dependency(const VkDependencyInfo &info)
    {
        const auto *ranges =
            findInChain<VkMemoryRangeBarriersInfoKHR>(info.pNext, VK_STRUCTURE_TYPE_MEMORY_RANGE_BARRIERS_INFO_KHR);
        parts_.reserve(info.bufferMemoryBarrierCount + (ranges ? ranges->memoryRangeBarrierCount : 0));
        groups_.reserve(2);
        for (uint32_t i = 0; i < info.memoryBarrierCount; ++i)
            add(masksOf(info.pMemoryBarriers[i]));
        for (uint32_t i = 0; i < info.bufferMemoryBarrierCount; ++i) {
            const VkBufferMemoryBarrier2 &b = info.pBufferMemoryBarriers[i];
            add(masksOf(b), {b.buffer, b.offset, b.size}, b);
        }
        for (uint32_t i = 0; i < info.imageMemoryBarrierCount; ++i)
            add({info.pImageMemoryBarriers[i].srcStageMask, 0, info.pImageMemoryBarriers[i].dstStageMask, 0});
        for (uint32_t i = 0; ranges && i < ranges->memoryRangeBarrierCount; ++i) {
            const VkMemoryRangeBarrierKHR &b = ranges->pMemoryRangeBarriers[i];
            add(masksOf(b), {VK_NULL_HANDLE, b.addressRange.address, b.addressRange.size}, b);
        }
    }
    // Calls order(barriers), and transfers ownership.
    template <typename Order>
    void execute(DeviceSync &sync, QueueKey queue, Order order) const
    {
        std::vector<Barrier> barriers;
        std::vector<Transfer> transfers;
        auto part = parts_.begin();
        for (const Group &group : groups_) {
            const Masks &masks = group.masks;
            Barrier &barrier = barriers.emplace_back(
                Barrier{firstScope(masks.from, masks.fromAccess), secondScope(masks.to, masks.toAccess), {}});
            bool all = group.parts == 0;
            for (const auto end = part + group.parts; part != end; ++part) {
                barrier.ranges.push_back(rangeOf(sync.device, *part));
                all = all || barrier.ranges.back().empty(); // one that is unknown: all memory
            }
            if (all)
                barrier.ranges.clear();
        }
        for (const auto &[index, family] : families_)
            transfers.push_back({family, rangeOf(sync.device, parts_[index])});
        order(barriers);
        if (!transfers.empty())
            sync.tracker.transfers(queue, transfers);
    }

private:
    struct Masks {
        VkPipelineStageFlags2 from = 0;
        VkAccessFlags2 fromAccess = 0;
        VkPipelineStageFlags2 to = 0;
        VkAccessFlags2 toAccess = 0;
        bool operator==(const Masks &) const = default;
    };
    struct Group {
        Masks masks;
        uint32_t parts = 0; // 0: all memory
    };
    struct Part {
        VkBuffer buffer = VK_NULL_HANDLE; // null: an address range
        VkDeviceSize begin = 0, size = 0;
    };
    static Range rangeOf(const DeviceModel &device, const Part &part)
    {
        return part.buffer ? memoryIn(device.objects.buffers.get(part.buffer).get(), part.begin, part.size)
                           : locationAt(device, part.begin, part.size).range;
    }
    template <typename MemoryBarrier>
    static Masks masksOf(const MemoryBarrier &b)
    {
        return {b.srcStageMask, b.srcAccessMask, b.dstStageMask, b.dstAccessMask};
    }
    void add(const Masks &masks)
    {
        if (groups_.empty() || groups_.back().parts != 0 || groups_.back().masks != masks)
            groups_.push_back({masks, 0});
    }
    template <typename PartBarrier>
    void add(const Masks &masks, const Part &part, const PartBarrier &barrier)
    {
        if (barrier.srcQueueFamilyIndex != barrier.dstQueueFamilyIndex)
            families_.emplace_back(static_cast<uint32_t>(parts_.size()), barrier.dstQueueFamilyIndex);
        if (groups_.empty() || groups_.back().parts == 0 || groups_.back().masks != masks)
            groups_.push_back({masks, 0});
        ++groups_.back().parts;
        parts_.push_back(part);
    }

    std::vector<Group> groups_;
    std::vector<Part> parts_;                             // of the groups in turn
    std::vector<std::pair<uint32_t, uint32_t>> families_; // parts that change their owner, and the new one
};

template <typename Stated>
void addBarriers(DeviceSync &sync, VkCommandBuffer commandBuffer, const Stated &stated)
{
    if (CommandLog *log = sync.device.checks.sync ? sync.device.logs.get(commandBuffer) : nullptr)
        log->steps->effects.emplace_back([&sync, dependency = Dependency(stated)](const Submission &submission) {
            const auto queue = uint64_t(submission.queue);
            dependency.execute(sync, queue,
                               [&](std::span<const Barrier> barriers) { sync.tracker.barriers(queue, barriers); });
        });
}

template <typename Stated>
void addWait(DeviceSync &sync, VkCommandBuffer commandBuffer, VkEvent event, const Stated &stated)
{
    if (CommandLog *log = sync.device.checks.sync ? sync.device.logs.get(commandBuffer) : nullptr)
        log->steps->effects.emplace_back([&sync, event, dependency = Dependency(stated)](const Submission &submission) {
            const auto queue = uint64_t(submission.queue);
            dependency.execute(sync, queue, [&](std::span<const Barrier> barriers) {
                sync.tracker.waitEvent(queue, uint64_t(event), barriers);
            });
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

// `stages`: of the waits; null where there are none.
template <typename Batch>
BatchSemaphores semaphoresIn(const DeviceSync &sync, const Batch &batch, const VkPipelineStageFlags *stages)
{
    const auto *given =
        findInChain<VkTimelineSemaphoreSubmitInfo>(batch.pNext, VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO);
    const VkTimelineSemaphoreSubmitInfo values = given ? *given : VkTimelineSemaphoreSubmitInfo{};
    return {usesOf(sync, batch.waitSemaphoreCount, batch.pWaitSemaphores, stages, values.waitSemaphoreValueCount,
                   values.pWaitSemaphoreValues),
            usesOf(sync, batch.signalSemaphoreCount, batch.pSignalSemaphores, nullptr, values.signalSemaphoreValueCount,
                   values.pSignalSemaphoreValues)};
}

} // namespace

void recordBarriers(DeviceSync &sync, VkCommandBuffer commandBuffer, const VkDependencyInfo &info)
{
    addBarriers(sync, commandBuffer, info);
}

void recordBarriers(DeviceSync &sync, VkCommandBuffer commandBuffer, const PipelineBarrier &barrier)
{
    addBarriers(sync, commandBuffer, barrier);
}

void recordAll(DeviceSync &sync, VkCommandBuffer commandBuffer)
{
    constexpr VkAccessFlags kAny = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT;
    const VkMemoryBarrier memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER, nullptr, kAny, kAny};
    recordBarriers(sync, commandBuffer,
                   PipelineBarrier{VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 1, &memory,
                                   0, nullptr});
}

void recordSet(DeviceSync &sync, VkCommandBuffer commandBuffer, VkEvent event)
{
    if (sync.device.checks.sync)
        sync.device.logs.add(commandBuffer, [&sync, event](const Submission &submission) {
            sync.tracker.setEvent(uint64_t(submission.queue), uint64_t(event));
        });
}

void recordReset(DeviceSync &sync, VkCommandBuffer commandBuffer, VkEvent event)
{
    if (sync.device.checks.sync)
        sync.device.logs.add(commandBuffer,
                             [&sync, event](const Submission &) { sync.tracker.resetEvent(uint64_t(event)); });
}

void recordWait(DeviceSync &sync, VkCommandBuffer commandBuffer, uint32_t count, const VkEvent *events,
                const VkDependencyInfo *infos)
{
    for (uint32_t e = 0; e < count; ++e)
        addWait(sync, commandBuffer, events[e], infos[e]);
}

void recordWait(DeviceSync &sync, VkCommandBuffer commandBuffer, uint32_t count, const VkEvent *events,
                const PipelineBarrier &barrier)
{
    for (uint32_t e = 0; e < count; ++e)
        addWait(sync, commandBuffer, events[e], barrier);
}

BatchSemaphores semaphoresOf(const DeviceSync &sync, const VkSubmitInfo &submit)
{
    return semaphoresIn(sync, submit, submit.pWaitDstStageMask);
}

BatchSemaphores semaphoresOf(const DeviceSync &sync, const VkSubmitInfo2 &submit)
{
    return {usesOf(sync, submit.waitSemaphoreInfoCount, submit.pWaitSemaphoreInfos),
            usesOf(sync, submit.signalSemaphoreInfoCount, submit.pSignalSemaphoreInfos)};
}

BatchSemaphores semaphoresOf(const DeviceSync &sync, const VkBindSparseInfo &bind)
{
    return semaphoresIn(sync, bind, nullptr);
}

uint64_t beginBatch(DeviceSync &sync, VkQueue queue, const std::vector<SemaphoreUse> &waits, bool ordered)
{
    if (!sync.device.checks.sync)
        return 0;
    // The host may know that batches of other queues are complete by means that are not followed.
    const bool elsewhere = sync.device.facts.waitsElsewhere;
    const uint64_t number = sync.tracker.beginBatch(uint64_t(queue), sync.device.objects.queueFamilies.get(queue),
                                                    waits, ordered && !elsewhere);
    return elsewhere ? 0 : number;
}

void endBatch(DeviceSync &sync, VkQueue queue, const std::vector<SemaphoreUse> &signals, bool ordered)
{
    if (sync.device.checks.sync)
        sync.tracker.endBatch(uint64_t(queue), signals, ordered);
}

void signalFence(DeviceSync &sync, VkQueue queue, VkFence fence, bool ordered)
{
    if (!sync.device.checks.sync || !fence)
        return;
    sync.tracker.signalFence(uint64_t(queue), uint64_t(fence));
    if (!ordered) // the host may know already that it is signaled
        sync.tracker.fenceComplete(uint64_t(fence));
}

void fencesComplete(DeviceSync &sync, VkDevice handle, uint32_t count, const VkFence *fences, bool all)
{
    if (sync.device.checks.sync)
        sync.device.logs.settle();
    for (uint32_t i = 0; sync.device.checks.sync && i < count; ++i) {
        if (all || sync.device.next.GetFenceStatus(handle, fences[i]) == VK_SUCCESS)
            sync.tracker.fenceComplete(uint64_t(fences[i]));
    }
}

void semaphoresReached(DeviceSync &sync, VkDevice handle, const VkSemaphoreWaitInfo &info)
{
    if (!sync.device.checks.sync)
        return;
    sync.device.logs.settle();
    const bool all = info.semaphoreCount == 1 || (info.flags & VK_SEMAPHORE_WAIT_ANY_BIT) == 0;
    for (uint32_t i = 0; i < info.semaphoreCount; ++i) {
        uint64_t value = info.pValues[i];
        if (all || (sync.device.next.GetSemaphoreCounterValue(handle, info.pSemaphores[i], &value) == VK_SUCCESS &&
                    value >= info.pValues[i]))
            sync.tracker.semaphoreReached(uint64_t(info.pSemaphores[i]), value);
    }
}

bool checkUnused(DeviceSync &sync, const Place &command, const char *rule, const ReferredObject &object)
{
    if (!sync.device.checks.sync)
        return true;
    const HeldMessages held;
    const std::lock_guard lock(sync.device.logs.submissions);
    for (const CommandUse &use : object.uses) {
        if (!sync.tracker.isPending(uint64_t(use.queue), use.batch))
            continue;
        if (const auto other = use.address != 0 ? bufferAt(sync.device, use.address) : nullptr) {
            addUse(*other, {.queue = use.queue, .batch = use.batch}, use); // the command can do with that one
            continue;
        }
        sync.device.at(command, object.handle)
            .report(rule, nullptr,
                    sync.device.nameOf(object.handle) + " is used by " + placeOf(use) + " (" + use.subject +
                        "), which is not known to be complete");
        return false;
    }
    return true;
}

} // namespace vellum::layer::sync
