// SPDX-License-Identifier: Apache-2.0
// Transform feedback of VK_KHR_device_address_commands.
#include <vector>

#include "layer/command_buffer/command_state.h"
#include "layer/device_address/address_lookup.h"
#include "layer/device_address/device_address_commands.h"
#include "layer/device_address/device_addresses.h"

namespace vellum::layer
{
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
