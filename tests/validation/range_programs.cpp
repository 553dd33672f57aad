// SPDX-License-Identifier: Apache-2.0
// Wrong address ranges of copies, fills, updates, query results and markers.
#include "range_commands.h"

namespace vt
{
namespace
{

constexpr VkBufferUsageFlags kTransfers = VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;

// --- rules that each command has ---

template <const RangeCommand &command>
void nullRange(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, command.usage);
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        command.record(gpu, commands, {wrong ? 0 : buffer.address(), command.size}, kUnknownUsage);
    });
}

template <const RangeCommand &command>
void pastTheEnd(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, command.usage);
    const VkDeviceSize offset = RangeBuffer::kSize - command.size + (wrong ? 16 : 0);
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        command.record(gpu, commands, {buffer.address() + offset, command.size}, kUnknownUsage);
    });
}

template <const RangeCommand &command>
void destroyedBuffer(Gpu &gpu, bool wrong)
{
    auto buffer = std::make_unique<RangeBuffer>(gpu, command.usage);
    const VkDeviceAddress address = buffer->address();
    if (wrong)
        buffer.reset();
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        command.record(gpu, commands, {address, command.size}, kUnknownUsage);
    });
}

// --- copies ---

VkDeviceMemoryCopyKHR regionOf(const VkDeviceAddressRangeKHR &from, const VkDeviceAddressRangeKHR &to)
{
    return vkInit<VkDeviceMemoryCopyKHR>(
        {.srcRange = from, .srcFlags = kUnknownUsage, .dstRange = to, .dstFlags = kUnknownUsage});
}

void copy(Gpu &gpu, std::span<const VkDeviceMemoryCopyKHR> regions)
{
    const auto info = vkInit<VkCopyDeviceMemoryInfoKHR>(
        {.regionCount = static_cast<uint32_t>(regions.size()), .pRegions = regions.data()});
    recordOnly(gpu, [&](VkCommandBuffer commands) { gpu.vk().CmdCopyMemoryKHR(commands, &info); });
}

void smallTarget(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, kTransfers);
    const auto region = regionOf({buffer.address(), 64}, {buffer.address() + 128, wrong ? 60u : 64u});
    copy(gpu, std::span(&region, 1));
}

void overlapInsideARegion(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, kTransfers);
    const auto region = regionOf({buffer.address(), 64}, {buffer.address() + (wrong ? 63 : 64), 64});
    copy(gpu, std::span(&region, 1));
}

void overlapOfRegions(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, kTransfers);
    const VkDeviceAddress at = buffer.address();
    const std::array regions{regionOf({at, 64}, {at + 256, 64}),
                             regionOf({at + 128, 64}, {at + (wrong ? 32 : 512), 64})};
    copy(gpu, regions);
}

void overlapOfSources(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, kTransfers);
    const VkDeviceAddress at = buffer.address();
    const std::array regions{regionOf({at, 64}, {at + 256, 64}),
                             regionOf({at + (wrong ? 32 : 64), 64}, {at + 512, 64})};
    copy(gpu, regions);
}

// --- updates and markers ---

void updateSize(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    const std::array<uint32_t, 4> data{};
    const VkDeviceAddressRangeKHR range{buffer.address(), 16};
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        gpu.vk().CmdUpdateMemoryKHR(commands, &range, kUnknownUsage, wrong ? 14 : 16, data.data());
    });
}

void mark(Gpu &gpu, VkPipelineStageFlags2 stage)
{
    const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    const auto info = vkInit<VkMemoryMarkerInfoAMD>(
        {.stage = stage, .dstRange = {buffer.address(), 4}, .dstFlags = kUnknownUsage, .marker = 1});
    recordOnly(gpu, [&](VkCommandBuffer commands) { gpu.vk().CmdWriteMarkerToMemoryAMD(commands, &info); });
}

void stagesOfMarker(Gpu &gpu, bool wrong)
{
    mark(gpu, wrong ? VK_PIPELINE_STAGE_2_COPY_BIT | VK_PIPELINE_STAGE_2_CLEAR_BIT : VK_PIPELINE_STAGE_2_COPY_BIT);
}

void markerWithoutSynchronization2(Gpu &gpu, bool wrong)
{
    if (wrong)
        mark(gpu, VK_PIPELINE_STAGE_2_COPY_BIT);
}

// --- query results ---

void queryResults(Gpu &gpu, VkDeviceSize offset, VkDeviceSize bytes, VkDeviceSize stride, VkQueryResultFlags flags)
{
    const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    const QueryPool pool(gpu, VK_QUERY_TYPE_TIMESTAMP, 4);
    const VkStridedDeviceAddressRangeKHR range{buffer.address() + offset, bytes, stride};
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        gpu.vk().CmdCopyQueryPoolResultsToMemoryKHR(commands, pool, 0, 4, &range, kUnknownUsage, flags);
    });
}

void narrowResults(Gpu &gpu, bool wrong)
{
    queryResults(gpu, wrong ? 2 : 0, 64, 8, 0);
}

