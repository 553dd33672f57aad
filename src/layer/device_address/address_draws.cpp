// SPDX-License-Identifier: Apache-2.0
// Bindings, indirect commands, conditional rendering and transform feedback of VK_KHR_device_address_commands.
#include <algorithm>
#include <vector>

#include "layer/base/commands.h"
#include "layer/base/pnext.h"
#include "layer/command_buffer/command_state.h"
#include "layer/device_address/address_lookup.h"
#include "layer/device_address/device_addresses.h"

namespace vellum::layer
{
namespace
{

constexpr VkDeviceSize kZeroIndexBytes = 1 << 20;

VkDeviceSize indexBytes(VkIndexType type)
{
    constexpr auto uint8 = static_cast<VkIndexType>(1000265000); // VK_INDEX_TYPE_UINT8_KHR
    return type == uint8 ? 1 : type == VK_INDEX_TYPE_UINT16 ? 2 : 4;
}

bool isNull(VkDeviceAddress address, VkDeviceSize size)
{
    return address == 0 && size == 0;
}

// The stride for the older commands. Reports an error and returns nothing if it is wrong and there are several draws.
// For a single draw it may be 0, which the older commands do not allow (VUID-vkCmdDrawIndirectCount-stride-03110).
std::optional<uint32_t> strideOf(const AddressLookup &lookup, const rules::IndirectDraws &kind, VkDeviceSize stride,
                                 uint32_t draws)
{
    const bool several = draws > 1;
    if (several && stride == 0) {
        lookup.report(Severity::Reject, kind.noStride, "several draws with a stride of 0");
        return std::nullopt;
    }
    if (stride != 0 && stride < kind.bytes &&
        !lookup.report(rules::ofStride(draws), kind.smallStride,
                       "the stride is smaller than what the device reads for each draw"))
        return std::nullopt;
    if (stride % 4 != 0 &&
        !lookup.report(rules::ofStride(draws), kind.unalignedStride, "the stride is not a multiple of 4"))
        return std::nullopt;
    if (several && stride > UINT32_MAX) {
        lookup.report(Severity::Reject, "VELLUM-not-available", "strides of 4 GiB and more are not available");
        return std::nullopt;
    }
    return static_cast<uint32_t>(several ? stride : kind.bytes);
}

struct Draws {
    AddressLookup::Found at;
    uint32_t stride;
};

// The buffer range of the commands of `draws` draws.
std::optional<Draws> findDraws(const AddressLookup &lookup, const rules::IndirectDraws &kind,
                               const VkStridedDeviceAddressRangeKHR &range, uint32_t draws, const rules::Range &rule)
{
    const auto stride = strideOf(lookup, kind, range.stride, draws);
    if (!stride)
        return std::nullopt;
    const auto found = lookup.find(range, {.member = "addressRange",
                                           .range = rule,
                                           .least = (draws - VkDeviceSize{1}) * *stride + kind.bytes,
                                           .leastId = kind.size});
    return found ? std::optional(Draws{*found, *stride}) : std::nullopt;
}

void drawIndirect(const DeviceAddresses &device, VkCommandBuffer commandBuffer, const VkDrawIndirect2InfoKHR &info,
                  const rules::IndirectDraws &kind, PFN_vkCmdDrawIndirect next)
{
    if (info.drawCount == 0)
        return;
    const AddressLookup lookup(device, commandBuffer, kind.command);
    const auto draws = findDraws(lookup, kind, info.addressRange, info.drawCount, rules::kDraws);
    if (draws)
        next(commandBuffer, draws->at.buffer, draws->at.offset, info.drawCount, draws->stride);
}

void drawIndirectCount(const DeviceAddresses &device, VkCommandBuffer commandBuffer,
                       const VkDrawIndirectCount2InfoKHR &info, const rules::IndirectDraws &kind,
                       PFN_vkCmdDrawIndirectCount next)
{
    if (info.maxDrawCount == 0)
        return;
    const AddressLookup lookup(device, commandBuffer, kind.command);
    if (!next) {
        lookup.report(Severity::Reject, rules::kDrawCountFeatureId, "the driver has no indirect draws with counts");
        return;
    }
    const auto draws = findDraws(lookup, kind, info.addressRange, info.maxDrawCount, rules::kCountedDraws);
    const auto count = lookup.find(info.countAddressRange, {.member = "countAddressRange", .range = rules::kDrawCount});
    if (draws && count)
        next(commandBuffer, draws->at.buffer, draws->at.offset, count->buffer, count->offset, info.maxDrawCount,
             draws->stride);
}

} // namespace

VkBuffer ZeroIndices::get(const GpuContext &context)
{
    std::lock_guard lock(mutex_);
    if (!buffer_.buffer())
        (void)buffer_.create(context, kZeroIndexBytes, VK_BUFFER_USAGE_INDEX_BUFFER_BIT);
    return buffer_.buffer();
}

bool enablesNullIndexBuffer(const VkDeviceCreateInfo &info)
{
    const auto *own = findInChain<VkPhysicalDeviceMaintenance6FeaturesKHR>(
        info.pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_MAINTENANCE_6_FEATURES_KHR);
    const auto *core = findInChain<VkPhysicalDeviceVulkan14Features>(
        info.pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_4_FEATURES);
    return (own && own->maintenance6) || (core && core->maintenance6);
}

void cmdBindIndexBuffer3(DeviceAddresses &device, VkCommandBuffer commandBuffer, const VkBindIndexBuffer3InfoKHR *info)
{
    const VkDeviceAddressRangeKHR &range = info->addressRange;
    if (isNull(range.address, range.size)) {
        const VkBuffer null =
            device.driver.nullIndexBuffer ? VK_NULL_HANDLE : device.zeroIndices.get(device.buffers.gpu);
        return device.driver.next.CmdBindIndexBuffer(commandBuffer, null, 0, info->indexType);
    }
    const AddressLookup lookup(device, commandBuffer, "vkCmdBindIndexBuffer3KHR");
    const auto found = lookup.find(range, {.member = "addressRange", .range = rules::kIndexBuffer, .least = 1});
    if (!found)
        return;
    if (!device.driver.next.CmdBindIndexBuffer2KHR)
        return device.driver.next.CmdBindIndexBuffer(commandBuffer, found->buffer, found->offset, info->indexType);
    // Whole indices (VUID-vkCmdBindIndexBuffer2-size-08767).
    const VkDeviceSize size = found->size - found->size % indexBytes(info->indexType);
    device.driver.next.CmdBindIndexBuffer2KHR(commandBuffer, found->buffer, found->offset, size, info->indexType);
}

void cmdBindVertexBuffers3(DeviceAddresses &device, VkCommandBuffer commandBuffer, uint32_t first, uint32_t count,
                           const VkBindVertexBuffer3InfoKHR *infos)
{
    const AddressLookup lookup(device, commandBuffer, "vkCmdBindVertexBuffers3KHR");
    std::vector<VkBuffer> buffers(count);
    std::vector<VkDeviceSize> offsets(count), sizes(count), strides(count);
    for (uint32_t i = 0; i < count; ++i) {
        const VkStridedDeviceAddressRangeKHR &range = infos[i].addressRange;
        strides[i] = range.stride;
        if (isNull(range.address, range.size))
            continue; // VK_NULL_HANDLE
        const auto found = lookup.find(
            range, {.member = "addressRange of pBindingInfos", .range = rules::kVertexBuffer, .least = 1, .index = i});
        if (!found)
            return;
        buffers[i] = found->buffer;
        offsets[i] = found->offset;
        sizes[i] = found->size;
    }
    if (!device.driver.next.CmdBindVertexBuffers2) // the device has no dynamic strides
        return device.driver.next.CmdBindVertexBuffers(commandBuffer, first, count, buffers.data(), offsets.data());
    // Each run of bindings that all set a stride, or all do not.
    for (uint32_t begin = 0, end = 0; begin < count; begin = end) {
        while (end < count && infos[end].setStride == infos[begin].setStride)
            ++end;
        device.driver.next.CmdBindVertexBuffers2(commandBuffer, first + begin, end - begin, &buffers[begin],
                                                 &offsets[begin], &sizes[begin],
                                                 infos[begin].setStride ? &strides[begin] : nullptr);
    }
}

void cmdDrawIndirect2(DeviceAddresses &device, VkCommandBuffer commandBuffer, const VkDrawIndirect2InfoKHR *info)
{
    drawIndirect(device, commandBuffer, *info, rules::kDrawIndirect, device.driver.next.CmdDrawIndirect);
}

void cmdDrawIndexedIndirect2(DeviceAddresses &device, VkCommandBuffer commandBuffer, const VkDrawIndirect2InfoKHR *info)
{
    drawIndirect(device, commandBuffer, *info, rules::kDrawIndexedIndirect, device.driver.next.CmdDrawIndexedIndirect);
}

void cmdDrawMeshTasksIndirect2(DeviceAddresses &device, VkCommandBuffer commandBuffer,
                               const VkDrawIndirect2InfoKHR *info)
{
    drawIndirect(device, commandBuffer, *info, rules::kDrawMeshTasks, device.driver.next.CmdDrawMeshTasksIndirectEXT);
}

void cmdDrawIndirectCount2(DeviceAddresses &device, VkCommandBuffer commandBuffer,
                           const VkDrawIndirectCount2InfoKHR *info)
{
    drawIndirectCount(device, commandBuffer, *info, rules::kDrawIndirectCount, device.driver.next.CmdDrawIndirectCount);
}

void cmdDrawIndexedIndirectCount2(DeviceAddresses &device, VkCommandBuffer commandBuffer,
                                  const VkDrawIndirectCount2InfoKHR *info)
{
    drawIndirectCount(device, commandBuffer, *info, rules::kDrawIndexedIndirectCount,
                      device.driver.next.CmdDrawIndexedIndirectCount);
}

void cmdDrawMeshTasksIndirectCount2(DeviceAddresses &device, VkCommandBuffer commandBuffer,
                                    const VkDrawIndirectCount2InfoKHR *info)
{
    drawIndirectCount(device, commandBuffer, *info, rules::kDrawMeshTasksCount,
                      device.driver.next.CmdDrawMeshTasksIndirectCountEXT);
}

void cmdDispatchIndirect2(DeviceAddresses &device, VkCommandBuffer commandBuffer,
                          const VkDispatchIndirect2InfoKHR *info)
{
    const AddressLookup lookup(device, commandBuffer, "vkCmdDispatchIndirect2KHR");
    const auto found = lookup.find(info->addressRange, {.member = "addressRange", .range = rules::kDispatch});
    if (found)
        device.driver.next.CmdDispatchIndirect(commandBuffer, found->buffer, found->offset);
}

void cmdBeginConditionalRendering2(DeviceAddresses &device, VkCommandBuffer commandBuffer,
                                   const VkConditionalRenderingBeginInfo2EXT *info)
{
    const AddressLookup lookup(device, commandBuffer, "vkCmdBeginConditionalRendering2EXT");
    const auto found = lookup.find(info->addressRange, {.member = "addressRange", .range = rules::kCondition});
    if (!found)
        return;
    // The layer's function, which records it in the CommandState.
    const VkConditionalRenderingBeginInfoEXT begin{VK_STRUCTURE_TYPE_CONDITIONAL_RENDERING_BEGIN_INFO_EXT, nullptr,
                                                   found->buffer, found->offset, info->flags};
    cmdBeginConditionalRendering(device.commands, commandBuffer, &begin);
}

// --- transform feedback ---

namespace
{

// Counter buffers for the older commands; null if there is no array, or for a range of size 0.
struct Counters {
    std::vector<VkBuffer> buffers;
    std::vector<VkDeviceSize> offsets;
    [[nodiscard]] const VkBuffer *bufferData() const { return buffers.empty() ? nullptr : buffers.data(); }
    [[nodiscard]] const VkDeviceSize *offsetData() const { return offsets.empty() ? nullptr : offsets.data(); }
};

std::optional<Counters> findCounters(const AddressLookup &lookup, uint32_t count,
                                     const VkBindTransformFeedbackBuffer2InfoEXT *infos, const rules::Range &counter)
{
    Counters counters;
    if (!infos)
        return counters;
    counters.buffers.resize(count);
    counters.offsets.resize(count);
    for (uint32_t i = 0; i < count; ++i) {
        if (infos[i].addressRange.size == 0)
            continue;
        const auto found = lookup.find(infos[i].addressRange,
                                       {.member = "addressRange of pCounterInfos", .range = counter, .index = i});
        if (!found)
            return std::nullopt;
        counters.buffers[i] = found->buffer;
        counters.offsets[i] = found->offset;
    }
    return counters;
}

} // namespace

void cmdBindTransformFeedbackBuffers2(DeviceAddresses &device, VkCommandBuffer commandBuffer, uint32_t first,
                                      uint32_t count, const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    const AddressLookup lookup(device, commandBuffer, "vkCmdBindTransformFeedbackBuffers2EXT");
    std::vector<VkBuffer> buffers(count);
    std::vector<VkDeviceSize> offsets(count), sizes(count);
    for (uint32_t i = 0; i < count; ++i) {
        const auto found =
            lookup.find(infos[i].addressRange,
                        {.member = "addressRange of pBindingInfos", .range = rules::kFeedbackBuffer, .index = i});
        if (!found)
            return;
        buffers[i] = found->buffer;
        offsets[i] = found->offset;
        sizes[i] = found->size;
    }
    device.driver.next.CmdBindTransformFeedbackBuffersEXT(commandBuffer, first, count, buffers.data(), offsets.data(),
                                                          sizes.data());
}

void cmdBeginTransformFeedback2(DeviceAddresses &device, VkCommandBuffer commandBuffer, uint32_t first, uint32_t count,
                                const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    const AddressLookup lookup(device, commandBuffer, "vkCmdBeginTransformFeedback2EXT");
    const auto counters = findCounters(lookup, count, infos, rules::kBeginCounter);
    if (const auto state = device.commands.states.get(commandBuffer))
        state->rejectedTransformFeedback = !counters;
    if (counters)
        device.driver.next.CmdBeginTransformFeedbackEXT(commandBuffer, first, count, counters->bufferData(),
                                                        counters->offsetData());
}

void cmdEndTransformFeedback2(DeviceAddresses &device, VkCommandBuffer commandBuffer, uint32_t first, uint32_t count,
                              const VkBindTransformFeedbackBuffer2InfoEXT *infos)
{
    if (const auto state = device.commands.states.get(commandBuffer); state && state->rejectedTransformFeedback) {
        state->rejectedTransformFeedback = false;
        return;
    }
    // Transform feedback must end even if the counters are rejected.
    const AddressLookup lookup(device, commandBuffer, "vkCmdEndTransformFeedback2EXT", "no counter is written");
    const auto counters = findCounters(lookup, count, infos, rules::kEndCounter).value_or(Counters{});
    device.driver.next.CmdEndTransformFeedbackEXT(commandBuffer, first, count, counters.bufferData(),
                                                  counters.offsetData());
}

void cmdDrawIndirectByteCount2(DeviceAddresses &device, VkCommandBuffer commandBuffer, uint32_t instanceCount,
                               uint32_t firstInstance, const VkBindTransformFeedbackBuffer2InfoEXT *info,
                               uint32_t counterOffset, uint32_t vertexStride)
{
    const AddressLookup lookup(device, commandBuffer, "vkCmdDrawIndirectByteCount2EXT");
    const auto found = lookup.find(info->addressRange, {.member = "addressRange of pCounterInfo",
                                                        .range = rules::kByteCount,
                                                        .least = sizeof(uint32_t),
                                                        .leastId = "VELLUM-counter-range"});
    if (found)
        device.driver.next.CmdDrawIndirectByteCountEXT(commandBuffer, instanceCount, firstInstance, found->buffer,
                                                       found->offset, counterOffset, vertexStride);
}

} // namespace vellum::layer
