// SPDX-License-Identifier: Apache-2.0
#include "layer/command_buffer/address_barriers.h"

#include "layer/command_buffer/device_command_buffers.h"
#include "layer/input/checked.h"
#include "layer/rules/address_ranges.h"

namespace vellum::layer
{
namespace
{

// A range barrier covers accesses to memory by any buffer or address. A memory barrier covers these and more, and is
// allowed wherever a range barrier is.
void addMemoryBarrier(const VkMemoryRangeBarrierKHR &range, std::vector<VkMemoryBarrier2> &memory)
{
    memory.push_back({VK_STRUCTURE_TYPE_MEMORY_BARRIER_2, nullptr, range.srcStageMask, range.srcAccessMask,
                      range.dstStageMask, range.dstAccessMask});
}

// Memory is transferred to another queue family buffer by buffer: each buffer's part of the range.
bool addTransfers(const DeviceCommandBuffers &device, VkCommandBuffer commandBuffer,
                  const VkMemoryRangeBarrierKHR &range, std::vector<VkBufferMemoryBarrier2> &buffers)
{
    const auto locations = device.buffers.addresses.within(range.addressRange.address, range.addressRange.size);
    for (const AddressMap::Location &location : locations) {
        device.states.keep(commandBuffer, location.owner);
        buffers.push_back({VK_STRUCTURE_TYPE_BUFFER_MEMORY_BARRIER_2, nullptr, range.srcStageMask, range.srcAccessMask,
                           range.dstStageMask, range.dstAccessMask, range.srcQueueFamilyIndex,
                           range.dstQueueFamilyIndex, location.buffer, location.offset, location.bytes});
    }
    return !locations.empty();
}

} // namespace

void addRangeBarriers(const DeviceCommandBuffers &device, VkCommandBuffer commandBuffer,
                      const VkMemoryRangeBarriersInfoKHR &info, std::vector<VkMemoryBarrier2> &memory,
                      std::vector<VkBufferMemoryBarrier2> &buffers)
{
    const bool isReported = input::areRangesReported(commandBuffer);
    for (uint32_t i = 0; i < info.memoryRangeBarrierCount; ++i) {
        const VkMemoryRangeBarrierKHR &range = info.pMemoryRangeBarriers[i];
        const bool transfer = range.srcQueueFamilyIndex != range.dstQueueFamilyIndex;
        if (transfer && addTransfers(device, commandBuffer, range, buffers))
            continue;
        addMemoryBarrier(range, memory);
        if (transfer && !isReported)
            device.driver.report().error(
                rules::kAnyRange.buffer,
                "VkMemoryRangeBarrierKHR: addressRange is in no buffer; it is not transferred to the "
                "other queue family");
    }
}

} // namespace vellum::layer
