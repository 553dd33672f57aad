// SPDX-License-Identifier: Apache-2.0
// Commands that order memory accesses: those after which hit tables may have other content (hit_table_copies.h), and
// those that take pipeline stages and accesses, of which the driver does not know those of micromap builds:
// VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT, VK_ACCESS_2_MICROMAP_READ/WRITE_BIT_EXT. They exist as 64-bit flags only.
#include <algorithm>
#include <deque>
#include <vector>

#include "layer/base/commands.h"
#include "layer/base/pnext.h"
#include "layer/command_buffer/device_command_buffers.h"
#include "layer/input/checked.h"
#include "layer/rules/address_ranges.h"
#include "vellum/vulkan_opacity_micromap.h"
#include "vk/newer.h"

namespace vellum::layer
{
namespace
{

// A range barrier covers accesses to memory by any buffer or address. A memory barrier covers these and more, and is
// allowed wherever a range barrier is.
void addMemoryBarrier(const VkMemoryRangeBarrierKHR &range, std::vector<VkMemoryBarrier2> &memory)
{
    memory.push_back({VK_STRUCTURE_TYPE_MEMORY_BARRIER_2, nullptr, range.srcStageMask, range.srcAccessMask,
                      range.dstStageMask, range.dstAccessMask});
}

// Memory is transferred to another queue family buffer by buffer: each buffer's part of the range.
bool addTransfers(const DeviceCommandBuffers &device, VkCommandBuffer commandBuffer,
                  const VkMemoryRangeBarrierKHR &range, std::vector<VkBufferMemoryBarrier2> &buffers)
{
    const auto locations = device.buffers.addresses.within(range.addressRange.address, range.addressRange.size);
    for (const AddressMap::Location &location : locations) {
        device.states.keep(commandBuffer, location.owner);
        buffers.push_back({VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER_2, nullptr, range.srcStageMask, range.srcAccessMask,
                           range.dstStageMask, range.dstAccessMask, range.srcQueueFamilyIndex,
                           range.dstQueueFamilyIndex, location.buffer, location.offset, location.bytes});
    }
    return !locations.empty();
}

// Appends the range barriers of a dependency info (VK_KHR_device_address_commands) as memory and buffer barriers, which
// every driver knows.
void addRangeBarriers(const DeviceCommandBuffers &device, VkCommandBuffer commandBuffer,
                      const VkMemoryRangeBarriersInfoKHR &info, std::vector<VkMemoryBarrier2> &memory,
                      std::vector<VkBufferMemoryBarrier2> &buffers)
{
    const bool isReported = input::areRangesReported(commandBuffer);
    for (uint32_t i = 0; i < info.memoryRangeBarrierCount; ++i) {
        const VkMemoryRangeBarrierKHR &range = info.pMemoryRangeBarriers[i];
        const bool transfer = range.srcQueueFamilyIndex != range.dstQueueFamilyIndex;
        if (transfer && addTransfers(device, commandBuffer, range, buffers))
            continue;
        addMemoryBarrier(range, memory);
        if (transfer && !isReported)
            device.driver.report().error(
                rules::kAnyRange.buffer,
                "VkMemoryRangeBarrierKHR: addressRange is in no buffer; it is not transferred to the "
                "other queue family");
    }
}

// Micromaps are built by compute shaders and copied by transfers.
VkPipelineStageFlags2 driverStages(VkPipelineStageFlags2 stages)
{
    if ((stages & VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT) == 0)
        return stages;
    return (stages & ~VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT) | VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT |
           VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT;
}

// Micromap accesses are allowed with the stages of micromap builds and of acceleration structure builds. MEMORY_READ
// and MEMORY_WRITE are allowed with every stage.
VkAccessFlags2 driverAccess(VkAccessFlags2 access)
{
    const VkAccessFlags2 micromaps = VK_ACCESS_2_MICROMAP_READ_BIT_EXT | VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT;
    if ((access & micromaps) == 0)
        return access;
    VkAccessFlags2 result = access & ~micromaps;
    if (access & VK_ACCESS_2_MICROMAP_READ_BIT_EXT)
        result |= VK_ACCESS_2_MEMORY_READ_BIT;
    if (access & VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT)
        result |= VK_ACCESS_2_MEMORY_WRITE_BIT;
    return result;
}

template <typename Barrier>
void translate(const Driver &driver, Barrier &barrier)
{
    if (!driver.emulated())
        return;
    barrier.srcAccessMask = driverAccess(barrier.srcAccessMask);
    barrier.dstAccessMask = driverAccess(barrier.dstAccessMask);
    barrier.srcStageMask = driverStages(barrier.srcStageMask);
    barrier.dstStageMask = driverStages(barrier.dstStageMask);
}

// Warns if the driver gets a barrier with stages and accesses that it does not know.
template <typename Barrier>
void warnOfUntranslated(const Driver &driver, const Barrier &barrier)
{
    Barrier own = barrier;
    translate(driver, own);
    if (own.srcAccessMask != barrier.srcAccessMask || own.dstAccessMask != barrier.dstAccessMask ||
        own.srcStageMask != barrier.srcStageMask || own.dstStageMask != barrier.dstStageMask)
        driver.report().warning("VELLUM-unknown-structure",
                                "a barrier of micromaps is behind a structure of unknown size: the driver gets its "
                                "stages and accesses as they are");
}

// A copy of a dependency info with every barrier translated. On a driver with micromaps, which knows the stages and
// accesses, only address ranges are replaced.
class DriverDependency
{
public:
    DriverDependency(const DeviceCommandBuffers &device, VkCommandBuffer commandBuffer,
                     const VkDependencyInfo &application)
        : driver_(device.driver), info_(application), chain_(application.pNext),
          memory_(application.pMemoryBarriers, application.pMemoryBarriers + application.memoryBarrierCount),
          buffers_(application.pBufferMemoryBarriers,
                   application.pBufferMemoryBarriers + application.bufferMemoryBarrierCount),
          images_(application.pImageMemoryBarriers,
                  application.pImageMemoryBarriers + application.imageMemoryBarrierCount)
    {
        addRanges(device, commandBuffer);
        if (device.driver.emulated())
            translateTensors();
        info_.pNext = chain_.head();
        info_.pMemoryBarriers = translated(memory_, info_.memoryBarrierCount);
        info_.pBufferMemoryBarriers = translated(buffers_, info_.bufferMemoryBarrierCount);
        info_.pImageMemoryBarriers = translated(images_, info_.imageMemoryBarrierCount);
    }
    DriverDependency(const DriverDependency &) = delete;
    DriverDependency &operator=(const DriverDependency &) = delete;
    [[nodiscard]] const VkDependencyInfo &info() const { return info_; }

private:
    template <typename Barrier>
    const Barrier *translated(std::vector<Barrier> &barriers, uint32_t &count)
    {
        for (Barrier &barrier : barriers)
            translate(driver_, barrier);
        count = static_cast<uint32_t>(barriers.size());
        return barriers.data();
    }
    void addRanges(const DeviceCommandBuffers &device, VkCommandBuffer commandBuffer)
    {
        const auto *ranges =
            findInChain<VkMemoryRangeBarriersInfoKHR>(info_.pNext, VK_STRUCTURE_TYPE_MEMORY_RANGE_BARRIERS_INFO_KHR);
        if (!ranges)
            return;
        if (device.driver.ownAddressCommands) {
            addRangeBarriers(device, commandBuffer, *ranges, memory_, buffers_);
            chain_.remove(VK_STRUCTURE_TYPE_MEMORY_RANGE_BARRIERS_INFO_KHR);
        } else if (auto *own =
                       chain_.edit<VkMemoryRangeBarriersInfoKHR>(VK_STRUCTURE_TYPE_MEMORY_RANGE_BARRIERS_INFO_KHR)) {
            ranges_.assign(own->pMemoryRangeBarriers, own->pMemoryRangeBarriers + own->memoryRangeBarrierCount);
            own->pMemoryRangeBarriers = translated(ranges_, own->memoryRangeBarrierCount);
        } else {
            for (uint32_t i = 0; i < ranges->memoryRangeBarrierCount; ++i)
                warnOfUntranslated(driver_, ranges->pMemoryRangeBarriers[i]);
        }
    }
    void translateTensors()
    {
        const auto *info =
            findInChain<VkTensorDependencyInfoARM>(info_.pNext, VK_STRUCTURE_TYPE_TENSOR_DEPENDENCY_INFO_ARM);
        if (auto *own = chain_.edit<VkTensorDependencyInfoARM>(VK_STRUCTURE_TYPE_TENSOR_DEPENDENCY_INFO_ARM)) {
            tensors_.assign(own->pTensorMemoryBarriers, own->pTensorMemoryBarriers + own->tensorMemoryBarrierCount);
            own->pTensorMemoryBarriers = translated(tensors_, own->tensorMemoryBarrierCount);
        } else if (info) {
            for (uint32_t i = 0; i < info->tensorMemoryBarrierCount; ++i)
                warnOfUntranslated(driver_, info->pTensorMemoryBarriers[i]);
        }
        if (auto *own = chain_.edit<VkTensorMemoryBarrierARM>(VK_STRUCTURE_TYPE_TENSOR_MEMORY_BARRIER_ARM))
            translate(driver_, *own);
        else if (const auto *one =
                     findInChain<VkTensorMemoryBarrierARM>(info_.pNext, VK_STRUCTURE_TYPE_TENSOR_MEMORY_BARRIER_ARM))
            warnOfUntranslated(driver_, *one);
    }

