// SPDX-License-Identifier: Apache-2.0
// Barriers, events, semaphores, and the order of builds and transfers.
#include "layers/spy.h"

#include <cstdlib>
#include <map>
#include <sstream>
#include <type_traits>

#include "vk/newer.h"

namespace spy
{

void expectStages(void *key, const char *where, VkPipelineStageFlags2 stages)
{
    if (!knowsMicromaps(key) && (stages & VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT) != 0)
        report(std::string(where) + ": MICROMAP_BUILD stage");
}

namespace
{

void expectAccess(void *key, const char *where, VkAccessFlags2 access)
{
    if (!knowsMicromaps(key) &&
        (access & (VK_ACCESS_2_MICROMAP_READ_BIT_EXT | VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT)) != 0)
        report(std::string(where) + ": MICROMAP_READ or MICROMAP_WRITE access");
}

template <class Barrier>
void expectBarrier(void *key, const char *where, const Barrier &barrier)
{
    expectStages(key, where, barrier.srcStageMask);
    expectStages(key, where, barrier.dstStageMask);
    expectAccess(key, where, barrier.srcAccessMask);
    expectAccess(key, where, barrier.dstAccessMask);
}

// "MEMORY srcStage srcAccess dstStage dstAccess", and for buffers " srcFamily dstFamily offset size buffer" after it.
template <class Barrier>
void reportBarrier(const Barrier &b)
{
    if (std::getenv("VELLUM_TEST_SPY_BARRIERS") == nullptr)
        return;
    std::ostringstream text;
    text << std::hex << "MEMORY " << b.srcStageMask << ' ' << b.srcAccessMask << ' ' << b.dstStageMask << ' '
         << b.dstAccessMask;
    if constexpr (std::is_same_v<Barrier, VkBufferMemoryBarrier2>)
        text << ' ' << b.srcQueueFamilyIndex << ' ' << b.dstQueueFamilyIndex << ' ' << b.offset << ' ' << b.size << ' '
             << reinterpret_cast<uint64_t>(b.buffer);
    report(text.str());
}

void expectDependency(void *key, const char *where, const VkDependencyInfo &info)
{
    if (inChain(info.pNext, VK_STRUCTURE_TYPE_MEMORY_RANGE_BARRIERS_INFO_KHR) != nullptr)
        report(std::string(where) + ": VkMemoryRangeBarriersInfoKHR");
    for (const VkMemoryBarrier2 &b : std::span(info.pMemoryBarriers, info.memoryBarrierCount))
        reportBarrier(b);
    for (const VkBufferMemoryBarrier2 &b : std::span(info.pBufferMemoryBarriers, info.bufferMemoryBarrierCount))
        reportBarrier(b);
    for (const VkMemoryBarrier2 &b : std::span(info.pMemoryBarriers, info.memoryBarrierCount))
        expectBarrier(key, where, b);
    for (const VkBufferMemoryBarrier2 &b : std::span(info.pBufferMemoryBarriers, info.bufferMemoryBarrierCount))
        expectBarrier(key, where, b);
    for (const VkImageMemoryBarrier2 &b : std::span(info.pImageMemoryBarriers, info.imageMemoryBarrierCount))
        expectBarrier(key, where, b);
    if (const auto *b = inChain<VkTensorMemoryBarrierARM>(info.pNext, VK_STRUCTURE_TYPE_TENSOR_MEMORY_BARRIER_ARM))
        expectBarrier(key, where, *b);
    if (const auto *tensors =
            inChain<VkTensorDependencyInfoARM>(info.pNext, VK_STRUCTURE_TYPE_TENSOR_DEPENDENCY_INFO_ARM)) {
        for (uint32_t i = 0; i < tensors->tensorMemoryBarrierCount; ++i)
            expectBarrier(key, where, tensors->pTensorMemoryBarriers[i]);
    }
}

// Barriers and semaphores of an application name only the stage of builds. A transfer that the layer adds to a build
// must therefore be ordered before later work in that stage, and after earlier work in it. A dispatch reads what an
// earlier transfer wrote; this holds for all dispatches of the layer.
struct Updates {
    bool built = false;       // there was a build in the command buffer
    bool pending = false;     // and then a transfer, and no barrier since
    bool waits = false;       // there was a barrier from that stage to transfers
    bool transferred = false; // there was a transfer, and no barrier after transfers since
};
std::map<VkCommandBuffer, Updates> updates;

// The application's own barriers are for its own transfers.
void forgetTransfers(VkCommandBuffer handle)
{
    std::lock_guard lock(mutex);
    updates[handle].transferred = false;
}

VKAPI_ATTR void VKAPI_CALL cmdPipelineBarrier2(VkCommandBuffer handle, const VkDependencyInfo *info)
{
    expectDependency(keyOf(handle), "vkCmdPipelineBarrier2", *info);
    forgetTransfers(handle);
    SPY_NEXT(vkCmdPipelineBarrier2)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL cmdSetEvent2(VkCommandBuffer handle, VkEvent event, const VkDependencyInfo *info)
{
    expectDependency(keyOf(handle), "vkCmdSetEvent2", *info);
    SPY_NEXT(vkCmdSetEvent2)(handle, event, info);
}

VKAPI_ATTR void VKAPI_CALL cmdResetEvent2(VkCommandBuffer handle, VkEvent event, VkPipelineStageFlags2 stages)
{
    expectStages(keyOf(handle), "vkCmdResetEvent2", stages);
    SPY_NEXT(vkCmdResetEvent2)(handle, event, stages);
}

VKAPI_ATTR void VKAPI_CALL cmdWaitEvents2(VkCommandBuffer handle, uint32_t count, const VkEvent *events,
                                          const VkDependencyInfo *infos)
{
    for (uint32_t i = 0; i < count; ++i)
        expectDependency(keyOf(handle), "vkCmdWaitEvents2", infos[i]);
    SPY_NEXT(vkCmdWaitEvents2)(handle, count, events, infos);
}

VKAPI_ATTR void VKAPI_CALL cmdWriteTimestamp2(VkCommandBuffer handle, VkPipelineStageFlags2 stage, VkQueryPool pool,
                                              uint32_t query)
{
    expectStages(keyOf(handle), "vkCmdWriteTimestamp2", stage);
    SPY_NEXT(vkCmdWriteTimestamp2)(handle, stage, pool, query);
}

bool hasMarkers()
{
    return std::getenv("VELLUM_TEST_SPY_MARKER") != nullptr;
}

// Offered on lavapipe, too, which lacks the extension.
VKAPI_ATTR void VKAPI_CALL cmdWriteBufferMarker2(VkCommandBuffer handle, VkPipelineStageFlags2 stage, VkBuffer buffer,
                                                 VkDeviceSize offset, uint32_t marker)
{
    expectStages(keyOf(handle), "vkCmdWriteBufferMarker2AMD", stage);
    if (hasMarkers())
        SPY_NEXT(vkCmdFillBuffer)(handle, buffer, offset, 4, marker);
}

bool hasVendorCommands()
{
    return std::getenv("VELLUM_TEST_SPY_VENDORS") != nullptr;
}

// Commands of other vendors, which lavapipe has not: they dispatch one workgroup.
VKAPI_ATTR void VKAPI_CALL cmdDispatchTile(VkCommandBuffer handle, const void *)
{
    SPY_NEXT(vkCmdDispatch)(handle, 1, 1, 1);
}
VKAPI_ATTR void VKAPI_CALL cmdExecuteGenerated(VkCommandBuffer handle, VkBool32, const void *)
{
    SPY_NEXT(vkCmdDispatch)(handle, 1, 1, 1);
}

VKAPI_ATTR VkResult VKAPI_CALL queueSubmit2(VkQueue handle, uint32_t count, const VkSubmitInfo2 *submits, VkFence fence)
{
    for (const VkSubmitInfo2 &s : std::span(submits, count)) {
        for (const VkSemaphoreSubmitInfo &w : std::span(s.pWaitSemaphoreInfos, s.waitSemaphoreInfoCount))
            expectStages(keyOf(handle), "vkQueueSubmit2", w.stageMask);
        for (const VkSemaphoreSubmitInfo &w : std::span(s.pSignalSemaphoreInfos, s.signalSemaphoreInfoCount))
            expectStages(keyOf(handle), "vkQueueSubmit2", w.stageMask);
    }
    return SPY_NEXT(vkQueueSubmit2)(handle, count, submits, fence);
}

VKAPI_ATTR VkResult VKAPI_CALL createRenderPass2(VkDevice handle, const VkRenderPassCreateInfo2 *info,
                                                 const VkAllocationCallbacks *allocator, VkRenderPass *pass)
{
    for (const VkSubpassDependency2 &d : std::span(info->pDependencies, info->dependencyCount)) {
        if (const void *barrier = inChain(d.pNext, VK_STRUCTURE_TYPE_MEMORY_BARRIER_2))
            expectBarrier(keyOf(handle), "vkCreateRenderPass2", *static_cast<const VkMemoryBarrier2 *>(barrier));
    }
    return SPY_NEXT(vkCreateRenderPass2)(handle, info, allocator, pass);
}

VKAPI_ATTR VkResult VKAPI_CALL beginCommandBuffer(VkCommandBuffer handle, const VkCommandBufferBeginInfo *info)
{
    {
        std::lock_guard lock(mutex);
        updates.erase(handle);
    }
    noteUsage(handle, info->flags);
    return SPY_NEXT(vkBeginCommandBuffer)(handle, info);
}

VKAPI_ATTR void VKAPI_CALL cmdUpdateBuffer(VkCommandBuffer handle, VkBuffer buffer, VkDeviceSize offset,
                                           VkDeviceSize size, const void *data)
{
    bool waits = false;
    {
        std::lock_guard lock(mutex);
        updates[handle].pending = updates[handle].built;
        updates[handle].transferred = true;
        waits = updates[handle].waits;
    }
    constexpr VkDeviceSize descriptor = 32; // the layer's size; the tests write other sizes
    if (size == descriptor && !waits)
        report("vkCmdUpdateBuffer: not ordered after builds before it");
    SPY_NEXT(vkCmdUpdateBuffer)(handle, buffer, offset, size, data);
}

void expectTransfersAreSeen(VkCommandBuffer handle, const char *where)
{
    bool transferred = false;
    {
        std::lock_guard lock(mutex);
        transferred = updates[handle].transferred;
    }
    if (transferred)
        report(std::string(where) + ": a transfer before it, and no barrier");
}

VKAPI_ATTR void VKAPI_CALL cmdDispatch(VkCommandBuffer handle, uint32_t x, uint32_t y, uint32_t z)
{
    expectTransfersAreSeen(handle, "vkCmdDispatch");
    SPY_NEXT(vkCmdDispatch)(handle, x, y, z);
}

VKAPI_ATTR void VKAPI_CALL cmdDispatchIndirect(VkCommandBuffer handle, VkBuffer buffer, VkDeviceSize offset)
{
    expectTransfersAreSeen(handle, "vkCmdDispatchIndirect");
    SPY_NEXT(vkCmdDispatchIndirect)(handle, buffer, offset);
}

VKAPI_ATTR void VKAPI_CALL cmdPipelineBarrier(VkCommandBuffer handle, VkPipelineStageFlags from,
                                              VkPipelineStageFlags to, VkDependencyFlags flags, uint32_t count,
                                              const VkMemoryBarrier *memory, uint32_t buffers,
                                              const VkBufferMemoryBarrier *buffer, uint32_t images,
                                              const VkImageMemoryBarrier *image)
{
    constexpr VkPipelineStageFlags transfer = VK_PIPELINE_STAGE_TRANSFER_BIT | VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
    constexpr VkPipelineStageFlags builds =
        VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR | VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
    {
        std::lock_guard lock(mutex);
        if ((from & transfer) != 0 && (to & builds) != 0)
            updates[handle].pending = false;
        if ((from & builds) != 0 && (to & transfer) != 0)
            updates[handle].waits = true;
        if ((from & transfer) != 0) // descriptors of structures are for builds, and not for the tests' own dispatches
            updates[handle].transferred = false;
    }
    SPY_NEXT(vkCmdPipelineBarrier)(handle, from, to, flags, count, memory, buffers, buffer, images, image);
}

VKAPI_ATTR VkResult VKAPI_CALL endCommandBuffer(VkCommandBuffer handle)
{
    bool pending = false;
    {
        std::lock_guard lock(mutex);
        pending = updates[handle].pending;
    }
    if (pending)
        report("vkEndCommandBuffer: a transfer after a build, and no barrier");
    return SPY_NEXT(vkEndCommandBuffer)(handle);
}

} // namespace

void noteBuild(VkCommandBuffer commands)
{
    std::lock_guard lock(mutex);
    updates[commands].built = true;
    updates[commands].pending = false;
}

std::span<const Row> synchronization()
{
    static const Row rows[]{
        {"vkBeginCommandBuffer", SPY_FUNCTION(beginCommandBuffer)},
        {"vkEndCommandBuffer", SPY_FUNCTION(endCommandBuffer)},
        {"vkCmdUpdateBuffer", SPY_FUNCTION(cmdUpdateBuffer)},
        {"vkCmdDispatch", SPY_FUNCTION(cmdDispatch)},
        {"vkCmdDispatchIndirect", SPY_FUNCTION(cmdDispatchIndirect)},
        {"vkCmdPipelineBarrier", SPY_FUNCTION(cmdPipelineBarrier)},
        {"vkCmdPipelineBarrier2", SPY_FUNCTION(cmdPipelineBarrier2)},
        {"vkCmdSetEvent2", SPY_FUNCTION(cmdSetEvent2)},
        {"vkCmdResetEvent2", SPY_FUNCTION(cmdResetEvent2)},
        {"vkCmdWaitEvents2", SPY_FUNCTION(cmdWaitEvents2)},
        {"vkCmdWriteTimestamp2", SPY_FUNCTION(cmdWriteTimestamp2)},
        {"vkQueueSubmit2", SPY_FUNCTION(queueSubmit2)},
        {"vkCreateRenderPass2", SPY_FUNCTION(createRenderPass2)},
        // The layer detects the extension by the first of them.
        {"vkCmdWriteBufferMarkerAMD", SPY_FUNCTION(cmdWriteBufferMarker2), Row::Where::Always, hasMarkers},
        {"vkCmdWriteBufferMarker2AMD", SPY_FUNCTION(cmdWriteBufferMarker2), Row::Where::Always},
        {"vkCmdDispatchTileQCOM", SPY_FUNCTION(cmdDispatchTile), Row::Where::Always, hasVendorCommands},
        {"vkCmdExecuteGeneratedCommandsNV", SPY_FUNCTION(cmdExecuteGenerated), Row::Where::Always, hasVendorCommands},
        {"vkCmdExecuteGeneratedCommandsEXT", SPY_FUNCTION(cmdExecuteGenerated), Row::Where::Always, hasVendorCommands},
    };
    return rows;
}

} // namespace spy
