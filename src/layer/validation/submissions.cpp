// SPDX-License-Identifier: Apache-2.0
// Submissions, and commands by which the host learns that work is complete.
#include <span>

#include "layer/base/pnext.h"
#include "layer/validation/commands.h"

namespace vellum::layer
{

namespace
{

// What shaders have found so far.
void reportFindings(DeviceValidation &device, bool idle)
{
    device.gpu.report(idle);
    device.traces.marks.report(device, idle);
    device.traces.traced.report(device);
    device.sync.unorderedBuilds.report(device);
}

} // namespace

void reportCompleted(DeviceValidation &device, bool idle)
{
    device.logs.settle(); // the application may destroy now what submissions use whose effects have not happened yet
    reportFindings(device, idle);
    const HeldMessages held;
    const std::lock_guard lock(device.logs.submissions);
    device.traces.pending.forgetComplete(device, device.pendingBatches());
}

namespace validation
{
namespace
{

// Returns whether a timeline semaphore is to reach a value that neither the host nor an earlier submission signals.
bool isLater(DeviceValidation &device, uint64_t semaphore, uint64_t value)
{
    const auto signaled = device.logs.signals.find(semaphore);
    if (signaled != device.logs.signals.end() && signaled->second >= value)
        return false;
    uint64_t reached = 0;
    return device.next.GetSemaphoreCounterValue(device.driver.handle, reinterpret_cast<VkSemaphore>(semaphore),
                                                &reached) != VK_SUCCESS ||
           reached < value;
}

// Whether a command has its result. Resources are in use no more than after a success where the device is lost: then
// all commands count as complete.
bool succeeded(DeviceValidation &device, VkResult result)
{
    if (result == VK_ERROR_DEVICE_LOST)
        device.sync.tracker.allIdle();
    return result == VK_SUCCESS;
}

// A batch of a submission.
struct Batch {
    const char *invalidId; // Submission::invalidId
    sync::BatchSemaphores semaphores;
    std::vector<std::shared_ptr<const CommandLog::Steps>> commandBuffers{};
    std::span<const VkSparseBufferMemoryBindInfo> binds{};