    const Driver &driver_;
    VkDependencyInfo info_;
    Chain chain_;
    std::vector<VkMemoryBarrier2> memory_;
    std::vector<VkBufferMemoryBarrier2> buffers_;
    std::vector<VkImageMemoryBarrier2> images_;
    std::vector<VkMemoryRangeBarrierKHR> ranges_; // for a driver that knows them
    std::vector<VkTensorMemoryBarrierARM> tensors_;
};

// Returns whether a memory dependency makes writes visible to traces that read their hit tables.
bool showsTables(VkPipelineStageFlags2 stages, VkAccessFlags2 access)
{
    constexpr VkPipelineStageFlags2 kStages =
        VK_PIPELINE_STAGE_2_RAY_TRACING_SHADER_BIT_KHR | VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
    constexpr VkAccessFlags2 kAccess =
        VK_ACCESS_2_SHADER_READ_BIT | VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_SHADER_BINDING_TABLE_READ_BIT_KHR;
    return (stages & kStages) != 0 && (access & kAccess) != 0;
}

bool showsTables(const VkDependencyInfo &info)
{
    const auto any = [](const auto *barriers, uint32_t count) {
        return std::any_of(barriers, barriers + count,
                           [](const auto &b) { return showsTables(b.dstStageMask, b.dstAccessMask); });
    };
    return any(info.pMemoryBarriers, info.memoryBarrierCount) ||
           any(info.pBufferMemoryBarriers, info.bufferMemoryBarrierCount);
}

void forgetTables(const DeviceCommandBuffers &device, VkCommandBuffer commandBuffer)
{
    if (CommandState *const state = device.states.get(commandBuffer))
        state->hitTables.forget();
}

std::vector<VkSemaphoreSubmitInfo> driverSemaphores(const VkSemaphoreSubmitInfo *infos, uint32_t count)
{
    std::vector<VkSemaphoreSubmitInfo> own(infos, infos + count);
    for (VkSemaphoreSubmitInfo &info : own)
        info.stageMask = driverStages(info.stageMask);
    return own;
}

} // namespace

VkPipelineStageFlags2 driverStage(VkPipelineStageFlags2 stage)
{
    return stage == VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT ? VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT : stage;
}

// Barriers of images cover only accesses to the image; reads of hit tables are accesses to buffers.
void cmdPipelineBarrier(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, VkPipelineStageFlags sources,
                        VkPipelineStageFlags targets, VkDependencyFlags flags, uint32_t memoryCount,
                        const VkMemoryBarrier *memory, uint32_t bufferCount, const VkBufferMemoryBarrier *buffers,
                        uint32_t imageCount, const VkImageMemoryBarrier *images)
{
    const auto shows = [targets](const auto &barrier) { return showsTables(targets, barrier.dstAccessMask); };
    if (std::any_of(memory, memory + memoryCount, shows) || std::any_of(buffers, buffers + bufferCount, shows))
        forgetTables(device, commandBuffer);
    device.driver.next.CmdPipelineBarrier(commandBuffer, sources, targets, flags, memoryCount, memory, bufferCount,
                                          buffers, imageCount, images);
}

// The host may have signalled the event after it has written a table.
void cmdWaitEvents(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, uint32_t count, const VkEvent *events,
                   VkPipelineStageFlags sources, VkPipelineStageFlags targets, uint32_t memoryCount,
                   const VkMemoryBarrier *memory, uint32_t bufferCount, const VkBufferMemoryBarrier *buffers,
                   uint32_t imageCount, const VkImageMemoryBarrier *images)
{
    forgetTables(device, commandBuffer);
    device.driver.next.CmdWaitEvents(commandBuffer, count, events, sources, targets, memoryCount, memory, bufferCount,
                                     buffers, imageCount, images);
}

// Subpass dependencies are memory dependencies; there are no traces between begin and end.
void cmdBeginRenderPass(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, const VkRenderPassBeginInfo *info,
                        VkSubpassContents contents)
{
    forgetTables(device, commandBuffer);
    device.driver.next.CmdBeginRenderPass(commandBuffer, info, contents);
}

void cmdBeginRenderPass2(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, const VkRenderPassBeginInfo *info,
                         const VkSubpassBeginInfo *begin)
{
    forgetTables(device, commandBuffer);
    device.driver.next.CmdBeginRenderPass2(commandBuffer, info, begin);
}

void cmdPipelineBarrier2(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, const VkDependencyInfo *info)
{
    const DriverDependency driver(device, commandBuffer, *info);
    const auto *ranges =
        findInChain<VkMemoryRangeBarriersInfoKHR>(info->pNext, VK_STRUCTURE_TYPE_MEMORY_RANGE_BARRIERS_INFO_KHR);
    if (ranges || showsTables(*info))
        forgetTables(device, commandBuffer);
    device.driver.next.CmdPipelineBarrier2(commandBuffer, &driver.info());
}

void cmdSetEvent2(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, VkEvent event,
                  const VkDependencyInfo *info)
{
    const DriverDependency driver(device, commandBuffer, *info);
    device.driver.next.CmdSetEvent2(commandBuffer, event, &driver.info());
}

void cmdResetEvent2(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, VkEvent event,
                    VkPipelineStageFlags2 stages)
{
    device.driver.next.CmdResetEvent2(commandBuffer, event, driverStages(stages));
}

void cmdWaitEvents2(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, uint32_t count, const VkEvent *events,
                    const VkDependencyInfo *infos)
{
    forgetTables(device, commandBuffer);
    std::deque<DriverDependency> own;
    std::vector<VkDependencyInfo> driverInfos;
    for (uint32_t i = 0; i < count; ++i)
        driverInfos.push_back(own.emplace_back(device, commandBuffer, infos[i]).info());
    device.driver.next.CmdWaitEvents2(commandBuffer, count, events, driverInfos.data());
}

void cmdWriteTimestamp2(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, VkPipelineStageFlags2 stage,
                        VkQueryPool pool, uint32_t query)
{
    // VUID-vkCmdWriteTimestamp2-stage-03859
    device.driver.next.CmdWriteTimestamp2(commandBuffer, driverStage(stage), pool, query);
}

void cmdWriteBufferMarker2(DeviceCommandBuffers &device, VkCommandBuffer commandBuffer, VkPipelineStageFlags2 stage,
                           VkBuffer buffer, VkDeviceSize offset, uint32_t marker)
{
    // A marker is written when a stage is complete, as a timestamp is.
    device.driver.next.CmdWriteBufferMarker2AMD(commandBuffer, driverStage(stage), buffer, offset, marker);
}

VkResult queueWaitIdle(DeviceCommandBuffers &device, VkQueue queue)
{
    const ProbeQueue::Lock lock = device.probes.lock(queue);
    return device.driver.next.QueueWaitIdle(queue);
}

VkResult deviceWaitIdle(DeviceCommandBuffers &device, VkDevice handle)
{
    const ProbeQueue::Lock lock = device.probes.lock();
    return device.driver.next.DeviceWaitIdle(handle);
}

VkResult queueSubmit(DeviceCommandBuffers &device, VkQueue queue, uint32_t count, const VkSubmitInfo *submits,
                     VkFence fence)
{
    const ProbeQueue::Lock lock = device.probes.lock(queue);
    return device.driver.next.QueueSubmit(queue, count, submits, fence);
}

VkResult queueSubmit2(DeviceCommandBuffers &device, VkQueue queue, uint32_t count, const VkSubmitInfo2 *submits,
                      VkFence fence)
{
    std::vector<VkSubmitInfo2> own(submits, submits + count);
    std::deque<std::vector<VkSemaphoreSubmitInfo>> semaphores;
    for (VkSubmitInfo2 &submit : own) {
        semaphores.push_back(driverSemaphores(submit.pWaitSemaphoreInfos, submit.waitSemaphoreInfoCount));
        submit.pWaitSemaphoreInfos = semaphores.back().data();
        semaphores.push_back(driverSemaphores(submit.pSignalSemaphoreInfos, submit.signalSemaphoreInfoCount));
        submit.pSignalSemaphoreInfos = semaphores.back().data();
    }
    const ProbeQueue::Lock lock = device.probes.lock(queue);
    return device.driver.next.QueueSubmit2(queue, count, own.data(), fence);
}

// Queue commands, which may use the queue of probes (driver_probe.h).
VkResult queueBindSparse(DeviceCommandBuffers &device, VkQueue queue, uint32_t count, const VkBindSparseInfo *infos,
                         VkFence fence)
{
    const ProbeQueue::Lock lock = device.probes.lock(queue);
    return device.driver.next.QueueBindSparse(queue, count, infos, fence);
}

VkResult queuePresent(DeviceCommandBuffers &device, VkQueue queue, const VkPresentInfoKHR *info)
{
    const ProbeQueue::Lock lock = device.probes.lock(queue);
    return device.driver.next.QueuePresentKHR(queue, info);
}

// The next layer has no labels if the application did not enable VK_EXT_debug_utils; some loaders return the layer's
// commands all the same.
void queueBeginDebugUtilsLabel(DeviceCommandBuffers &device, VkQueue queue, const VkDebugUtilsLabelEXT *label)
{
    const ProbeQueue::Lock lock = device.probes.lock(queue);
    if (const auto next = device.driver.next.QueueBeginDebugUtilsLabelEXT)
        next(queue, label);
}

void queueEndDebugUtilsLabel(DeviceCommandBuffers &device, VkQueue queue)
{
    const ProbeQueue::Lock lock = device.probes.lock(queue);
    if (const auto next = device.driver.next.QueueEndDebugUtilsLabelEXT)
        next(queue);
}

void queueInsertDebugUtilsLabel(DeviceCommandBuffers &device, VkQueue queue, const VkDebugUtilsLabelEXT *label)
{
    const ProbeQueue::Lock lock = device.probes.lock(queue);
    if (const auto next = device.driver.next.QueueInsertDebugUtilsLabelEXT)
        next(queue, label);
}

VkResult queueSetPerformanceConfiguration(DeviceCommandBuffers &device, VkQueue queue,
                                          VkPerformanceConfigurationINTEL configuration)
{
    const ProbeQueue::Lock lock = device.probes.lock(queue);
    return device.driver.next.QueueSetPerformanceConfigurationINTEL(queue, configuration);
}

VkResult queueSetPerfHint(DeviceCommandBuffers &device, VkQueue queue, const VkPerfHintInfoQCOM *info)
{
    const ProbeQueue::Lock lock = device.probes.lock(queue);
    return device.driver.next.QueueSetPerfHintQCOM(queue, info);
}

VkResult createRenderPass2(DeviceCommandBuffers &device, VkDevice handle, const VkRenderPassCreateInfo2 *info,
                           const VkAllocationCallbacks *allocator, VkRenderPass *renderPass)
{
    // A subpass dependency can carry a VkMemoryBarrier2.
    VkRenderPassCreateInfo2 driverInfo = *info;
    std::vector<VkSubpassDependency2> dependencies(info->pDependencies, info->pDependencies + info->dependencyCount);
    std::deque<Chain> chains;
    for (VkSubpassDependency2 &dependency : dependencies) {
        Chain &chain = chains.emplace_back(dependency.pNext);
        if (auto *barrier = chain.edit<VkMemoryBarrier2>(VK_STRUCTURE_TYPE_MEMORY_BARRIER_2))
            translate(device.driver, *barrier);
        else if (const auto *application =
                     findInChain<VkMemoryBarrier2>(dependency.pNext, VK_STRUCTURE_TYPE_MEMORY_BARRIER_2))
            warnOfUntranslated(device.driver, *application);
        dependency.pNext = chain.head();
    }
    driverInfo.pDependencies = dependencies.data();
    return device.driver.next.CreateRenderPass2(handle, &driverInfo, allocator, renderPass);
}

} // namespace vellum::layer
