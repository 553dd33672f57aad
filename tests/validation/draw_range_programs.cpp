// SPDX-License-Identifier: Apache-2.0
// Wrong address ranges of index and vertex buffers, indirect draws and dispatches, conditional rendering and transform
// feedback.
#include "range_commands.h"

namespace vt
{
namespace
{

constexpr VkBufferUsageFlags kIndirect = VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;

// An address with size 0, or none.
template <const RangeCommand &command>
void emptyRange(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, command.usage);
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        command.record(gpu, commands, {wrong ? buffer.address() : 0, 0}, kUnknownUsage);
    });
}

// A null range, on a device without nullDescriptor.
template <const RangeCommand &command>
void nullRange(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, command.usage);
    const VkDeviceAddressRangeKHR right{buffer.address(), command.size};
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        command.record(gpu, commands, wrong ? VkDeviceAddressRangeKHR{} : right, kUnknownUsage);
    });
}

// A draw by count, on a device without drawIndirectCount; or without the count.
template <const RangeCommand &counted, const RangeCommand &plain>
void withoutCounts(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, kIndirect);
    const RangeCommand &command = wrong ? counted : plain;
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        command.record(gpu, commands, {buffer.address(), command.size}, kUnknownUsage);
    });
}

// --- index and vertex buffers ---

void bindIndices(Gpu &gpu, VkIndexType type)
{
    const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_INDEX_BUFFER_BIT);
    const auto info = vkInit<VkBindIndexBuffer3InfoKHR>(
        {.addressRange = {buffer.address(), 64}, .addressFlags = kUnknownUsage, .indexType = type});
    recordOnly(gpu, [&](VkCommandBuffer commands) { gpu.vk().CmdBindIndexBuffer3KHR(commands, &info); });
}

void noIndexType(Gpu &gpu, bool wrong)
{
    bindIndices(gpu, wrong ? VK_INDEX_TYPE_NONE_KHR : VK_INDEX_TYPE_UINT16);
}

void indicesOfEightBits(Gpu &gpu, bool wrong)
{
    bindIndices(gpu, wrong ? VK_INDEX_TYPE_UINT8_EXT : VK_INDEX_TYPE_UINT16);
}

void bindVertices(Gpu &gpu, uint32_t first, uint32_t count, VkDeviceSize bytes, VkDeviceSize stride, bool setStride)
{
    const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    const std::vector infos(count,
                            vkInit<VkBindVertexBuffer3InfoKHR>({.setStride = VkBool32{setStride},
                                                                .addressRange = {buffer.address(), bytes, stride},
                                                                .addressFlags = kUnknownUsage}));
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBindVertexBuffers3KHR(commands, first, count, infos.data());
    });
}

uint32_t maxBindings(const Gpu &gpu)
{
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(gpu.physical(), &properties);
    return properties.limits.maxVertexInputBindings;
}

void firstBinding(Gpu &gpu, bool wrong)
{
    if (wrong) // nothing is bound
        bindVertices(gpu, maxBindings(gpu), 0, 64, 0, true);
}

void lastBinding(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    const uint32_t first = maxBindings(gpu) - 1;
    const uint32_t count = wrong ? 2 : 1;
    // The wrong one's ranges are rejected, too, so that no driver gets so many bindings.
    const std::vector infos(count,
                            vkInit<VkBindVertexBuffer3InfoKHR>({.setStride = VK_TRUE,
                                                                .addressRange = {wrong ? 0 : buffer.address(), 64, 0},
                                                                .addressFlags = kUnknownUsage}));
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBindVertexBuffers3KHR(commands, first, count, infos.data());
    });
}

void longStride(Gpu &gpu, bool wrong)
{
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(gpu.physical(), &properties);
    const uint32_t most = properties.limits.maxVertexInputBindingStride;
    bindVertices(gpu, 0, 1, 4 * VkDeviceSize{most}, wrong ? most + 4 : most, true);
}

void strideThatIsNotSet(Gpu &gpu, bool wrong)
{
    bindVertices(gpu, 0, 1, 64, wrong ? 16 : 0, false);
}

void strideBeyondTheSize(Gpu &gpu, bool wrong)
{
    bindVertices(gpu, 0, 1, 64, wrong ? 68 : 64, true);
}

// --- indirect draws ---

struct Strides {
    VkDeviceSize bytes = 256, stride = 20;
    uint32_t draws = 4;
};