void narrowStride(Gpu &gpu, bool wrong)
{
    queryResults(gpu, 0, 64, wrong ? 6 : 8, 0);
}

void wideResults(Gpu &gpu, bool wrong)
{
    queryResults(gpu, wrong ? 4 : 0, 64, 8, VK_QUERY_RESULT_64_BIT);
}

void fewResults(Gpu &gpu, bool wrong)
{
    queryResults(gpu, 0, wrong ? 31 : 32, 8, VK_QUERY_RESULT_64_BIT);
}

void availability(Gpu &gpu, bool wrong)
{
    queryResults(gpu, 0, wrong ? 60 : 64, 16, VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WITH_AVAILABILITY_BIT);
}

void protectedResults(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_TRANSFER_DST_BIT, wrong ? kProtectedBuffer : 0);
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        kQueryResults.record(gpu, commands, {buffer.address(), 64}, wrong ? kProtectedRange : kUnknownUsage);
    });
}

constexpr auto kNeeds = kNeedsAddressCommands;
constexpr auto kMarkers = kNeedsAddressCommands | kNeedsMarkers;

constexpr WrongProgram kPrograms[] = {
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kFill>},
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kUpdate>, "Update"},
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kCopySource>, "CopySource"},
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kImageCopy>, "ImageCopy"},
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kIndexBuffer>, "IndexBuffer"},
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kDispatch>, "Dispatch"},
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kCondition>, "Condition"},
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kDrawCount>, "DrawCount"},
    {"VUID-VkDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kBarrier>, "Barrier"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kFill>},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, destroyedBuffer<kFill>, "Destroyed"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kUpdate>, "Update"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kCopySource>, "CopySource"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kCopyTarget>, "CopyTarget"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kImageCopy>, "ImageCopy"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kMarkers, pastTheEnd<kMarker>, "Marker"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kIndexBuffer>, "IndexBuffer"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kFeedbackBuffer>, "Feedback"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kDispatch>, "Dispatch"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kDrawCount>, "DrawCount"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kCondition>, "Condition"},
    {"VUID-VkDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kBarrier>, "Barrier"},
    {"VUID-VkStridedDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kDraw>},
    {"VUID-VkStridedDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kQueryResults>, "QueryResults"},
    {"VUID-VkStridedDeviceAddressRangeKHR-size-11411", Api::Khr, kNeeds, nullRange<kVertexBuffer>, "VertexBuffer"},
    {"VUID-VkStridedDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kDraw>},
    {"VUID-VkStridedDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kCountedDraw>, "Counted"},
    {"VUID-VkStridedDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kQueryResults>, "QueryResults"},
    {"VUID-VkStridedDeviceAddressRangeKHR-address-11365", Api::Khr, kNeeds, pastTheEnd<kVertexBuffer>, "VertexBuffer"},

    {"VUID-VkDeviceMemoryCopyKHR-srcRange-13017", Api::Khr, kNeeds, usage<kCopySource>},
    {"VUID-VkDeviceMemoryCopyKHR-dstRange-13018", Api::Khr, kNeeds, usage<kCopyTarget>},
    {"VUID-VkDeviceMemoryCopyKHR-size-13016", Api::Khr, kNeeds, smallTarget},
    {"VUID-VkCopyDeviceMemoryInfoKHR-srcRange-13015", Api::Khr, kNeeds, overlapInsideARegion},
    {"VUID-VkCopyDeviceMemoryInfoKHR-srcRange-13015", Api::Khr, kNeeds, overlapOfRegions, "Regions"},
    {"VUID-VkCopyDeviceMemoryInfoKHR-srcRange-13015", Api::Khr, kNeeds, overlapOfSources, "Sources"},
    {"VUID-vkCmdCopyMemoryKHR-commandBuffer-13012", Api::Khr, kNeeds, protectedFlag<kCopySource>},
    {"VUID-vkCmdCopyMemoryKHR-commandBuffer-13013", Api::Khr, kNeeds, protectedFlag<kCopyTarget>},
    {"VUID-vkCmdCopyMemoryKHR-commandBuffer-13014", Api::Khr, kNeeds, protectedCommands<kCopyTarget>},

    {"VUID-vkCmdFillMemoryKHR-dstRange-13000", Api::Khr, kNeeds, usage<kFill>},
    {"VUID-vkCmdFillMemoryKHR-pDstRange-13001", Api::Khr, kNeeds, alignment<kFill, 2>},
    {"VUID-vkCmdFillMemoryKHR-pDstRange-13002", Api::Khr, kNeeds, size<kFill, 64, 62>},
    {"VUID-vkCmdFillMemoryKHR-commandBuffer-13003", Api::Khr, kNeeds, protectedFlag<kFill>},
    {"VUID-vkCmdFillMemoryKHR-commandBuffer-13004", Api::Khr, kNeeds, protectedCommands<kFill>},

    {"VUID-vkCmdUpdateMemoryKHR-dstRange-13005", Api::Khr, kNeeds, usage<kUpdate>},
    {"VUID-vkCmdUpdateMemoryKHR-pDstRange-13006", Api::Khr, kNeeds, alignment<kUpdate, 2>},
    {"VUID-vkCmdUpdateMemoryKHR-pDstRange-13007", Api::Khr, kNeeds, size<kUpdate, 65536, 65540>},
    {"VUID-vkCmdUpdateMemoryKHR-dataSize-13008", Api::Khr, kNeeds, size<kUpdate, 16, 12>},
    {"VUID-vkCmdUpdateMemoryKHR-dataSize-13009", Api::Khr, kNeeds, updateSize},
    {"VUID-vkCmdUpdateMemoryKHR-commandBuffer-13010", Api::Khr, kNeeds, protectedFlag<kUpdate>},
    {"VUID-vkCmdUpdateMemoryKHR-commandBuffer-13011", Api::Khr, kNeeds, protectedCommands<kUpdate>},

    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13080", Api::Khr, kNeeds, usage<kQueryResults>},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-flags-13077", Api::Khr, kNeeds, narrowResults},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-flags-13077", Api::Khr, kNeeds, narrowStride, "Stride"},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-flags-13078", Api::Khr, kNeeds, wideResults},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13079", Api::Khr, kNeeds, fewResults},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-pDstRange-13079", Api::Khr, kNeeds, availability, "Availability"},
    {"VUID-vkCmdCopyQueryPoolResultsToMemoryKHR-dstFlags-13085", Api::Khr, kNeeds, protectedResults},

    {"VUID-VkMemoryMarkerInfoAMD-dstRange-13039", Api::Khr, kMarkers, usage<kMarker>},
    {"VUID-VkMemoryMarkerInfoAMD-dstRange-13040", Api::Khr, kMarkers, alignment<kMarker, 2>},
    {"VUID-VkMemoryMarkerInfoAMD-dstRange-13041", Api::Khr, kMarkers, size<kMarker, 4, 3>},
    {"VUID-VkMemoryMarkerInfoAMD-stage-13038", Api::Khr, kMarkers, stagesOfMarker},
    {"VUID-vkCmdWriteMarkerToMemoryAMD-synchronization2-13042", Api::Khr, kMarkers | kNeedsFewFeatures,
     markerWithoutSynchronization2},
    {"VUID-vkCmdWriteMarkerToMemoryAMD-commandBuffer-13044", Api::Khr, kMarkers, protectedFlag<kMarker>},
    {"VUID-vkCmdWriteMarkerToMemoryAMD-commandBuffer-13045", Api::Khr, kMarkers, protectedCommands<kMarker>},
    {"VUID-vkCmdWriteMarkerToMemoryAMD-pInfo-13046", Api::Khr, kMarkers,
     [](Gpu &gpu, bool wrong) {
         const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
         recordOnly(gpu, [&](VkCommandBuffer commands) {
             kMarker.record(gpu, commands, {buffer.address(), 4}, wrong ? kProtectedRange : kUnknownUsage);
         });
     },
     "", "VUID-vkCmdWriteMarkerToMemoryAMD-commandBuffer-13044 VUID-VkMemoryMarkerInfoAMD-dstRange-13099"},
    {"VUID-vkCmdWriteMarkerToMemoryAMD-pInfo-13047", Api::Khr, kMarkers,
     [](Gpu &gpu, bool wrong) {
         const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_TRANSFER_DST_BIT, wrong ? kProtectedBuffer : 0);
         recordOnly(gpu, [&](VkCommandBuffer commands) {
             kMarker.record(gpu, commands, {buffer.address(), 4}, kUnknownUsage);
         });
     },
     "", "VUID-VkMemoryMarkerInfoAMD-dstRange-13098"},

    {"VUID-vkCmdCopyMemoryToImageKHR-addressRange-13128", Api::Khr, kNeeds, usage<kImageSource>},
    {"VUID-vkCmdCopyImageToMemoryKHR-addressRange-13129", Api::Khr, kNeeds, usage<kImageCopy>},
    {"VUID-vkCmdCopyMemoryToImageKHR-commandBuffer-13102", Api::Khr, kNeeds, protectedFlag<kImageSource>},
    {"VUID-vkCmdCopyImageToMemoryKHR-commandBuffer-13102", Api::Khr, kNeeds, protectedFlag<kImageCopy>},
    {"VUID-vkCmdCopyImageToMemoryKHR-commandBuffer-13025", Api::Khr, kNeeds, protectedCommands<kImageCopy>},
    {"VUID-vkCmdCopyMemoryToImageKHR-commandBuffer-13021", Api::Khr, kNeeds, protectedCommands<kImageSource>},
    {"VUID-VkCopyDeviceMemoryImageInfoKHR-image-13029", Api::Khr, kNeeds, alignment<kImageCopy, 2>},
    {"VUID-VkDeviceMemoryImageCopyKHR-size-13037", Api::Khr, kNeeds, size<kImageCopy, 64, 63>},
    {"VUID-VkDeviceMemoryImageCopyKHR-size-13037", Api::Khr, kNeeds, size<kImageSource, 64, 60>, "ToImage"},
};

} // namespace

std::span<const WrongProgram> rangePrograms()
{
    return kPrograms;
}

} // namespace vt
