// SPDX-License-Identifier: Apache-2.0
// Wrong barriers of address ranges, and stages and accesses of micromap builds in barriers, events, submissions and
// timestamps.
#include "range_commands.h"

namespace vt
{
namespace
{

constexpr VkPipelineStageFlags2 kCopy = VK_PIPELINE_STAGE_2_COPY_BIT;
constexpr VkPipelineStageFlags2 kBuild = VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT;

struct Scopes {
    VkPipelineStageFlags2 sourceStages = kCopy;
    VkAccessFlags2 sourceAccesses = 0;
    VkPipelineStageFlags2 targetStages = kCopy;
    VkAccessFlags2 targetAccesses = 0;
};

template <typename Barrier>
Barrier barrierOf(const Scopes &scopes)
{
    auto barrier = vkInit<Barrier>();
    barrier.srcStageMask = scopes.sourceStages;
    barrier.srcAccessMask = scopes.sourceAccesses;
    barrier.dstStageMask = scopes.targetStages;
    barrier.dstAccessMask = scopes.targetAccesses;
    return barrier;
}

using Barrier = void (*)(Gpu &, const Scopes &);

void record(Gpu &gpu, const VkDependencyInfo &info)
{
    recordOnly(gpu, [&](VkCommandBuffer commands) { vkCmdPipelineBarrier2(commands, &info); });
}

void memoryBarrier(Gpu &gpu, const Scopes &scopes)
{
    const auto barrier = barrierOf<VkMemoryBarrier2>(scopes);
    record(gpu, vkInit<VkDependencyInfo>({.memoryBarrierCount = 1, .pMemoryBarriers = &barrier}));
}

void bufferBarrier(Gpu &gpu, const Scopes &scopes)
{
    const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    auto barrier = barrierOf<VkBufferMemoryBarrier2>(scopes);
    barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    barrier.buffer = buffer.handle();
    barrier.size = VK_WHOLE_SIZE;
    record(gpu, vkInit<VkDependencyInfo>({.bufferMemoryBarrierCount = 1, .pBufferMemoryBarriers = &barrier}));
}

void imageBarrier(Gpu &gpu, const Scopes &scopes)
{
    const auto info = vkInit<VkImageCreateInfo>({.imageType = VK_IMAGE_TYPE_2D,
                                                 .format = VK_FORMAT_R32_UINT,
                                                 .extent = {4, 4, 1},
                                                 .mipLevels = 1,
                                                 .arrayLayers = 1,
                                                 .samples = VK_SAMPLE_COUNT_1_BIT,
                                                 .usage = VK_IMAGE_USAGE_TRANSFER_DST_BIT});
    VkImage image = VK_NULL_HANDLE;
    VT_CHECK(vkCreateImage(gpu.device(), &info, nullptr, &image));
    auto barrier = barrierOf<VkImageMemoryBarrier2>(scopes);
    barrier.newLayout = VK_IMAGE_LAYOUT_GENERAL;
    barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    barrier.image = image;
    barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    record(gpu, vkInit<VkDependencyInfo>({.imageMemoryBarrierCount = 1, .pImageMemoryBarriers = &barrier}));
    vkDestroyImage(gpu.device(), image, nullptr);
}

void recordRange(Gpu &gpu, const VkMemoryRangeBarrierKHR &barrier)
{
    const auto ranges =
        vkInit<VkMemoryRangeBarriersInfoKHR>({.memoryRangeBarrierCount = 1, .pMemoryRangeBarriers = &barrier});
    record(gpu, vkInit<VkDependencyInfo>({.pNext = &ranges}));
}

void rangeBarrier(Gpu &gpu, const Scopes &scopes)
{
    auto barrier = barrierOf<VkMemoryRangeBarrierKHR>(scopes);
    barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    recordRange(gpu, barrier);
}

// The access without the stage that makes it, and with it; in the first or the second half of the barrier.
template <Barrier barrier, VkAccessFlags2 mask, VkPipelineStageFlags2 stage, bool source>
void access(Gpu &gpu, bool wrong)
{
    const VkPipelineStageFlags2 stages = wrong ? kCopy : stage;
    if (source)
        barrier(gpu, {.sourceStages = stages, .sourceAccesses = mask});
    else
        barrier(gpu, {.targetStages = stages, .targetAccesses = mask});
}

template <Barrier barrier, bool source>
void shaderRead(Gpu &gpu, bool wrong)
{
    access<barrier, VK_ACCESS_2_SHADER_READ_BIT, VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT, source>(gpu, wrong);
}

template <Barrier barrier, bool source>
void micromapWrite(Gpu &gpu, bool wrong)
{
    access<barrier, VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT, kBuild, source>(gpu, wrong);
}

template <Barrier barrier, bool source>
void micromapRead(Gpu &gpu, bool wrong)
{
    access<barrier, VK_ACCESS_2_MICROMAP_READ_BIT_EXT, VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
           source>(gpu, wrong);
}

// The stage of micromap builds of VK_EXT_opacity_micromap, on a device with VK_KHR_opacity_micromap.
template <Barrier barrier, bool source>
void buildStage(Gpu &gpu, bool wrong)
{
    const VkPipelineStageFlags2 stages = wrong ? kBuild : kCopy;
    if (source)
        barrier(gpu, {.sourceStages = stages});
    else
        barrier(gpu, {.targetStages = stages});
}

void transfer(Gpu &gpu, uint32_t from, uint32_t to, VkPipelineStageFlags2 stages = kCopy)
{
    const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    auto barrier = barrierOf<VkMemoryRangeBarrierKHR>({.sourceStages = stages, .targetStages = stages});
    barrier.srcQueueFamilyIndex = from;
    barrier.dstQueueFamilyIndex = to;
    barrier.addressRange = {buffer.address(), 64};
    barrier.addressFlags = kUnknownUsage;
    recordRange(gpu, barrier);
}

void fromNoFamily(Gpu &gpu, bool wrong)
{
    transfer(gpu, wrong ? 1000 : VK_QUEUE_FAMILY_EXTERNAL, gpu.family());
}

void toNoFamily(Gpu &gpu, bool wrong)
{
    transfer(gpu, gpu.family(), wrong ? 1000 : VK_QUEUE_FAMILY_EXTERNAL);
}

void familiesWithHost(Gpu &gpu, bool wrong)
{
    transfer(gpu, wrong ? VK_QUEUE_FAMILY_EXTERNAL : gpu.family(), gpu.family(), VK_PIPELINE_STAGE_2_HOST_BIT);
}

void stageOfReset(Gpu &gpu, bool wrong)
{
    const auto info = vkInit<VkEventCreateInfo>();
    VkEvent event = VK_NULL_HANDLE;
    VT_CHECK(vkCreateEvent(gpu.device(), &info, nullptr, &event));
    recordOnly(gpu, [&](VkCommandBuffer commands) { vkCmdResetEvent2(commands, event, wrong ? kBuild : kCopy); });
    vkDestroyEvent(gpu.device(), event, nullptr);
}

void stageOfTimestamp(Gpu &gpu, bool wrong)
{
    const QueryPool pool(gpu, VK_QUERY_TYPE_TIMESTAMP, 1);
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        vkCmdWriteTimestamp2(commands, wrong ? kBuild : VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, pool, 0);
    });
}