using Draw = void (*)(Gpu &, VkCommandBuffer, const VkStridedDeviceAddressRangeKHR &, uint32_t draws);

template <auto member>
void drawOne(Gpu &gpu, VkCommandBuffer commands, const VkStridedDeviceAddressRangeKHR &range, uint32_t draws)
{
    const auto info =
        vkInit<VkDrawIndirect2InfoKHR>({.addressRange = range, .addressFlags = kUnknownUsage, .drawCount = draws});
    (gpu.vk().*member)(commands, &info);
}

template <auto member>
void drawCounted(Gpu &gpu, VkCommandBuffer commands, const VkStridedDeviceAddressRangeKHR &range, uint32_t draws)
{
    const auto info = vkInit<VkDrawIndirectCount2InfoKHR>({.addressRange = range,
                                                           .addressFlags = kUnknownUsage,
                                                           .countAddressRange = {range.address, 4},
                                                           .countAddressFlags = kUnknownUsage,
                                                           .maxDrawCount = draws});
    (gpu.vk().*member)(commands, &info);
}

void drawRange(Gpu &gpu, Draw draw, const Strides &strides)
{
    const RangeBuffer buffer(gpu, kIndirect);
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        draw(gpu, commands, {buffer.address(), strides.bytes, strides.stride}, strides.draws);
    });
}

// 3 * 20 bytes, and one command of 16 or 20.
template <Draw draw, VkDeviceSize bytes>
void tooSmall(Gpu &gpu, bool wrong)
{
    drawRange(gpu, draw, {.bytes = 60 + bytes - (wrong ? 1 : 0)});
}

template <Draw draw>
void noStride(Gpu &gpu, bool wrong)
{
    drawRange(gpu, draw, {.stride = 0, .draws = wrong ? 2u : 1u});
}

template <Draw draw, VkDeviceSize bytes>
void smallStride(Gpu &gpu, bool wrong)
{
    drawRange(gpu, draw, {.stride = bytes - (wrong ? 4 : 0)});
}

template <Draw draw>
void unalignedStride(Gpu &gpu, bool wrong)
{
    drawRange(gpu, draw, {.stride = wrong ? 22u : 24u});
}

constexpr Draw kPlain = drawOne<&Commands::CmdDrawIndirect2KHR>;
constexpr Draw kIndexed = drawOne<&Commands::CmdDrawIndexedIndirect2KHR>;
constexpr Draw kCounted = drawCounted<&Commands::CmdDrawIndirectCount2KHR>;
constexpr Draw kIndexedCounted = drawCounted<&Commands::CmdDrawIndexedIndirectCount2KHR>;

void twoConditions(Gpu &gpu, bool wrong)
{
    const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT);
    const auto info = vkInit<VkConditionalRenderingBeginInfo2EXT>(
        {.addressRange = {buffer.address(), 4}, .addressFlags = kUnknownUsage});
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        gpu.vk().CmdBeginConditionalRendering2EXT(commands, &info);
        if (!wrong)
            gpu.vk().CmdEndConditionalRenderingEXT(commands);
        gpu.vk().CmdBeginConditionalRendering2EXT(commands, &info);
        gpu.vk().CmdEndConditionalRenderingEXT(commands);
    });
}

void longFeedbackBuffer(Gpu &gpu, bool wrong)
{
    auto feedback = vkInit<VkPhysicalDeviceTransformFeedbackPropertiesEXT>();
    auto properties = vkInit<VkPhysicalDeviceProperties2>({.pNext = &feedback});
    vkGetPhysicalDeviceProperties2(gpu.physical(), &properties);
    const RangeBuffer buffer(gpu, VK_BUFFER_USAGE_TRANSFORM_FEEDBACK_BUFFER_BIT_EXT);
    const VkDeviceSize bytes = wrong ? feedback.maxTransformFeedbackBufferSize + 4 : 64;
    recordOnly(gpu, [&](VkCommandBuffer commands) {
        kFeedbackBuffer.record(gpu, commands, {buffer.address(), bytes}, kUnknownUsage);
    });
}

// FULLY_BOUND, for sparse buffers with memory or without. Nothing is drawn.
template <auto member>
void notBound(Gpu &gpu, bool wrong)
{
    constexpr VkAddressCommandFlagsKHR kBound = kUnknownUsage | VK_ADDRESS_COMMAND_FULLY_BOUND_BIT_KHR;
    RangeBuffer buffer(gpu, kIndirect, VK_BUFFER_CREATE_SPARSE_BINDING_BIT);
    const RangeBuffer other(gpu, kIndirect);
    if (!wrong)
        buffer.bind();
    gpu.submit([&](VkCommandBuffer commands) { member(gpu, commands, buffer.address(), other.address(), kBound); });
}

