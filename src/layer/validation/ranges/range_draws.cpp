// SPDX-License-Identifier: Apache-2.0
// Index and vertex buffers, indirect draws and dispatches, conditional rendering, transform feedback.
#include <algorithm>

#include "layer/validation/ranges/ranges.h"
#include "layer/validation/rules/build_input.h"

namespace vellum::layer::ranges
{
namespace
{

constexpr auto kUint8 = static_cast<VkIndexType>(1000265000); // VK_INDEX_TYPE_UINT8_KHR

void checkVertexBuffer(const DeviceModel &device, const RangeCheck &ranges, const Place &info,
                       const VkBindVertexBuffer3InfoKHR &buffer)
{
    const VkStridedDeviceAddressRangeKHR &range = buffer.addressRange;
    const Place member = info.member("addressRange");
    if (buffer.setStride && range.stride > device.facts.maxVertexInputBindingStride)
        ranges.fault(member, "VUID-VkBindVertexBuffer3InfoKHR-setStride-13126",
                     "stride " + std::to_string(range.stride) + "; maxVertexInputBindingStride is " +
                         std::to_string(device.facts.maxVertexInputBindingStride));
    if (!buffer.setStride && range.stride != 0)
        ranges.fault(member, "VUID-VkBindVertexBuffer3InfoKHR-setStride-13127",
                     "stride " + std::to_string(range.stride) + "; without setStride it must be 0");
    if (range.size == 0 && range.address != 0)
        return ranges.fault(member, "VUID-VkBindVertexBuffer3InfoKHR-addressRange-13075",
                            "address " + textOf({range.address, 0}) + "; of size 0, the address must be 0");
    if (range.size == 0 && !device.facts.nullDescriptor)
        ranges.fault(member, "VUID-VkBindVertexBuffer3InfoKHR-size-13072",
                     "size 0, without the feature nullDescriptor");
    ranges.check(info, range, buffer.addressFlags, flag_rules::kVertexBuffer,
                 {.usage = VK_BUFFER_USAGE_VERTEX_BUFFER_BIT,
                  .usageRule = "VUID-VkBindVertexBuffer3InfoKHR-addressRange-13074"});
}

// A kind of indirect draw. Mesh tasks have no rules about strides and sizes.
struct Draw {
    const char *command;
    VkDeviceSize bytes; // of the commands that the device reads for each draw
    const char *protectedRule;
    const char *sizeRule = nullptr;
    const char *noStrideRule = nullptr;
    const char *smallStrideRule = nullptr;
    const char *unalignedStrideRule = nullptr;
    const char *featureRule = nullptr; // drawIndirectCount
};

// By DrawKind.
constexpr Draw kDraws[] = {
    {.command = "vkCmdDrawIndirect2KHR",
     .bytes = sizeof(VkDrawIndirectCommand),
     .protectedRule = "VUID-vkCmdDrawIndirect2KHR-commandBuffer-13057",
     .sizeRule = "VUID-vkCmdDrawIndirect2KHR-pInfo-13110",
     .noStrideRule = "VUID-vkCmdDrawIndirect2KHR-pInfo-13111",
     .smallStrideRule = "VUID-vkCmdDrawIndirect2KHR-pInfo-13112",
     .unalignedStrideRule = "VUID-vkCmdDrawIndirect2KHR-pInfo-13113"},
    {.command = "vkCmdDrawIndexedIndirect2KHR",
     .bytes = sizeof(VkDrawIndexedIndirectCommand),
     .protectedRule = "VUID-vkCmdDrawIndexedIndirect2KHR-commandBuffer-13059",
     .sizeRule = "VUID-vkCmdDrawIndexedIndirect2KHR-pInfo-13110",
     .noStrideRule = "VUID-vkCmdDrawIndexedIndirect2KHR-pInfo-13111",
     .smallStrideRule = "VUID-vkCmdDrawIndexedIndirect2KHR-pInfo-13112",
     .unalignedStrideRule = "VUID-vkCmdDrawIndexedIndirect2KHR-pInfo-13113"},
    {.command = "vkCmdDrawMeshTasksIndirect2EXT",
     .bytes = sizeof(VkDrawMeshTasksIndirectCommandEXT),
     .protectedRule = "VUID-vkCmdDrawMeshTasksIndirect2EXT-commandBuffer-13067"},
};
constexpr Draw kCountedDraws[] = {
    {.command = "vkCmdDrawIndirectCount2KHR",
     .bytes = sizeof(VkDrawIndirectCommand),
     .protectedRule = "VUID-vkCmdDrawIndirectCount2KHR-commandBuffer-13058",
     .sizeRule = "VUID-vkCmdDrawIndirectCount2KHR-pInfo-13110",
     .noStrideRule = "VUID-vkCmdDrawIndirectCount2KHR-pInfo-13111",
     .smallStrideRule = "VUID-vkCmdDrawIndirectCount2KHR-pInfo-13112",
     .unalignedStrideRule = "VUID-vkCmdDrawIndirectCount2KHR-pInfo-13113",
     .featureRule = "VUID-vkCmdDrawIndirectCount2KHR-drawIndirectCount-13119"},
    {.command = "vkCmdDrawIndexedIndirectCount2KHR",
     .bytes = sizeof(VkDrawIndexedIndirectCommand),
     .protectedRule = "VUID-vkCmdDrawIndexedIndirectCount2KHR-commandBuffer-13060",
     .sizeRule = "VUID-vkCmdDrawIndexedIndirectCount2KHR-pInfo-13110",
     .noStrideRule = "VUID-vkCmdDrawIndexedIndirectCount2KHR-pInfo-13111",
     .smallStrideRule = "VUID-vkCmdDrawIndexedIndirectCount2KHR-pInfo-13112",
     .unalignedStrideRule = "VUID-vkCmdDrawIndexedIndirectCount2KHR-pInfo-13113",
     .featureRule = "VUID-vkCmdDrawIndexedIndirectCount2KHR-drawIndirectCount-13120"},
    {.command = "vkCmdDrawMeshTasksIndirectCount2EXT",
     .bytes = sizeof(VkDrawMeshTasksIndirectCommandEXT),
     .protectedRule = "VUID-vkCmdDrawMeshTasksIndirectCount2EXT-commandBuffer-13068",
     .featureRule = "VUID-vkCmdDrawMeshTasksIndirectCount2EXT-drawIndirectCount-13069"},
};

void checkUnprotected(const RangeCheck &ranges, const Place &command, const char *rule)
{
    if (ranges.isProtected())
        ranges.fault(command.member("commandBuffer"), rule, "a protected command buffer");
}

// The rules of the range that holds the commands of `count` draws.
void checkDraws(const DeviceModel &device, const RangeCheck &ranges, const Place &info, const Draw &draw,
                const VkStridedDeviceAddressRangeKHR &range, uint32_t count, const char *protectedBufferRule)
{
    const Place member = info.member("addressRange");
    const std::string stride = "stride " + std::to_string(range.stride);
    const VkDeviceSize room = range.size - std::min(range.size, draw.bytes);
    if (draw.sizeRule && count > 0 &&
        (range.size < draw.bytes || (range.stride != 0 && room / range.stride < count - 1)))
        ranges.fault(member, draw.sizeRule,
                     std::to_string(range.size) + " bytes, " + stride + "; the command reads " +
                         std::to_string(draw.bytes) + " bytes for each of " + std::to_string(count) + " draws");
    if (draw.noStrideRule && count > 1 && range.stride == 0)
        ranges.fault(member, draw.noStrideRule, stride + ", for " + std::to_string(count) + " draws");
    if (draw.smallStrideRule && range.stride != 0 && range.stride < draw.bytes)
        ranges.fault(member, draw.smallStrideRule,
                     stride + "; the commands of a draw have " + std::to_string(draw.bytes) + " bytes");
    if (draw.unalignedStrideRule && range.stride % 4 != 0)
        ranges.fault(member, draw.unalignedStrideRule, stride + " is not a multiple of 4");
    const auto buffer = bufferAt(device, range.address);
    if (buffer && (buffer->flags & VK_BUFFER_CREATE_PROTECTED_BIT) != 0 && !device.facts.protectedNoFault)
        ranges.fault(member, protectedBufferRule, "buffer " + device.nameOf(buffer->handle) + " is protected");
}

// A range of size 0 is no counter.
void checkCounters(DeviceModel &device, VkCommandBuffer commandBuffer, const char *name, uint32_t count,
                   const VkBindTransformFeedbackBuffer2InfoEXT *infos, const char *sizeRule, const char *usageRule)
{
    const RangeCheck ranges(device, commandBuffer);
    const Place command(name);
    for (uint32_t i = 0; infos && i < count; ++i) {
        const Place info = command.element("pCounterInfos", i);
        const bool isNull = infos[i].addressRange.size == 0;
        ranges.check(info, infos[i].addressRange, infos[i].addressFlags, flag_rules::kFeedbackBuffer,
                     {.usage = VK_BUFFER_USAGE_TRANSFORM_FEEDBACK_COUNTER_BUFFER_BIT_EXT,
                      .usageRule = usageRule,
                      .least = isNull ? 0 : sizeof(uint32_t),
                      .leastRule = sizeRule});
    }
}

} // namespace

void checkIndexBuffer(DeviceModel &device, VkCommandBuffer commandBuffer, const VkBindIndexBuffer3InfoKHR &buffer)
{
    const RangeCheck ranges(device, commandBuffer);
    const Place command("vkCmdBindIndexBuffer3KHR");
    const Place info = command.member("pInfo");
    const VkDeviceAddressRangeKHR &range = buffer.addressRange;
    if (buffer.indexType == VK_INDEX_TYPE_NONE_KHR)
        ranges.fault(info.member("indexType"), "VUID-VkBindIndexBuffer3InfoKHR-indexType-13053",
                     "VK_INDEX_TYPE_NONE_KHR");
    if (buffer.indexType == kUint8 && !device.facts.indexTypeUint8)
        ranges.fault(info.member("indexType"), "VUID-VkBindIndexBuffer3InfoKHR-indexType-13054",
                     "VK_INDEX_TYPE_UINT8, without the feature indexTypeUint8");
    if (range.size == 0 && range.address != 0)
        return ranges.fault(info.member("addressRange"), "VUID-VkBindIndexBuffer3InfoKHR-addressRange-13056",
                            "address " + textOf(range) + "; of size 0, the address must be 0");
    if (range.size == 0 && !device.facts.nullDescriptor)
        ranges.fault(info.member("addressRange"), "VUID-VkBindIndexBuffer3InfoKHR-None-13055",
                     "size 0, without the feature nullDescriptor");
    ranges.check(info, range, buffer.addressFlags, flag_rules::kIndexBuffer,
                 {.usage = VK_BUFFER_USAGE_INDEX_BUFFER_BIT,
                  .usageRule = "VUID-VkBindIndexBuffer3InfoKHR-addressRange-13051",
                  .alignment = std::max(indexBytes(buffer.indexType), 1u),
                  .alignmentRule = "VUID-VkBindIndexBuffer3InfoKHR-addressRange-13052"});
}

void checkVertexBuffers(DeviceModel &device, VkCommandBuffer commandBuffer, uint32_t first, uint32_t count,
                        const VkBindVertexBuffer3InfoKHR *buffers)
{
    const RangeCheck ranges(device, commandBuffer);
    const Place command("vkCmdBindVertexBuffers3KHR");
    const uint32_t most = device.facts.maxVertexInputBindings;
    const std::string limit = "maxVertexInputBindings is " + std::to_string(most);
    if (first >= most)
        ranges.fault(command.member("firstBinding"), "VUID-vkCmdBindVertexBuffers3KHR-firstBinding-13070",
                     std::to_string(first) + "; " + limit);
    else if (count > most - first)
        ranges.fault(command.member("bindingCount"), "VUID-vkCmdBindVertexBuffers3KHR-firstBinding-13071",
                     std::to_string(count) + " bindings from " + std::to_string(first) + "; " + limit);
    for (uint32_t i = 0; i < count; ++i)
        checkVertexBuffer(device, ranges, command.element("pBindingInfos", i), buffers[i]);
}

void checkDraw(DeviceModel &device, VkCommandBuffer commandBuffer, DrawKind kind, const VkDrawIndirect2InfoKHR &info)
{
    const Draw &draw = kDraws[static_cast<size_t>(kind)];
    const RangeCheck ranges(device, commandBuffer);
    const Place command(draw.command);
    const Place place = command.member("pInfo");
    checkUnprotected(ranges, command, draw.protectedRule);
    checkDraws(device, ranges, place, draw, info.addressRange, info.drawCount,
               "VUID-VkDrawIndirect2InfoKHR-protectedNoFault-13108");
    ranges.check(place, info.addressRange, info.addressFlags, flag_rules::kDraw,
                 {.usage = VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT,
                  .usageRule = "VUID-VkDrawIndirect2InfoKHR-addressRange-13107",
                  .alignment = 4,
                  .alignmentRule = "VUID-VkDrawIndirect2InfoKHR-addressRange-13109"});
}

void checkDraw(DeviceModel &device, VkCommandBuffer commandBuffer, DrawKind kind,
               const VkDrawIndirectCount2InfoKHR &info)
{
    const Draw &draw = kCountedDraws[static_cast<size_t>(kind)];
    const RangeCheck ranges(device, commandBuffer);
    const Place command(draw.command);
    const Place place = command.member("pInfo");
    if (!device.facts.drawIndirectCount)
        ranges.fault(command, draw.featureRule, "the feature drawIndirectCount is not enabled");
    checkUnprotected(ranges, command, draw.protectedRule);
    checkDraws(device, ranges, place, draw, info.addressRange, info.maxDrawCount,
               "VUID-VkDrawIndirectCount2InfoKHR-protectedNoFault-13108");
    ranges.check(place, info.addressRange, info.addressFlags, flag_rules::kCountedDraw,
                 {.usage = VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT,
                  .usageRule = "VUID-VkDrawIndirectCount2InfoKHR-addressRange-13107",
                  .alignment = 4,
                  .alignmentRule = "VUID-VkDrawIndirectCount2InfoKHR-addressRange-13109"});
    ranges.check(place, info.countAddressRange, info.countAddressFlags, flag_rules::kDrawCount,
                 {.usage = VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT,
                  .usageRule = "VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13114",
                  .alignment = 4,
                  .alignmentRule = "VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13115",
                  .least = sizeof(uint32_t),
                  .leastRule = "VUID-VkDrawIndirectCount2InfoKHR-countAddressRange-13117"});
}

void checkDispatch(DeviceModel &device, VkCommandBuffer commandBuffer, const VkDispatchIndirect2InfoKHR &info)
{
    const RangeCheck ranges(device, commandBuffer);
    const Place command("vkCmdDispatchIndirect2KHR");
    const Place place = command.member("pInfo");
    checkUnprotected(ranges, command, "VUID-vkCmdDispatchIndirect2KHR-commandBuffer-13049");
    const auto buffer = bufferAt(device, info.addressRange.address);
    if (buffer && (buffer->flags & VK_BUFFER_CREATE_PROTECTED_BIT) != 0 && !device.facts.protectedNoFault)
        ranges.fault(place.member("addressRange"), "VUID-VkDispatchIndirect2InfoKHR-protectedNoFault-13108",
                     "buffer " + device.nameOf(buffer->handle) + " is protected");
    ranges.check(place, info.addressRange, info.addressFlags, flag_rules::kDispatch,
                 {.usage = VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT,
                  .usageRule = "VUID-VkDispatchIndirect2InfoKHR-addressRange-13107",
                  .alignment = 4,
                  .alignmentRule = "VUID-VkDispatchIndirect2InfoKHR-addressRange-13109",
                  .least = sizeof(VkDispatchIndirectCommand),
                  .leastRule = "VUID-vkCmdDispatchIndirect2KHR-pInfo-13050"});
}

void checkCondition(DeviceModel &device, VkCommandBuffer commandBuffer, const VkConditionalRenderingBeginInfo2EXT &info,
                    bool isActive)
{
    const RangeCheck ranges(device, commandBuffer);
    const Place command("vkCmdBeginConditionalRendering2EXT");
    const Place place = command.member("pConditionalRenderingBegin");
    if (isActive)
        ranges.fault(command, "VUID-vkCmdBeginConditionalRendering2EXT-None-13063",
                     "conditional rendering is active already");
    ranges.check(place, info.addressRange, info.addressFlags, flag_rules::kCondition,
                 {.usage = VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT,
                  .usageRule = "VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13064",
                  .alignment = 4,
                  .alignmentRule = "VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13065",
                  .least = sizeof(uint32_t),
                  .leastRule = "VUID-VkConditionalRenderingBeginInfo2EXT-addressRange-13066"});
}

void checkFeedbackBuffers(DeviceModel &device, VkCommandBuffer commandBuffer, uint32_t count,
                          const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    const RangeCheck ranges(device, commandBuffer);
    const Place command("vkCmdBindTransformFeedbackBuffers2EXT");
    const VkDeviceSize most = device.facts.maxTransformFeedbackBufferSize;
    for (uint32_t i = 0; i < count; ++i) {
        const Place info = command.element("pBindingInfos", i);
        if (infos[i].addressRange.size > most)
            ranges.fault(info.member("addressRange"), "VUID-vkCmdBindTransformFeedbackBuffers2EXT-addressRange-13092",
                         std::to_string(infos[i].addressRange.size) + " bytes; maxTransformFeedbackBufferSize is " +
                             std::to_string(most));
        ranges.check(info, infos[i].addressRange, infos[i].addressFlags, flag_rules::kFeedbackBuffer,
                     {.usage = VK_BUFFER_USAGE_TRANSFORM_FEEDBACK_BUFFER_BIT_EXT,
                      .usageRule = "VUID-vkCmdBindTransformFeedbackBuffers2EXT-addressRange-13091",
                      .alignment = 4,
                      .alignmentRule = "VUID-vkCmdBindTransformFeedbackBuffers2EXT-addressRange-13090"});
    }
}

void checkByteCount(DeviceModel &device, VkCommandBuffer commandBuffer,
                    const VkBindTransformFeedbackBuffer2InfoEXT &info)
{
    const RangeCheck ranges(device, commandBuffer);
    const Place command("vkCmdDrawIndirectByteCount2EXT");
    ranges.check(command.member("pCounterInfo"), info.addressRange, info.addressFlags, flag_rules::kFeedbackBuffer,
                 {.usage = VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT,
                  .usageRule = "VUID-vkCmdDrawIndirectByteCount2EXT-pInfo-13061",
                  .alignment = 4,
                  .alignmentRule = "VUID-vkCmdDrawIndirectByteCount2EXT-pInfo-13062"});
}

void checkFeedbackBegin(DeviceModel &device, VkCommandBuffer commandBuffer, uint32_t count,
                        const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    checkCounters(device, commandBuffer, "vkCmdBeginTransformFeedback2EXT", count, infos,
                  "VUID-vkCmdBeginTransformFeedback2EXT-pCounterInfos-13093",
                  "VUID-vkCmdBeginTransformFeedback2EXT-pCounterInfos-13094");
}

void checkFeedbackEnd(DeviceModel &device, VkCommandBuffer commandBuffer, uint32_t count,
                      const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    checkCounters(device, commandBuffer, "vkCmdEndTransformFeedback2EXT", count, infos,
                  "VUID-vkCmdEndTransformFeedback2EXT-pCounterInfos-13095",
                  "VUID-vkCmdEndTransformFeedback2EXT-pCounterInfos-13096");
}

} // namespace vellum::layer::ranges
