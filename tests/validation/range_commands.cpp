// SPDX-License-Identifier: Apache-2.0
#include "range_commands.h"

namespace vt
{
namespace
{

constexpr VkBufferUsageFlags kAddress = VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

// Other objects that the commands need.
struct Others {
    std::unique_ptr<RangeBuffer> source, target, indirect;
    QueryPool queries;
    std::unique_ptr<DeviceImage> image;

    void make(Gpu &owner)
    {
        source = std::make_unique<RangeBuffer>(owner, VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
        target = std::make_unique<RangeBuffer>(owner, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
        indirect = std::make_unique<RangeBuffer>(owner, VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT);
        queries = QueryPool(owner, VK_QUERY_TYPE_TIMESTAMP, 4);
        image = std::make_unique<DeviceImage>(
            owner,
            vkInit<VkImageCreateInfo>({.imageType = VK_IMAGE_TYPE_2D,
                                       .format = VK_FORMAT_R32_UINT,
                                       .extent = {4, 4, 1},
                                       .mipLevels = 1,
                                       .arrayLayers = 1,
                                       .samples = VK_SAMPLE_COUNT_1_BIT,
                                       .usage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT}));
    }
    static std::shared_ptr<Others> of(Gpu &gpu)
    {
        auto others = gpu.kept<Others>();
        if (!others->image)
            others->make(gpu);
        return others;
    }
};

using Range = VkDeviceAddressRangeKHR;
using Flags = VkAddressCommandFlagsKHR;

VkStridedDeviceAddressRangeKHR strided(const Range &range, VkDeviceSize stride)
{
    return {range.address, range.size, stride};
}

void copySource(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto region = vkInit<VkDeviceMemoryCopyKHR>({.srcRange = range,
                                                       .srcFlags = flags,
                                                       .dstRange = {Others::of(gpu)->target->address(), range.size},
                                                       .dstFlags = kUnknownUsage});
    const auto info = vkInit<VkCopyDeviceMemoryInfoKHR>({.regionCount = 1, .pRegions = &region});
    gpu.vk().CmdCopyMemoryKHR(commands, &info);
}

void copyTarget(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto region = vkInit<VkDeviceMemoryCopyKHR>({.srcRange = {Others::of(gpu)->source->address(), range.size},
                                                       .srcFlags = kUnknownUsage,
                                                       .dstRange = range,
                                                       .dstFlags = flags});
    const auto info = vkInit<VkCopyDeviceMemoryInfoKHR>({.regionCount = 1, .pRegions = &region});
    gpu.vk().CmdCopyMemoryKHR(commands, &info);
}

void copyImage(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags, bool toMemory)
{
    const auto region = vkInit<VkDeviceMemoryImageCopyKHR>({.addressRange = range,
                                                            .addressFlags = flags,
                                                            .imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1},
                                                            .imageLayout = VK_IMAGE_LAYOUT_GENERAL,
                                                            .imageExtent = {4, 4, 1}});
    const auto info = vkInit<VkCopyDeviceMemoryImageInfoKHR>(
        {.image = Others::of(gpu)->image->handle(), .regionCount = 1, .pRegions = &region});
    toMemory ? gpu.vk().CmdCopyImageToMemoryKHR(commands, &info) : gpu.vk().CmdCopyMemoryToImageKHR(commands, &info);
}

void imageCopy(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    copyImage(gpu, commands, range, flags, true);
}

void imageSource(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    copyImage(gpu, commands, range, flags, false);
}

void fill(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    gpu.vk().CmdFillMemoryKHR(commands, &range, flags, 7);
}

void update(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const std::array<uint32_t, 4> data{};
    gpu.vk().CmdUpdateMemoryKHR(commands, &range, flags, sizeof data, data.data());
}

void queryResults(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto target = strided(range, 8);
    vkCmdResetQueryPool(commands, Others::of(gpu)->queries, 0, 4);
    gpu.vk().CmdCopyQueryPoolResultsToMemoryKHR(commands, Others::of(gpu)->queries, 0, 4, &target, flags, 0);
}

void marker(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto info = vkInit<VkMemoryMarkerInfoAMD>(
        {.stage = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, .dstRange = range, .dstFlags = flags, .marker = 1});
    gpu.vk().CmdWriteMarkerToMemoryAMD(commands, &info);
}

void indexBuffer(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto info = vkInit<VkBindIndexBuffer3InfoKHR>(
        {.addressRange = range, .addressFlags = flags, .indexType = VK_INDEX_TYPE_UINT32});
    gpu.vk().CmdBindIndexBuffer3KHR(commands, &info);
}

void vertexBuffer(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto info = vkInit<VkBindVertexBuffer3InfoKHR>(
        {.setStride = VK_TRUE, .addressRange = strided(range, 0), .addressFlags = flags});
    gpu.vk().CmdBindVertexBuffers3KHR(commands, 0, 1, &info);
}

VkBindTransformFeedbackBuffer2InfoEXT feedbackInfo(const Range &range, Flags flags)
{
    return vkInit<VkBindTransformFeedbackBuffer2InfoEXT>({.addressRange = range, .addressFlags = flags});
}

void feedbackBuffer(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto info = feedbackInfo(range, flags);
    gpu.vk().CmdBindTransformFeedbackBuffers2EXT(commands, 0, 1, &info);
}

void feedbackCounter(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto info = feedbackInfo(range, flags);
    gpu.vk().CmdBeginTransformFeedback2EXT(commands, 0, 1, &info);
    gpu.vk().CmdEndTransformFeedback2EXT(commands, 0, 0, nullptr);
}

void feedbackEnd(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto info = feedbackInfo(range, flags);
    gpu.vk().CmdBeginTransformFeedback2EXT(commands, 0, 0, nullptr);
    gpu.vk().CmdEndTransformFeedback2EXT(commands, 0, 1, &info);
}

void byteCount(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto info = feedbackInfo(range, flags);
    gpu.vk().CmdDrawIndirectByteCount2EXT(commands, 1, 0, &info, 0, 16);
}

VkDrawIndirect2InfoKHR drawInfo(const Range &range, Flags flags)
{
    return vkInit<VkDrawIndirect2InfoKHR>({.addressRange = strided(range, 20), .addressFlags = flags, .drawCount = 1});
}

VkDrawIndirectCount2InfoKHR countedInfo(Gpu &gpu, const Range &range, Flags flags)
{
    return vkInit<VkDrawIndirectCount2InfoKHR>(
        {.addressRange = strided(range, 20),
         .addressFlags = flags,
         .countAddressRange = {Others::of(gpu)->indirect->address(), sizeof(uint32_t)},
         .countAddressFlags = kUnknownUsage,
         .maxDrawCount = 1});
}

void draw(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto info = drawInfo(range, flags);
    gpu.vk().CmdDrawIndirect2KHR(commands, &info);
}

void indexedDraw(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto info = drawInfo(range, flags);
    gpu.vk().CmdDrawIndexedIndirect2KHR(commands, &info);
}

void meshDraw(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto info = drawInfo(range, flags);
    gpu.vk().CmdDrawMeshTasksIndirect2EXT(commands, &info);
}

void countedDraw(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto info = countedInfo(gpu, range, flags);
    gpu.vk().CmdDrawIndirectCount2KHR(commands, &info);
}

void indexedCountedDraw(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto info = countedInfo(gpu, range, flags);
    gpu.vk().CmdDrawIndexedIndirectCount2KHR(commands, &info);
}

void meshCountedDraw(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto info = countedInfo(gpu, range, flags);
    gpu.vk().CmdDrawMeshTasksIndirectCount2EXT(commands, &info);
}

void drawCount(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    auto info = countedInfo(gpu, {Others::of(gpu)->indirect->address(), 64}, kUnknownUsage);
    info.countAddressRange = range;
    info.countAddressFlags = flags;
    gpu.vk().CmdDrawIndirectCount2KHR(commands, &info);
}

void dispatch(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto info = vkInit<VkDispatchIndirect2InfoKHR>({.addressRange = range, .addressFlags = flags});
    gpu.vk().CmdDispatchIndirect2KHR(commands, &info);
}

void condition(Gpu &gpu, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto info = vkInit<VkConditionalRenderingBeginInfo2EXT>({.addressRange = range, .addressFlags = flags});
    gpu.vk().CmdBeginConditionalRendering2EXT(commands, &info);
    gpu.vk().CmdEndConditionalRenderingEXT(commands);
}

void rangeBarrier(Gpu &, VkCommandBuffer commands, const Range &range, Flags flags)
{
    const auto barrier = vkInit<VkMemoryRangeBarrierKHR>({.srcStageMask = VK_PIPELINE_STAGE_2_COPY_BIT,
                                                          .srcAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT,
                                                          .dstStageMask = VK_PIPELINE_STAGE_2_COPY_BIT,
                                                          .dstAccessMask = VK_ACCESS_2_TRANSFER_READ_BIT,
                                                          .srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                                          .dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                                          .addressRange = range,
                                                          .addressFlags = flags});
    const auto ranges =
        vkInit<VkMemoryRangeBarriersInfoKHR>({.memoryRangeBarrierCount = 1, .pMemoryRangeBarriers = &barrier});
    const auto info = vkInit<VkDependencyInfo>({.pNext = &ranges});
    vkCmdPipelineBarrier2(commands, &info);
}

// A structure on the range; no command of a command buffer.
void creation(Gpu &gpu, VkCommandBuffer, const Range &range, Flags flags)
{
    const auto info = vkInit<VkAccelerationStructureCreateInfo2KHR>(
        {.addressRange = range, .addressFlags = flags, .type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR});
    VkAccelerationStructureKHR structure = VK_NULL_HANDLE;
    if (gpu.vk().CreateAccelerationStructure2KHR(gpu.device(), &info, nullptr, &structure) == VK_SUCCESS)
        gpu.vk().DestroyAccelerationStructureKHR(gpu.device(), structure, nullptr);
}

} // namespace

RangeBuffer::RangeBuffer(Gpu &gpu, VkBufferUsageFlags usage, VkBufferCreateFlags flags, VkDeviceSize size) : gpu_(gpu)
{
    const auto info = vkInit<VkBufferCreateInfo>({.flags = flags, .size = size, .usage = usage | kAddress});
    VT_CHECK(vkCreateBuffer(gpu.device(), &info, nullptr, &buffer_));
    if ((flags & VK_BUFFER_CREATE_SPARSE_BINDING_BIT) == 0)
        memory_ = gpu.bindMemory(buffer_);
    address_ = gpu.address(buffer_);
}

RangeBuffer::~RangeBuffer()
{
    vkDestroyBuffer(gpu_.device(), buffer_, nullptr);
    vkFreeMemory(gpu_.device(), memory_, nullptr);
}

void RangeBuffer::bind()
{
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(gpu_.device(), buffer_, &needs);
    memory_ = gpu_.allocate(needs);
    const VkSparseMemoryBind bind{.size = needs.size, .memory = memory_};
    const VkSparseBufferMemoryBindInfo binds{buffer_, 1, &bind};
    const auto info = vkInit<VkBindSparseInfo>({.bufferBindCount = 1, .pBufferBinds = &binds});
    VT_CHECK(vkQueueBindSparse(gpu_.queue(), 1, &info, VK_NULL_HANDLE));
    VT_CHECK(vkQueueWaitIdle(gpu_.queue()));
}

void recordOnly(Gpu &gpu, const std::function<void(VkCommandBuffer)> &record, bool isProtected, uint32_t family)
{
    const auto poolInfo = vkInit<VkCommandPoolCreateInfo>(
        {.flags = isProtected ? VkCommandPoolCreateFlags{VK_COMMAND_POOL_CREATE_PROTECTED_BIT} : 0,
         .queueFamilyIndex = family == UINT32_MAX ? gpu.family() : family});
    VkCommandPool pool = VK_NULL_HANDLE;
    VT_CHECK(vkCreateCommandPool(gpu.device(), &poolInfo, nullptr, &pool));
    const auto info = vkInit<VkCommandBufferAllocateInfo>(
        {.commandPool = pool, .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY, .commandBufferCount = 1});
    VkCommandBuffer commands = VK_NULL_HANDLE;
    VT_CHECK(vkAllocateCommandBuffers(gpu.device(), &info, &commands));
    const auto begin = vkInit<VkCommandBufferBeginInfo>();
    VT_CHECK(vkBeginCommandBuffer(commands, &begin));
    record(commands);
    VT_CHECK(vkEndCommandBuffer(commands));
    vkDestroyCommandPool(gpu.device(), pool, nullptr);
}

constexpr VkBufferUsageFlags kIndirect = VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;
constexpr VkBufferUsageFlags kCounter = VK_BUFFER_USAGE_TRANSFORM_FEEDBACK_COUNTER_BUFFER_BIT_EXT;
const RangeCommand kCopySource{VK_BUFFER_USAGE_TRANSFER_SRC_BIT, copySource};
const RangeCommand kCopyTarget{VK_BUFFER_USAGE_TRANSFER_DST_BIT, copyTarget};
const RangeCommand kImageCopy{VK_BUFFER_USAGE_TRANSFER_DST_BIT, imageCopy};
const RangeCommand kImageSource{VK_BUFFER_USAGE_TRANSFER_SRC_BIT, imageSource};
const RangeCommand kFill{VK_BUFFER_USAGE_TRANSFER_DST_BIT, fill};
const RangeCommand kUpdate{VK_BUFFER_USAGE_TRANSFER_DST_BIT, update};
const RangeCommand kQueryResults{VK_BUFFER_USAGE_TRANSFER_DST_BIT, queryResults};
const RangeCommand kMarker{VK_BUFFER_USAGE_TRANSFER_DST_BIT, marker};
const RangeCommand kIndexBuffer{VK_BUFFER_USAGE_INDEX_BUFFER_BIT, indexBuffer};
const RangeCommand kVertexBuffer{VK_BUFFER_USAGE_VERTEX_BUFFER_BIT, vertexBuffer};
const RangeCommand kFeedbackBuffer{VK_BUFFER_USAGE_TRANSFORM_FEEDBACK_BUFFER_BIT_EXT, feedbackBuffer};
const RangeCommand kFeedbackCounter{kCounter, feedbackCounter};
const RangeCommand kFeedbackEnd{kCounter, feedbackEnd};
const RangeCommand kByteCount{kIndirect, byteCount};
const RangeCommand kDraw{kIndirect, draw};
const RangeCommand kIndexedDraw{kIndirect, indexedDraw};
const RangeCommand kMeshDraw{kIndirect, meshDraw};
const RangeCommand kCountedDraw{kIndirect, countedDraw};
const RangeCommand kIndexedCountedDraw{kIndirect, indexedCountedDraw};
const RangeCommand kMeshCountedDraw{kIndirect, meshCountedDraw};
const RangeCommand kDrawCount{kIndirect, drawCount};
const RangeCommand kDispatch{kIndirect, dispatch};
const RangeCommand kCondition{VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT, condition};
const RangeCommand kBarrier{VK_BUFFER_USAGE_TRANSFER_DST_BIT, rangeBarrier};
const RangeCommand kCreation{VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR, creation, 4096};

} // namespace vt