void stageOfMarker(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    const auto mark = reinterpret_cast<PFN_vkCmdWriteBufferMarker2AMD>(
        vkGetDeviceProcAddr(gpu.device(), "vkCmdWriteBufferMarker2AMD"));
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        mark(commands, wrong ? kBuild : VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, buffer.handle(), 0, 1);
    });
}

void stageOfSemaphore(Gpu &gpu, bool wrong)
{
    const auto info = vkInit<VkSemaphoreCreateInfo>();
    VkSemaphore semaphore = VK_NULL_HANDLE;
    VT_CHECK(vkCreateSemaphore(gpu.device(), &info, nullptr, &semaphore));
    const auto signal = vkInit<VkSemaphoreSubmitInfo>(
        {.semaphore = semaphore, .stageMask = wrong ? kBuild : VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT});
    const auto submit = vkInit<VkSubmitInfo2>({.signalSemaphoreInfoCount = 1, .pSignalSemaphoreInfos = &signal});
    VT_CHECK(vkQueueSubmit2(gpu.queue(), 1, &submit, VK_NULL_HANDLE));
    VT_CHECK(vkQueueWaitIdle(gpu.queue()));
    vkDestroySemaphore(gpu.device(), semaphore, nullptr);
}

constexpr WrongProgram kPrograms[] = {
    {"VUID-VkMemoryBarrier2-srcAccessMask-07454", Api::Ext, kNeedsNothing, shaderRead<memoryBarrier, true>},
    {"VUID-VkMemoryBarrier2-srcAccessMask-07457", Api::Ext, kNeedsNothing, micromapWrite<memoryBarrier, true>},
    {"VUID-VkMemoryBarrier2-srcAccessMask-07458", Api::Ext, kNeedsNothing, micromapRead<memoryBarrier, true>},
    {"VUID-VkMemoryBarrier2-srcStageMask-11541", Api::Khr, kNeedsNothing, buildStage<memoryBarrier, true>},
    {"VUID-VkMemoryBarrier2-dstAccessMask-07454", Api::Ext, kNeedsNothing, shaderRead<memoryBarrier, false>},
    {"VUID-VkMemoryBarrier2-dstAccessMask-07457", Api::Ext, kNeedsNothing, micromapWrite<memoryBarrier, false>},
    {"VUID-VkMemoryBarrier2-dstAccessMask-07458", Api::Ext, kNeedsNothing, micromapRead<memoryBarrier, false>},
    {"VUID-VkMemoryBarrier2-dstStageMask-11541", Api::Khr, kNeedsNothing, buildStage<memoryBarrier, false>},
    {"VUID-VkBufferMemoryBarrier2-srcAccessMask-07454", Api::Ext, kNeedsNothing, shaderRead<bufferBarrier, true>},
    {"VUID-VkBufferMemoryBarrier2-srcAccessMask-07457", Api::Ext, kNeedsNothing, micromapWrite<bufferBarrier, true>},
    {"VUID-VkBufferMemoryBarrier2-srcAccessMask-07458", Api::Ext, kNeedsNothing, micromapRead<bufferBarrier, true>},
    {"VUID-VkBufferMemoryBarrier2-srcStageMask-11541", Api::Khr, kNeedsNothing, buildStage<bufferBarrier, true>},
    {"VUID-VkBufferMemoryBarrier2-dstAccessMask-07454", Api::Ext, kNeedsNothing, shaderRead<bufferBarrier, false>},
    {"VUID-VkBufferMemoryBarrier2-dstAccessMask-07457", Api::Ext, kNeedsNothing, micromapWrite<bufferBarrier, false>},
    {"VUID-VkBufferMemoryBarrier2-dstAccessMask-07458", Api::Ext, kNeedsNothing, micromapRead<bufferBarrier, false>},
    {"VUID-VkBufferMemoryBarrier2-dstStageMask-11541", Api::Khr, kNeedsNothing, buildStage<bufferBarrier, false>},
    {"VUID-VkImageMemoryBarrier2-srcAccessMask-07454", Api::Ext, kNeedsNothing, shaderRead<imageBarrier, true>},
    {"VUID-VkImageMemoryBarrier2-srcAccessMask-07457", Api::Ext, kNeedsNothing, micromapWrite<imageBarrier, true>},
    {"VUID-VkImageMemoryBarrier2-srcAccessMask-07458", Api::Ext, kNeedsNothing, micromapRead<imageBarrier, true>},
    {"VUID-VkImageMemoryBarrier2-srcStageMask-11541", Api::Khr, kNeedsNothing, buildStage<imageBarrier, true>},
    {"VUID-VkImageMemoryBarrier2-dstAccessMask-07454", Api::Ext, kNeedsNothing, shaderRead<imageBarrier, false>},
    {"VUID-VkImageMemoryBarrier2-dstAccessMask-07457", Api::Ext, kNeedsNothing, micromapWrite<imageBarrier, false>},
    {"VUID-VkImageMemoryBarrier2-dstAccessMask-07458", Api::Ext, kNeedsNothing, micromapRead<imageBarrier, false>},
    {"VUID-VkImageMemoryBarrier2-dstStageMask-11541", Api::Khr, kNeedsNothing, buildStage<imageBarrier, false>},
    {"VUID-VkMemoryRangeBarrierKHR-srcAccessMask-07454", Api::Khr, kNeedsBothApis | kNeedsAddressCommands,
     shaderRead<rangeBarrier, true>},
    {"VUID-VkMemoryRangeBarrierKHR-srcAccessMask-07457", Api::Khr, kNeedsBothApis | kNeedsAddressCommands,
     micromapWrite<rangeBarrier, true>},
    {"VUID-VkMemoryRangeBarrierKHR-srcAccessMask-07458", Api::Khr, kNeedsBothApis | kNeedsAddressCommands,
     micromapRead<rangeBarrier, true>},
    {"VUID-VkMemoryRangeBarrierKHR-srcStageMask-11541", Api::Khr, kNeedsAddressCommands,
     buildStage<rangeBarrier, true>},
    {"VUID-VkMemoryRangeBarrierKHR-dstAccessMask-07454", Api::Khr, kNeedsBothApis | kNeedsAddressCommands,
     shaderRead<rangeBarrier, false>},
    {"VUID-VkMemoryRangeBarrierKHR-dstAccessMask-07457", Api::Khr, kNeedsBothApis | kNeedsAddressCommands,
     micromapWrite<rangeBarrier, false>},
    {"VUID-VkMemoryRangeBarrierKHR-dstAccessMask-07458", Api::Khr, kNeedsBothApis | kNeedsAddressCommands,
     micromapRead<rangeBarrier, false>},
    {"VUID-VkMemoryRangeBarrierKHR-dstStageMask-11541", Api::Khr, kNeedsAddressCommands,
     buildStage<rangeBarrier, false>},
    {"VUID-VkMemoryRangeBarrierKHR-address-13087", Api::Khr, kNeedsAddressCommands, fromNoFamily},
    {"VUID-VkMemoryRangeBarrierKHR-address-13088", Api::Khr, kNeedsAddressCommands, toNoFamily},
    {"VUID-VkMemoryRangeBarrierKHR-srcStageMask-13089", Api::Khr, kNeedsAddressCommands, familiesWithHost},
    {"VUID-vkCmdResetEvent2-stageMask-11541", Api::Khr, kNeedsNothing, stageOfReset},
    {"VUID-vkCmdWriteTimestamp2-stage-11541", Api::Khr, kNeedsNothing, stageOfTimestamp},
    {"VUID-vkCmdWriteBufferMarker2AMD-stage-11541", Api::Khr, kNeedsMarkers | kNeedsAddressCommands, stageOfMarker},
    {"VUID-VkSemaphoreSubmitInfo-stageMask-11541", Api::Khr, kNeedsNothing, stageOfSemaphore},
};

} // namespace

std::span<const WrongProgram> barrierRangePrograms()
{
    return kPrograms;
}

} // namespace vt
