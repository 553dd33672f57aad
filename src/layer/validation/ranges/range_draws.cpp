// SPDX-License-Identifier: Apache-2.0
// Index and vertex buffers, indirect draws and dispatches, conditional rendering, transform feedback.
#include <algorithm>

#include "layer/input/builds.h"
#include "layer/validation/ranges/ranges.h"

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
        return ranges.fault(member, rules::kVertexBuffer.leastId,
                            "address " + textOf({range.address, 0}) + "; of size 0, the address must be 0");
    if (range.size == 0 && !device.facts.nullDescriptor)
        ranges.fault(member, "VUID-VkBindVertexBuffer3InfoKHR-size-13072",
                     "size 0, without the feature nullDescriptor");
    ranges.check(info, range, buffer.addressFlags, flag_rules::kVertexBuffer, rules::kVertexBuffer);
}

// A kind of indirect draw.
struct Draw {
    const rules::IndirectDraws &draws;
    const char *protectedRule;
    const char *featureRule = nullptr; // drawIndirectCount
};

// Indexed by DrawKind.
constexpr Draw kDraws[] = {
    {rules::kDrawIndirect, "VUID-vkCmdDrawIndirect2KHR-commandBuffer-13057"},
    {rules::kDrawIndexedIndirect, "VUID-vkCmdDrawIndexedIndirect2KHR-commandBuffer-13059"},
    {rules::kDrawMeshTasks, "VUID-vkCmdDrawMeshTasksIndirect2EXT-commandBuffer-13067"},
};
constexpr Draw kCountedDraws[] = {
    {rules::kDrawIndirectCount, "VUID-vkCmdDrawIndirectCount2KHR-commandBuffer-13058", rules::kDrawCountFeatureId},
    {rules::kDrawIndexedIndirectCount, "VUID-vkCmdDrawIndexedIndirectCount2KHR-commandBuffer-13060",
     "VUID-vkCmdDrawIndexedIndirectCount2KHR-drawIndirectCount-13120"},
    {rules::kDrawMeshTasksCount, "VUID-vkCmdDrawMeshTasksIndirectCount2EXT-commandBuffer-13068",
     "VUID-vkCmdDrawMeshTasksIndirectCount2EXT-drawIndirectCount-13069"},
};

void checkUnprotected(const RangeCheck &ranges, const Place &command, const char *rule)
{
    if (ranges.isProtected())
        ranges.fault(command.member("commandBuffer"), rule, "a protected command buffer");
}

// The rules of the range that holds the commands of `count` draws.
void checkDraws(const DeviceModel &device, const RangeCheck &ranges, const Place &info,
                const rules::IndirectDraws &draws, const VkStridedDeviceAddressRangeKHR &range, uint32_t count,
                const char *protectedBufferRule)
{
    const Place member = info.member("addressRange");
    const std::string stride = "stride " + std::to_string(range.stride);
    const VkDeviceSize rest = range.size - std::min(range.size, draws.bytes);
    const VkDeviceSize least = (std::max(count, 1u) - 1) * range.stride + draws.bytes;
    const Severity severity = rules::ofStride(count);
    const auto &addresses = device.buffers.addresses;
    if (draws.isValidated && count > 0 &&
        (range.size < draws.bytes || (range.stride != 0 && rest / range.stride < count - 1)))
        ranges.fault(member, draws.size,
                     std::to_string(range.size) + " bytes, " + stride + "; the command reads " +
                         std::to_string(draws.bytes) + " bytes for each of " + std::to_string(count) + " draws",
                     rules::ofSmallRange(addresses, {range.address, range.size}, least));
    if (draws.isValidated && count > 1 && range.stride == 0)
        ranges.fault(member, draws.noStride, stride + ", for " + std::to_string(count) + " draws");
    if (draws.isValidated && range.stride != 0 && range.stride < draws.bytes)
        ranges.fault(member, draws.smallStride,
                     stride + "; the commands of a draw have " + std::to_string(draws.bytes) + " bytes", severity);
    if (draws.isValidated && range.stride % 4 != 0)
        ranges.fault(member, draws.unalignedStride, stride + " is not a multiple of 4", severity);
    const auto buffer = bufferAt(device, range.address);
    if (buffer && (buffer->flags & VK_BUFFER_CREATE_PROTECTED_BIT) != 0 && !device.facts.protectedNoFault)
        ranges.fault(member, protectedBufferRule, "buffer " + device.nameOf(buffer->handle) + " is protected");
}

// A range of size 0 is no counter.
bool checkCounters(DeviceModel &device, VkCommandBuffer commandBuffer, const char *name, uint32_t count,
                   const VkBindTransformFeedbackBuffer2InfoEXT *infos, const rules::Range &counter)
{
    const RangeCheck ranges(device, commandBuffer);
    const Place command(name);
    for (uint32_t i = 0; infos && i < count; ++i) {
        const Place info = command.element("pCounterInfos", i);
        rules::Range need = counter;
        if (infos[i].addressRange.size == 0)
            need.least = 0;
        ranges.check(info, infos[i].addressRange, infos[i].addressFlags, flag_rules::kFeedbackBuffer, need);
    }
    return ranges.isKept();
}

} // namespace