void drawNothing(Gpu &gpu, VkCommandBuffer commands, VkDeviceAddress at, VkDeviceAddress,
                 VkAddressCommandFlagsKHR flags)
{
    const auto info = vkInit<VkDrawIndirect2InfoKHR>({.addressRange = {at, 64, 16}, .addressFlags = flags});
    gpu.vk().CmdDrawIndirect2KHR(commands, &info);
}

void drawNothingCounted(Gpu &gpu, VkCommandBuffer commands, VkDeviceAddress at, VkDeviceAddress other,
                        VkAddressCommandFlagsKHR flags)
{
    const auto info = vkInit<VkDrawIndirectCount2InfoKHR>({.addressRange = {at, 64, 16},
                                                           .addressFlags = flags,
                                                           .countAddressRange = {other, 4},
                                                           .countAddressFlags = kUnknownUsage});
    gpu.vk().CmdDrawIndirectCount2KHR(commands, &info);
}

void countNothing(Gpu &gpu, VkCommandBuffer commands, VkDeviceAddress at, VkDeviceAddress other,
                  VkAddressCommandFlagsKHR flags)
{
    const auto info = vkInit<VkDrawIndirectCount2InfoKHR>({.addressRange = {other, 64, 16},
                                                           .addressFlags = kUnknownUsage,
                                                           .countAddressRange = {at, 4},
                                                           .countAddressFlags = flags});
    gpu.vk().CmdDrawIndirectCount2KHR(commands, &info);
}

constexpr auto kNeeds = kNeedsAddressCommands;
constexpr auto kFew = kNeedsAddressCommands | kNeedsFewFeatures;

