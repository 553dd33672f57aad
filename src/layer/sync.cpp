#include "layer/sync.h"

#include <deque>
#include <vector>

#include "layer/device.h"
#include "layer/pnext.h"

namespace vellum::layer
{
namespace
{

// Micromaps are built by compute shaders, and copied by transfers.
VkPipelineStageFlags2 driverStages(VkPipelineStageFlags2 stages)
{
    if ((stages & VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT) == 0)
        return stages;
    return (stages & ~VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT) | VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT |
           VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT;
}

// MEMORY_READ and MEMORY_WRITE go with every stage: a micromap access may come with the micromap build stage, or with
// that of acceleration structure builds, whose micromaps the layer's shaders read.
VkAccessFlags2 driverAccess(VkAccessFlags2 access)
{
    const VkAccessFlags2 ours = VK_ACCESS_2_MICROMAP_READ_BIT_EXT | VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT;
    if ((access & ours) == 0)
        return access;
    VkAccessFlags2 result = access & ~ours;
    if (access & VK_ACCESS_2_MICROMAP_READ_BIT_EXT)
        result |= VK_ACCESS_2_MEMORY_READ_BIT;
    if (access & VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT)
        result |= VK_ACCESS_2_MEMORY_WRITE_BIT;
    return result;
}

template <typename Barrier>
void translate(Barrier &barrier)
{
    barrier.srcAccessMask = driverAccess(barrier.srcAccessMask);
    barrier.dstAccessMask = driverAccess(barrier.dstAccessMask);
    barrier.srcStageMask = driverStages(barrier.srcStageMask);
    barrier.dstStageMask = driverStages(barrier.dstStageMask);
}

// Copies of dependency infos with every barrier translated.
class DriverDependencies
{
public:
    DriverDependencies(const VkDependencyInfo *infos, uint32_t count)
    {
        infos_.reserve(count);
        for (uint32_t i = 0; i < count; ++i) {
            VkDependencyInfo info = infos[i];
            info.pMemoryBarriers = copy(memory_, info.pMemoryBarriers, info.memoryBarrierCount);
            info.pBufferMemoryBarriers = copy(buffer_, info.pBufferMemoryBarriers, info.bufferMemoryBarrierCount);
            info.pImageMemoryBarriers = copy(image_, info.pImageMemoryBarriers, info.imageMemoryBarrierCount);
            infos_.push_back(info);
        }
    }
    [[nodiscard]] const VkDependencyInfo *data() const { return infos_.data(); }

private:
    template <typename Barrier>
    static const Barrier *copy(std::deque<std::vector<Barrier>> &storage, const Barrier *barriers, uint32_t count)
    {
        if (count == 0)
            return nullptr;
        std::vector<Barrier> &own = storage.emplace_back(barriers, barriers + count);
        for (Barrier &barrier : own)
            translate(barrier);
        return own.data();
    }
    std::vector<VkDependencyInfo> infos_;
    std::deque<std::vector<VkMemoryBarrier2>> memory_;
    std::deque<std::vector<VkBufferMemoryBarrier2>> buffer_;
    std::deque<std::vector<VkImageMemoryBarrier2>> image_;
};

std::vector<VkSemaphoreSubmitInfo> driverSemaphores(const VkSemaphoreSubmitInfo *infos, uint32_t count)
{
    std::vector<VkSemaphoreSubmitInfo> own(infos, infos + count);
    for (VkSemaphoreSubmitInfo &info : own)
        info.stageMask = driverStages(info.stageMask);
    return own;
}

} // namespace

VKAPI_ATTR void VKAPI_CALL cmdPipelineBarrier2(VkCommandBuffer commandBuffer, const VkDependencyInfo *info)
{
    const DriverDependencies driver(info, 1);
    deviceOf(commandBuffer).next.CmdPipelineBarrier2(commandBuffer, driver.data());
}

VKAPI_ATTR void VKAPI_CALL cmdSetEvent2(VkCommandBuffer commandBuffer, VkEvent event, const VkDependencyInfo *info)
{
    const DriverDependencies driver(info, 1);
    deviceOf(commandBuffer).next.CmdSetEvent2(commandBuffer, event, driver.data());
}

VKAPI_ATTR void VKAPI_CALL cmdResetEvent2(VkCommandBuffer commandBuffer, VkEvent event, VkPipelineStageFlags2 stages)
{
    deviceOf(commandBuffer).next.CmdResetEvent2(commandBuffer, event, driverStages(stages));
}

VKAPI_ATTR void VKAPI_CALL cmdWaitEvents2(VkCommandBuffer commandBuffer, uint32_t count, const VkEvent *events,
                                          const VkDependencyInfo *infos)
{
    const DriverDependencies driver(infos, count);
    deviceOf(commandBuffer).next.CmdWaitEvents2(commandBuffer, count, events, driver.data());
}

VKAPI_ATTR void VKAPI_CALL cmdWriteTimestamp2(VkCommandBuffer commandBuffer, VkPipelineStageFlags2 stage,
                                              VkQueryPool pool, uint32_t query)
{
    // A timestamp takes exactly one stage (VUID-vkCmdWriteTimestamp2-stage-03859).
    if (stage == VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT)
        stage = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
    deviceOf(commandBuffer).next.CmdWriteTimestamp2(commandBuffer, stage, pool, query);
}

VKAPI_ATTR void VKAPI_CALL cmdWriteBufferMarker2(VkCommandBuffer commandBuffer, VkPipelineStageFlags2 stage,
                                                 VkBuffer buffer, VkDeviceSize offset, uint32_t marker)
{
    // A marker is written when a stage is complete, as a timestamp is.
    if ((stage & VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT) != 0)
        stage = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
    deviceOf(commandBuffer).next.CmdWriteBufferMarker2AMD(commandBuffer, stage, buffer, offset, marker);
}

VKAPI_ATTR VkResult VKAPI_CALL queueSubmit2(VkQueue queue, uint32_t count, const VkSubmitInfo2 *submits, VkFence fence)
{
    Device &device = deviceOf(queue);
    device.complaints.drain(device.report());
    std::vector<VkSubmitInfo2> own(submits, submits + count);
    std::deque<std::vector<VkSemaphoreSubmitInfo>> semaphores;
    for (VkSubmitInfo2 &submit : own) {
        semaphores.push_back(driverSemaphores(submit.pWaitSemaphoreInfos, submit.waitSemaphoreInfoCount));
        submit.pWaitSemaphoreInfos = semaphores.back().data();
        semaphores.push_back(driverSemaphores(submit.pSignalSemaphoreInfos, submit.signalSemaphoreInfoCount));
        submit.pSignalSemaphoreInfos = semaphores.back().data();
    }
    return device.next.QueueSubmit2(queue, count, own.data(), fence);
}

VKAPI_ATTR VkResult VKAPI_CALL createRenderPass2(VkDevice handle, const VkRenderPassCreateInfo2 *info,
                                                 const VkAllocationCallbacks *allocator, VkRenderPass *renderPass)
{
    // A subpass dependency can carry a VkMemoryBarrier2.
    VkRenderPassCreateInfo2 driverInfo = *info;
    std::vector<VkSubpassDependency2> dependencies(info->pDependencies, info->pDependencies + info->dependencyCount);
    std::deque<Chain> chains;
    for (VkSubpassDependency2 &dependency : dependencies) {
        Chain &chain = chains.emplace_back(dependency.pNext);
        if (auto *barrier = chain.edit<VkMemoryBarrier2>(VK_STRUCTURE_TYPE_MEMORY_BARRIER_2))
            translate(*barrier);
        dependency.pNext = chain.head();
    }
    driverInfo.pDependencies = dependencies.data();
    return deviceOf(handle).next.CreateRenderPass2(handle, &driverInfo, allocator, renderPass);
}

} // namespace vellum::layer