bool checkIndexBuffer(DeviceModel &device, VkCommandBuffer commandBuffer, const VkBindIndexBuffer3InfoKHR &buffer)
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
    if (range.size == 0 && range.address != 0) {
        ranges.fault(info.member("addressRange"), rules::kIndexBuffer.leastId,
                     "address " + textOf(range) + "; of size 0, the address must be 0");
        return false;
    }
    if (range.size == 0 && !device.facts.nullDescriptor)
        ranges.fault(info.member("addressRange"), "VUID-VkBindIndexBuffer3InfoKHR-None-13055",
                     "size 0, without the feature nullDescriptor");
    rules::Range need = rules::kIndexBuffer;
    need.alignment = std::max(input::indexBytes(buffer.indexType), 1u);
    ranges.check(info, range, buffer.addressFlags, flag_rules::kIndexBuffer, need);
    return ranges.isKept();
}

bool checkVertexBuffers(DeviceModel &device, VkCommandBuffer commandBuffer, uint32_t first, uint32_t count,
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
    return ranges.isKept();
}

bool checkDraw(DeviceModel &device, VkCommandBuffer commandBuffer, DrawKind kind, const VkDrawIndirect2InfoKHR &info)
{
    const Draw &draw = kDraws[static_cast<size_t>(kind)];
    const RangeCheck ranges(device, commandBuffer);
    const Place command(draw.draws.command);
    const Place place = command.member("pInfo");
    checkUnprotected(ranges, command, draw.protectedRule);
    checkDraws(device, ranges, place, draw.draws, info.addressRange, info.drawCount,
               "VUID-VkDrawIndirect2InfoKHR-protectedNoFault-13108");
    ranges.check(place, info.addressRange, info.addressFlags, flag_rules::kDraw, rules::kDraws);
    return ranges.isKept();
}

bool checkDraw(DeviceModel &device, VkCommandBuffer commandBuffer, DrawKind kind,
               const VkDrawIndirectCount2InfoKHR &info)
{
    const Draw &draw = kCountedDraws[static_cast<size_t>(kind)];
    const RangeCheck ranges(device, commandBuffer);
    const Place command(draw.draws.command);
    const Place place = command.member("pInfo");
    if (!device.facts.drawIndirectCount)
        ranges.fault(command, draw.featureRule, "the feature drawIndirectCount is not enabled");
    checkUnprotected(ranges, command, draw.protectedRule);
    checkDraws(device, ranges, place, draw.draws, info.addressRange, info.maxDrawCount,
               "VUID-VkDrawIndirectCount2InfoKHR-protectedNoFault-13108");
    ranges.check(place, info.addressRange, info.addressFlags, flag_rules::kCountedDraw, rules::kCountedDraws);
    ranges.check(place, info.countAddressRange, info.countAddressFlags, flag_rules::kDrawCount, rules::kDrawCount);
    return ranges.isKept();
}

bool checkDispatch(DeviceModel &device, VkCommandBuffer commandBuffer, const VkDispatchIndirect2InfoKHR &info)
{
    const RangeCheck ranges(device, commandBuffer);
    const Place command("vkCmdDispatchIndirect2KHR");
    const Place place = command.member("pInfo");
    checkUnprotected(ranges, command, "VUID-vkCmdDispatchIndirect2KHR-commandBuffer-13049");
    const auto buffer = bufferAt(device, info.addressRange.address);
    if (buffer && (buffer->flags & VK_BUFFER_CREATE_PROTECTED_BIT) != 0 && !device.facts.protectedNoFault)
        ranges.fault(place.member("addressRange"), "VUID-VkDispatchIndirect2InfoKHR-protectedNoFault-13108",
                     "buffer " + device.nameOf(buffer->handle) + " is protected");
    ranges.check(place, info.addressRange, info.addressFlags, flag_rules::kDispatch, rules::kDispatch);
    return ranges.isKept();
}

bool checkCondition(DeviceModel &device, VkCommandBuffer commandBuffer, const VkConditionalRenderingBeginInfo2EXT &info,
                    bool isActive)
{
    const RangeCheck ranges(device, commandBuffer);
    const Place command("vkCmdBeginConditionalRendering2EXT");
    const Place place = command.member("pConditionalRenderingBegin");
    if (isActive)
        ranges.fault(command, "VUID-vkCmdBeginConditionalRendering2EXT-None-13063",
                     "conditional rendering is active already");
    ranges.check(place, info.addressRange, info.addressFlags, flag_rules::kCondition, rules::kCondition);
    return ranges.isKept();
}

bool checkFeedbackBuffers(DeviceModel &device, VkCommandBuffer commandBuffer, uint32_t count,
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
                     rules::kFeedbackBuffer);
    }
    return ranges.isKept();
}

bool checkByteCount(DeviceModel &device, VkCommandBuffer commandBuffer,
                    const VkBindTransformFeedbackBuffer2InfoEXT &info)
{
    const RangeCheck ranges(device, commandBuffer);
    const Place command("vkCmdDrawIndirectByteCount2EXT");
    ranges.check(command.member("pCounterInfo"), info.addressRange, info.addressFlags, flag_rules::kFeedbackBuffer,
                 rules::kByteCount);
    return ranges.isKept();
}

bool checkFeedbackBegin(DeviceModel &device, VkCommandBuffer commandBuffer, uint32_t count,
                        const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    return checkCounters(device, commandBuffer, "vkCmdBeginTransformFeedback2EXT", count, infos, rules::kBeginCounter);
}

bool checkFeedbackEnd(DeviceModel &device, VkCommandBuffer commandBuffer, uint32_t count,
                      const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    return checkCounters(device, commandBuffer, "vkCmdEndTransformFeedback2EXT", count, infos, rules::kEndCounter);
}

} // namespace vellum::layer::ranges