    // Nothing is known of a command buffer that the application did not allocate.
    void add(const DeviceValidation &device, VkCommandBuffer commandBuffer)
    {
        if (const CommandLog *log = device.logs.get(commandBuffer))
            commandBuffers.push_back(log->steps);
    }
    void run(const Submission &submission, const std::vector<CommandLog::Step> CommandLog::Steps::*which) const
    {
        for (const auto &steps : commandBuffers)
            steps->run(submission, which);
    }
};

Batch batchOf(const DeviceValidation &device, const VkSubmitInfo &info)
{
    Batch batch{"VUID-vkQueueSubmit-pCommandBuffers-00070", sync::semaphoresOf(device.sync, info)};
    for (uint32_t c = 0; c < info.commandBufferCount; ++c)
        batch.add(device, info.pCommandBuffers[c]);
    return batch;
}

Batch batchOf(const DeviceValidation &device, const VkSubmitInfo2 &info)
{
    Batch batch{"VUID-vkQueueSubmit2-commandBuffer-03874", sync::semaphoresOf(device.sync, info)};
    for (uint32_t c = 0; c < info.commandBufferInfoCount; ++c)
        batch.add(device, info.pCommandBufferInfos[c].commandBuffer);
    return batch;
}

Batch batchOf(const DeviceValidation &device, const VkBindSparseInfo &info) // it has no command buffers
{
    return {nullptr, sync::semaphoresOf(device.sync, info), {}, {info.pBufferBinds, info.bufferBindCount}};
}

void bind(const DeviceValidation &device, const VkSparseBufferMemoryBindInfo &info)
{
    const auto buffer = device.objects.buffers.get(info.buffer);
    for (uint32_t i = 0; buffer && i < info.bindCount; ++i) {
        const VkSparseMemoryBind &part = info.pBinds[i];
        buffer->bound.set(part.resourceOffset, part.resourceOffset + part.size, part.memory != VK_NULL_HANDLE);
    }
}

// Returns whether all that the batches of a queue wait for was submitted before. `uses`: what a further one waits for.
bool isOrdered(DeviceValidation &device, VkQueue queue, std::span<const sync::SemaphoreUse> uses)
{
    auto &waits = device.logs.waits[queue];
    for (const sync::SemaphoreUse &use : uses)
        if (use.value)
            waits.emplace_back(use.semaphore, *use.value);
    std::erase_if(waits, [&](const auto &wait) { return !isLater(device, wait.first, wait.second); });
    return waits.empty();
}

// `ordered`: the order of the submission among others is known.
void executeBatch(DeviceValidation &device, VkQueue queue, const Batch &batch, bool ordered)
{
    const auto &[waits, signals] = batch.semaphores;
    const bool waited = isOrdered(device, queue, waits);
    const uint64_t number = sync::beginBatch(device.sync, queue, waits, ordered);
    const Submission submission{queue, device.objects.queueFamilies.get(queue), batch.invalidId, number,
                                ordered && waited};
    const bool known = remember(device.objects, [&] {
        batch.run(submission, &CommandLog::Steps::effects);
        for (const VkSparseBufferMemoryBindInfo &info : batch.binds)
            bind(device, info);
    });
    sync::endBatch(device.sync, queue, signals, ordered && known);
    // What waits for a batch that is executed later is executed later, too.
    for (const sync::SemaphoreUse &use : signals)
        if (use.value && waited)
            device.logs.signals[use.semaphore] = *use.value;
}

// Submits batches by `next()`. Nothing of them was executed if that fails.
template <typename Info, typename Next>
VkResult submit(DeviceValidation &device, VkQueue queue, std::span<const Info> infos, VkFence fence, Next next)
{
    reportFindings(device, false);
    std::vector<Batch> batches;
    for (const Info &info : infos)
        batches.push_back(batchOf(device, info));
    {
        const HeldMessages held;
        const std::lock_guard lock(device.logs.submissions);
        for (const Batch &batch : batches)
            batch.run({queue, device.objects.queueFamilies.get(queue), batch.invalidId}, &CommandLog::Steps::checks);
    }
    const HeldMessages held;
    SubmissionTurn turn(device.logs);
    const VkResult result = next();
    const bool ordered = turn.await();
    if (!succeeded(device, result))
        return result;
    remember(device.objects, [&] {
        for (const Batch &batch : batches)
            executeBatch(device, queue, batch, ordered);
        sync::signalFence(device.sync, queue, fence, ordered);
    });
    return result;
}

void allIdle(DeviceValidation &device)
{
    device.logs.settle();
    device.sync.tracker.allIdle();
}

} // namespace

VkResult queueSubmit(DeviceValidation &device, VkQueue queue, uint32_t count, const VkSubmitInfo *submits,
                     VkFence fence)
{
    return submit(device, queue, std::span(submits, count), fence,
                  [&] { return device.next.QueueSubmit(queue, count, submits, fence); });
}

VkResult queueSubmit2(DeviceValidation &device, VkQueue queue, uint32_t count, const VkSubmitInfo2 *submits,
                      VkFence fence)
{
    const Place command("vkQueueSubmit2");
    for (uint32_t i = 0; i < count && device.checks.core; ++i)
        ranges::checkSubmission(device, command.element("pSubmits", i), submits[i]);
    return submit(device, queue, std::span(submits, count), fence,
                  [&] { return device.next.QueueSubmit2(queue, count, submits, fence); });
}

VkResult queueBindSparse(DeviceValidation &device, VkQueue queue, uint32_t count, const VkBindSparseInfo *infos,
                         VkFence fence)
{
    return submit(device, queue, std::span(infos, count), fence,
                  [&] { return device.next.QueueBindSparse(queue, count, infos, fence); });
}

VkResult queueWaitIdle(DeviceValidation &device, VkQueue queue)
{
    const VkResult result = device.next.QueueWaitIdle(queue);
    device.logs.settle();
    if (succeeded(device, result))
        device.sync.tracker.queueIdle(uint64_t(queue));
    reportCompleted(device, false);
    return result;
}

VkResult queuePresent(DeviceValidation &device, VkQueue queue, const VkPresentInfoKHR *info)
{
    const VkResult result = device.next.QueuePresentKHR(queue, info);
    for (uint32_t i = 0; i < info->waitSemaphoreCount; ++i)
        device.sync.tracker.forgetSemaphore(uint64_t(info->pWaitSemaphores[i])); // it is unsignaled now
    return result;
}

VkResult deviceWaitIdle(DeviceValidation &device, VkDevice handle)
{
    const VkResult result = device.next.DeviceWaitIdle(handle);
    device.logs.settle();
    if (succeeded(device, result))
        device.sync.tracker.allIdle();
    reportCompleted(device, result == VK_SUCCESS);
    return result;
}

VkResult waitForFences(DeviceValidation &device, VkDevice handle, uint32_t count, const VkFence *fences, VkBool32 all,
                       uint64_t timeout)
{
    const VkResult result = device.next.WaitForFences(handle, count, fences, all, timeout);
    if (succeeded(device, result))
        sync::fencesComplete(device.sync, handle, count, fences, all == VK_TRUE || count == 1);
    reportCompleted(device, false);
    return result;
}

VkResult getFenceStatus(DeviceValidation &device, VkDevice handle, VkFence fence)
{
    const VkResult result = device.next.GetFenceStatus(handle, fence);
    if (succeeded(device, result))
        sync::fencesComplete(device.sync, handle, 1, &fence, true);
    reportCompleted(device, false);
    return result;
}

VkResult waitSemaphores(DeviceValidation &device, VkDevice handle, const VkSemaphoreWaitInfo *info, uint64_t timeout)
{
    const VkResult result = device.next.WaitSemaphores(handle, info, timeout);
    if (succeeded(device, result))
        sync::semaphoresReached(device.sync, handle, *info);
    reportCompleted(device, false);
    return result;
}

VkResult getSemaphoreCounterValue(DeviceValidation &device, VkDevice handle, VkSemaphore semaphore, uint64_t *value)
{
    const VkResult result = device.next.GetSemaphoreCounterValue(handle, semaphore, value);
    if (succeeded(device, result) && device.checks.sync) {
        device.logs.settle();
        device.sync.tracker.semaphoreReached(uint64_t(semaphore), *value);
    }
    reportCompleted(device, false);
    return result;
}

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
        remember(device.objects, [&] {
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
        for (auto &[queue, waits] : device.logs.waits) // they are over: nothing pending may refer to it
            std::erase_if(waits, [&](const auto &wait) { return wait.first == uint64_t(semaphore); });
    }
    device.sync.tracker.forgetSemaphore(uint64_t(semaphore));
    device.next.DestroySemaphore(handle, semaphore, allocator);
}

VkResult signalSemaphore(DeviceValidation &device, VkDevice handle, const VkSemaphoreSignalInfo *info)
{
    // Known before the driver signals it, as a host wait may end then.
    remember(device.objects, [&] { device.sync.tracker.hostSignal(uint64_t(info->semaphore), info->value); });
    const VkResult result = device.next.SignalSemaphore(handle, info);
    if (result != VK_SUCCESS)
        device.sync.tracker.undoHostSignal(uint64_t(info->semaphore), info->value);
    return result;
}

// Results and events also show that commands are complete; of which queue is not known. With availability, some of the
// results may be there although not all are.
VkResult getQueryPoolResults(DeviceValidation &device, VkDevice handle, VkQueryPool pool, uint32_t first,
                             uint32_t count, size_t size, void *data, VkDeviceSize stride, VkQueryResultFlags flags)
{
    const VkResult result = device.next.GetQueryPoolResults(handle, pool, first, count, size, data, stride, flags);
    const bool someMayBe = result == VK_NOT_READY && (flags & VK_QUERY_RESULT_WITH_AVAILABILITY_BIT) != 0;
    if (succeeded(device, result) || someMayBe)
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