constexpr WrongProgram kPrograms[] = {
    {"VUID-VkBindIndexBuffer3InfoKHR-addressRange-13051", Api::Khr, kNeeds, usage<kIndexBuffer>},
    {"VUID-VkBindIndexBuffer3InfoKHR-addressRange-13052", Api::Khr, kNeeds, alignment<kIndexBuffer>},
    {"VUID-VkBindIndexBuffer3InfoKHR-addressRange-13056", Api::Khr, kNeeds, emptyRange<kIndexBuffer>},
    {"VUID-VkBindIndexBuffer3InfoKHR-indexType-13053", Api::Khr, kNeeds, noIndexType},
    {"VUID-VkBindIndexBuffer3InfoKHR-indexType-13054", Api::Khr, kFew, indicesOfEightBits},
    {"VUID-VkBindIndexBuffer3InfoKHR-None-13055", Api::Khr, kFew, nullRange<kIndexBuffer>},

    {"VUID-VkBindVertexBuffer3InfoKHR-addressRange-13074", Api::Khr, kNeeds, usage<kVertexBuffer>},
    {"VUID-VkBindVertexBuffer3InfoKHR-addressRange-13075", Api::Khr, kNeeds, emptyRange<kVertexBuffer>},
    {"VUID-VkBindVertexBuffer3InfoKHR-size-13072", Api::Khr, kFew, nullRange<kVertexBuffer>},
    {"VUID-VkBindVertexBuffer3InfoKHR-setStride-13126", Api::Khr, kNeeds, longStride},
    {"VUID-VkBindVertexBuffer3InfoKHR-setStride-13127", Api::Khr, kNeeds, strideThatIsNotSet},
    {"VUID-VkStridedDeviceAddressRangeKHR-stride-10957", Api::Khr, kNeeds, strideBeyondTheSize},
    {"VUID-vkCmdBindVertexBuffers3KHR-firstBinding-13070", Api::Khr, kNeeds, firstBinding},
    {"VUID-vkCmdBindVertexBuffers3KHR-firstBinding-13071", Api::Khr, kNeeds, lastBinding, "",
     "VUID-VkStridedDeviceAddressRangeKHR-size-11411 VUID-VkStridedDeviceAddressRangeKHR-size-11411"},

    {"VUID-VkDrawIndirect2InfoKHR-addressRange-13107", Api::Khr, kNeeds, usage<kDraw>},
    {"VUID-VkDrawIndirect2InfoKHR-addressRange-13107", Api::Khr, kNeeds, usage<kMeshDraw>, "Mesh"},
    {"VUID-VkDrawIndirect2InfoKHR-addressRange-13109", Api::Khr, kNeeds, alignment<kDraw>},
    {"VUID-VkDrawIndirect2InfoKHR-protectedNoFault-13108", Api::Khr, kNeeds, protectedFlag<kDraw>, "",
     "VUID-VkDrawIndirect2InfoKHR-addressRange-13107"},
    {"VUID-VkDrawIndirectCount2InfoKHR-addressRange-13107", Api::Khr, kNeeds, usage<kCountedDraw>},
    {"VUID-VkDrawIndirectCount2InfoKHR-addressRange-13109", Api::Khr, kNeeds, alignment<kCountedDraw>},
    {"VUID-VkDrawIndirectCount2InfoKHR-protectedNoFault-13108", Api::Khr, kNeeds, protectedFlag<kCountedDraw>, "",
     "VUID-VkDrawIndirectCount2InfoKHR-addressRange-13107"},
    {"VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13114", Api::Khr, kNeeds, usage<kDrawCount>},
    {"VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13115", Api::Khr, kNeeds, alignment<kDrawCount>},
    {"VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13117", Api::Khr, kNeeds, size<kDrawCount, 4, 3>},

    {"VUID-vkCmdDrawIndirect2KHR-commandBuffer-13057", Api::Khr, kNeeds, protectedCommands<kDraw>},
    {"VUID-vkCmdDrawIndirect2KHR-pInfo-13110", Api::Khr, kNeeds, tooSmall<kPlain, 16>},
    {"VUID-vkCmdDrawIndirect2KHR-pInfo-13111", Api::Khr, kNeeds, noStride<kPlain>},
    {"VUID-vkCmdDrawIndirect2KHR-pInfo-13112", Api::Khr, kNeeds, smallStride<kPlain, 16>},
    {"VUID-vkCmdDrawIndirect2KHR-pInfo-13113", Api::Khr, kNeeds, unalignedStride<kPlain>},
    {"VUID-vkCmdDrawIndexedIndirect2KHR-commandBuffer-13059", Api::Khr, kNeeds, protectedCommands<kIndexedDraw>},
    {"VUID-vkCmdDrawIndexedIndirect2KHR-pInfo-13110", Api::Khr, kNeeds, tooSmall<kIndexed, 20>},
    {"VUID-vkCmdDrawIndexedIndirect2KHR-pInfo-13111", Api::Khr, kNeeds, noStride<kIndexed>},
    {"VUID-vkCmdDrawIndexedIndirect2KHR-pInfo-13112", Api::Khr, kNeeds, smallStride<kIndexed, 20>},
    {"VUID-vkCmdDrawIndexedIndirect2KHR-pInfo-13113", Api::Khr, kNeeds, unalignedStride<kIndexed>},
    {"VUID-vkCmdDrawIndirectCount2KHR-commandBuffer-13058", Api::Khr, kNeeds, protectedCommands<kCountedDraw>},
    {"VUID-vkCmdDrawIndirectCount2KHR-pInfo-13110", Api::Khr, kNeeds, tooSmall<kCounted, 16>},
    {"VUID-vkCmdDrawIndirectCount2KHR-pInfo-13111", Api::Khr, kNeeds, noStride<kCounted>},
    {"VUID-vkCmdDrawIndirectCount2KHR-pInfo-13112", Api::Khr, kNeeds, smallStride<kCounted, 16>},
    {"VUID-vkCmdDrawIndirectCount2KHR-pInfo-13113", Api::Khr, kNeeds, unalignedStride<kCounted>},
    {"VUID-vkCmdDrawIndirectCount2KHR-drawIndirectCount-13119", Api::Khr, kFew, withoutCounts<kCountedDraw, kDraw>},
    {"VUID-vkCmdDrawIndexedIndirectCount2KHR-commandBuffer-13060", Api::Khr, kNeeds,
     protectedCommands<kIndexedCountedDraw>},
    {"VUID-vkCmdDrawIndexedIndirectCount2KHR-pInfo-13110", Api::Khr, kNeeds, tooSmall<kIndexedCounted, 20>},
    {"VUID-vkCmdDrawIndexedIndirectCount2KHR-pInfo-13111", Api::Khr, kNeeds, noStride<kIndexedCounted>},
    {"VUID-vkCmdDrawIndexedIndirectCount2KHR-pInfo-13112", Api::Khr, kNeeds, smallStride<kIndexedCounted, 20>},
    {"VUID-vkCmdDrawIndexedIndirectCount2KHR-pInfo-13113", Api::Khr, kNeeds, unalignedStride<kIndexedCounted>},
    {"VUID-vkCmdDrawIndexedIndirectCount2KHR-drawIndirectCount-13120", Api::Khr, kFew,
     withoutCounts<kIndexedCountedDraw, kIndexedDraw>},
    {"VUID-vkCmdDrawMeshTasksIndirect2EXT-commandBuffer-13067", Api::Khr, kNeeds, protectedCommands<kMeshDraw>},
    {"VUID-vkCmdDrawMeshTasksIndirectCount2EXT-commandBuffer-13068", Api::Khr, kNeeds,
     protectedCommands<kMeshCountedDraw>},
    {"VUID-vkCmdDrawMeshTasksIndirectCount2EXT-drawIndirectCount-13069", Api::Khr, kFew,
     withoutCounts<kMeshCountedDraw, kMeshDraw>},

    {"VUID-VkDispatchIndirect2InfoKHR-addressRange-13107", Api::Khr, kNeeds, usage<kDispatch>},
    {"VUID-VkDispatchIndirect2InfoKHR-addressRange-13109", Api::Khr, kNeeds, alignment<kDispatch>},
    {"VUID-VkDispatchIndirect2InfoKHR-protectedNoFault-13108", Api::Khr, kNeeds, protectedFlag<kDispatch>, "",
     "VUID-VkDispatchIndirect2InfoKHR-addressRange-13107"},
    {"VUID-vkCmdDispatchIndirect2KHR-commandBuffer-13049", Api::Khr, kNeeds, protectedCommands<kDispatch>},
    {"VUID-vkCmdDispatchIndirect2KHR-pInfo-13050", Api::Khr, kNeeds, size<kDispatch, 12, 8>},

    {"VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13064", Api::Khr, kNeeds, usage<kCondition>},
    {"VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13065", Api::Khr, kNeeds, alignment<kCondition>},
    {"VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13066", Api::Khr, kNeeds, size<kCondition, 4, 2>},
    {"VUID-vkCmdBeginConditionalRendering2EXT-None-13063", Api::Khr, kNeeds, twoConditions},

    {"VUID-vkCmdBindTransformFeedbackBuffers2EXT-addressRange-13090", Api::Khr, kNeeds, alignment<kFeedbackBuffer>},
    {"VUID-vkCmdBindTransformFeedbackBuffers2EXT-addressRange-13091", Api::Khr, kNeeds, usage<kFeedbackBuffer>},
    {"VUID-vkCmdBindTransformFeedbackBuffers2EXT-addressRange-13092", Api::Khr, kNeeds, longFeedbackBuffer, "",
     "VUID-VkDeviceAddressRangeKHR-address-11365"},
    {"VUID-VkDrawIndirect2InfoKHR-addressRange-13097", Api::Khr, kNeeds, notBound<drawNothing>},
    {"VUID-VkDrawIndirectCount2InfoKHR-addressRange-13097", Api::Khr, kNeeds, notBound<drawNothingCounted>},
    {"VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13097", Api::Khr, kNeeds, notBound<countNothing>},
    {"VUID-vkCmdBeginTransformFeedback2EXT-pCounterInfos-13093", Api::Khr, kNeeds, size<kFeedbackCounter, 4, 3>},
    {"VUID-vkCmdBeginTransformFeedback2EXT-pCounterInfos-13094", Api::Khr, kNeeds, usage<kFeedbackCounter>},
    {"VUID-vkCmdEndTransformFeedback2EXT-pCounterInfos-13095", Api::Khr, kNeeds, size<kFeedbackEnd, 4, 3>},
    {"VUID-vkCmdEndTransformFeedback2EXT-pCounterInfos-13096", Api::Khr, kNeeds, usage<kFeedbackEnd>},
    {"VUID-vkCmdDrawIndirectByteCount2EXT-pInfo-13061", Api::Khr, kNeeds, usage<kByteCount>},
    {"VUID-vkCmdDrawIndirectByteCount2EXT-pInfo-13062", Api::Khr, kNeeds, alignment<kByteCount>},
};

} // namespace

std::span<const WrongProgram> drawRangePrograms()
{
    return kPrograms;
}

} // namespace vt
