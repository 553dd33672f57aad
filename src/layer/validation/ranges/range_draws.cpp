// SPDX-License-Identifier: Apache-2.0
// Index and vertex buffers, indirect draws and dispatches, conditional rendering, transform feedback.
#include <algorithm>

#include "layer/input/builds.h"
#include "layer/validation/ranges/ranges.h"

namespace vellum::layer::ranges
{
namespace
{

void checkVertexBuffer(const RangeCheck &ranges, const Place &info, const VkBindVertexBuffer3InfoKHR &buffer)
{
    const DeviceFacts &facts = ranges.device().facts;
    const VkStridedDeviceAddressRangeKHR &range = buffer.addressRange;
    const Place member = info.member("addressRange");
    if (buffer.setStride && range.stride > facts.maxVertexInputBindingStride)
        ranges.fault(member, "VUID-VkBindVertexBuffer3InfoKHR-setStride-13126",
                     "stride " + std::to_string(range.stride) + "; maxVertexInputBindingStride is " +
                         std::to_string(facts.maxVertexInputBindingStride));
    if (!buffer.setStride && range.stride != 0)
        ranges.fault(member, "VUID-VkBindVertexBuffer3InfoKHR-setStride-13127",
                     "stride " + std::to_string(range.stride) + "; without setStride it must be 0");
    if (range.size == 0 && range.address != 0)
        return ranges.fault(member, rules::kVertexBuffer.leastId,
                            "address " + textOf({range.address, 0}) + "; of size 0, the address must be 0");
    if (range.size == 0 && !facts.nullDescriptor)
        ranges.fault(member, "VUID-VkBindVertexBuffer3InfoKHR-size-13072",
                     "size 0, without the feature nullDescriptor");
    ranges.check(info, range, buffer.addressFlags, flagged::kVertexBuffer, rules::kVertexBuffer);
}

// The commands in the range of an indirect draw, `most` draws.
struct DrawRange {
    const VkStridedDeviceAddressRangeKHR &range;
    uint32_t most;
    const char *protectedBufferRule;
};

void checkRange(const RangeCheck &ranges, const Place &info, const rules::IndirectDraws &draws, const DrawRange &given)
{
    const auto &[range, count, protectedBufferRule] = given;
    const Place member = info.member("addressRange");
    const std::string stride = "stride " + std::to_string(range.stride);
    const VkDeviceSize rest = range.size - std::min(range.size, draws.bytes);
    const VkDeviceSize least = (std::max(count, 1u) - 1) * range.stride + draws.bytes;
    const Severity severity = rules::ofStride(count);
    if (draws.isValidated && count > 0 &&
        (range.size < draws.bytes || (range.stride != 0 && rest / range.stride < count - 1)))
        ranges.fault(member, draws.size,
                     std::to_string(range.size) + " bytes, " + stride + "; the command reads " +
                         std::to_string(draws.bytes) + " bytes for each of " + std::to_string(count) + " draws",
                     rules::ofSmallRange(ranges.device().buffers.addresses, {range.address, range.size}, least));
    if (draws.isValidated && count > 1 && range.stride == 0)
        ranges.fault(member, draws.noStride, stride + ", for " + std::to_string(count) + " draws");
    if (draws.isValidated && range.stride != 0 && range.stride < draws.bytes)
        ranges.fault(member, draws.smallStride,
                     stride + "; the commands of a draw have " + std::to_string(draws.bytes) + " bytes", severity);
    if (draws.isValidated && range.stride % 4 != 0)
        ranges.fault(member, draws.unalignedStride, stride + " is not a multiple of 4", severity);
    ranges.checkUnprotected(member, range.address, protectedBufferRule);
}

void checkCommandBuffer(const RangeCheck &ranges, const char *rule)
{
    if (ranges.isProtected())
        ranges.fault(ranges.command().member("commandBuffer"), rule, "a protected command buffer");
}

// `rule`: the command buffer is not protected.
void checkDraws(const RangeCheck &ranges, const VkDrawIndirect2InfoKHR &info, const rules::IndirectDraws &draws,
                const char *rule)
{
    const Place place = ranges.command().member("pInfo");
    checkCommandBuffer(ranges, rule);
    checkRange(ranges, place, draws,
               {info.addressRange, info.drawCount, "VUID-VkDrawIndirect2InfoKHR-protectedNoFault-13108"});
    ranges.check(place, info.addressRange, info.addressFlags, flagged::kDraw, rules::kDraws);
}

// `featureRule`: drawIndirectCount is enabled.
void checkDraws(const RangeCheck &ranges, const VkDrawIndirectCount2InfoKHR &info, const rules::IndirectDraws &draws,
                const char *rule, const char *featureRule)
{
    const Place place = ranges.command().member("pInfo");
    if (!ranges.device().facts.drawIndirectCount)
        ranges.fault(ranges.command(), featureRule, "the feature drawIndirectCount is not enabled");
    checkCommandBuffer(ranges, rule);
    checkRange(ranges, place, draws,
               {info.addressRange, info.maxDrawCount, "VUID-VkDrawIndirectCount2InfoKHR-protectedNoFault-13108"});
    ranges.check(place, info.addressRange, info.addressFlags, flagged::kCountedDraw, rules::kCountedDraws);
    ranges.check(place, info.countAddressRange, info.countAddressFlags, flagged::kDrawCount, rules::kDrawCount);
}

// A range of size 0 is no counter.
void checkCounters(const RangeCheck &ranges, uint32_t count, const VkBindTransformFeedbackBuffer2InfoEXT *infos,
                   const rules::Range &counter)
{
    for (uint32_t i = 0; infos && i < count; ++i) {
        const Place info = ranges.command().element("pCounterInfos", i);
        rules::Range need = counter;
        if (infos[i].addressRange.size == 0)
            need.least = 0;
        ranges.check(info, infos[i].addressRange, infos[i].addressFlags, flagged::kFeedbackBuffer, need);
    }
}

} // namespace

void cmdBindIndexBuffer3(const RangeCheck &ranges, const VkBindIndexBuffer3InfoKHR *buffer)
{
    const DeviceFacts &facts = ranges.device().facts;
    const Place info = ranges.command().member("pInfo");
    const VkDeviceAddressRangeKHR &range = buffer->addressRange;
    if (buffer->indexType == VK_INDEX_TYPE_NONE_KHR)
        ranges.fault(info.member("indexType"), "VUID-VkBindIndexBuffer3InfoKHR-indexType-13053",
                     "VK_INDEX_TYPE_NONE_KHR");
    if (buffer->indexType == VK_INDEX_TYPE_UINT8_EXT && !facts.indexTypeUint8)
        ranges.fault(info.member("indexType"), "VUID-VkBindIndexBuffer3InfoKHR-indexType-13054",
                     "VK_INDEX_TYPE_UINT8, without the feature indexTypeUint8");
    if (range.size == 0 && range.address != 0)
        return ranges.fault(info.member("addressRange"), rules::kIndexBuffer.leastId,
                            "address " + textOf(range) + "; of size 0, the address must be 0");
    if (range.size == 0 && !facts.nullDescriptor)
        ranges.fault(info.member("addressRange"), "VUID-VkBindIndexBuffer3InfoKHR-None-13055",
                     "size 0, without the feature nullDescriptor");
    rules::Range need = rules::kIndexBuffer;
    need.alignment = std::max(input::indexBytes(buffer->indexType), 1u);
    ranges.check(info, range, buffer->addressFlags, flagged::kIndexBuffer, need);
}

void cmdBindVertexBuffers3(const RangeCheck &ranges, uint32_t first, uint32_t count,
                           const VkBindVertexBuffer3InfoKHR *buffers)
{
    const Place &command = ranges.command();
    const uint32_t most = ranges.device().facts.maxVertexInputBindings;
    const std::string limit = "maxVertexInputBindings is " + std::to_string(most);
    if (first >= most)
        ranges.fault(command.member("firstBinding"), "VUID-vkCmdBindVertexBuffers3KHR-firstBinding-13070",
                     std::to_string(first) + "; " + limit);
    else if (count > most - first)
        ranges.fault(command.member("bindingCount"), "VUID-vkCmdBindVertexBuffers3KHR-firstBinding-13071",
                     std::to_string(count) + " bindings from " + std::to_string(first) + "; " + limit);
    for (uint32_t i = 0; i < count; ++i)
        checkVertexBuffer(ranges, command.element("pBindingInfos", i), buffers[i]);
}

void cmdDrawIndirect2(const RangeCheck &ranges, const VkDrawIndirect2InfoKHR *info)
{
    checkDraws(ranges, *info, rules::kDrawIndirect, "VUID-vkCmdDrawIndirect2KHR-commandBuffer-13057");
}

void cmdDrawIndexedIndirect2(const RangeCheck &ranges, const VkDrawIndirect2InfoKHR *info)
{
    checkDraws(ranges, *info, rules::kDrawIndexedIndirect, "VUID-vkCmdDrawIndexedIndirect2KHR-commandBuffer-13059");
}

void cmdDrawMeshTasksIndirect2(const RangeCheck &ranges, const VkDrawIndirect2InfoKHR *info)
{
    checkDraws(ranges, *info, rules::kDrawMeshTasks, "VUID-vkCmdDrawMeshTasksIndirect2EXT-commandBuffer-13067");
}

void cmdDrawIndirectCount2(const RangeCheck &ranges, const VkDrawIndirectCount2InfoKHR *info)
{
    checkDraws(ranges, *info, rules::kDrawIndirectCount, "VUID-vkCmdDrawIndirectCount2KHR-commandBuffer-13058",
               rules::kDrawCountFeatureId);
}

void cmdDrawIndexedIndirectCount2(const RangeCheck &ranges, const VkDrawIndirectCount2InfoKHR *info)
{
    checkDraws(ranges, *info, rules::kDrawIndexedIndirectCount,
               "VUID-vkCmdDrawIndexedIndirectCount2KHR-commandBuffer-13060",
               "VUID-vkCmdDrawIndexedIndirectCount2KHR-drawIndirectCount-13120");
}

void cmdDrawMeshTasksIndirectCount2(const RangeCheck &ranges, const VkDrawIndirectCount2InfoKHR *info)
{
    checkDraws(ranges, *info, rules::kDrawMeshTasksCount,
               "VUID-vkCmdDrawMeshTasksIndirectCount2EXT-commandBuffer-13068",
               "VUID-vkCmdDrawMeshTasksIndirectCount2EXT-drawIndirectCount-13069");
}

void cmdDispatchIndirect2(const RangeCheck &ranges, const VkDispatchIndirect2InfoKHR *info)
{
    const Place place = ranges.command().member("pInfo");
    checkCommandBuffer(ranges, "VUID-vkCmdDispatchIndirect2KHR-commandBuffer-13049");
    ranges.checkUnprotected(place.member("addressRange"), info->addressRange.address,
                            "VUID-VkDispatchIndirect2InfoKHR-protectedNoFault-13108");
    ranges.check(place, info->addressRange, info->addressFlags, flagged::kDispatch, rules::kDispatch);
}

void cmdBeginConditionalRendering2(const RangeCheck &ranges, const VkConditionalRenderingBeginInfo2EXT *info)
{
    const CommandState *state = ranges.device().logs.get(ranges.commandBuffer());
    if (state && state->conditionalRendering)
        ranges.fault(ranges.command(), "VUID-vkCmdBeginConditionalRendering2EXT-None-13063",
                     "conditional rendering is active already");
    ranges.check(ranges.command().member("pConditionalRenderingBegin"), info->addressRange, info->addressFlags,
                 flagged::kCondition, rules::kCondition);
}

void cmdBindTransformFeedbackBuffers2(const RangeCheck &ranges, uint32_t, uint32_t count,
                                      const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    const VkDeviceSize most = ranges.device().facts.maxTransformFeedbackBufferSize;
    for (uint32_t i = 0; i < count; ++i) {
        const Place info = ranges.command().element("pBindingInfos", i);
        if (infos[i].addressRange.size > most)
            ranges.fault(info.member("addressRange"), "VUID-vkCmdBindTransformFeedbackBuffers2EXT-addressRange-13092",
                         std::to_string(infos[i].addressRange.size) + " bytes; maxTransformFeedbackBufferSize is " +
                             std::to_string(most));
        ranges.check(info, infos[i].addressRange, infos[i].addressFlags, flagged::kFeedbackBuffer,
                     rules::kFeedbackBuffer);
    }
}

void cmdBeginTransformFeedback2(const RangeCheck &ranges, uint32_t, uint32_t count,
                                const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    checkCounters(ranges, count, infos, rules::kBeginCounter);
}

void cmdEndTransformFeedback2(const RangeCheck &ranges, uint32_t, uint32_t count,
                              const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    checkCounters(ranges, count, infos, rules::kEndCounter);
}

void cmdDrawIndirectByteCount2(const RangeCheck &ranges, uint32_t, uint32_t,
                               const VkBindTransformFeedbackBuffer2InfoEXT *info, uint32_t, uint32_t)
{
    ranges.check(ranges.command().member("pCounterInfo"), info->addressRange, info->addressFlags,
                 flagged::kFeedbackBuffer, rules::kByteCount);
}

} // namespace vellum::layer::ranges
