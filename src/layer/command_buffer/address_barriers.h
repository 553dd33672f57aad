// SPDX-License-Identifier: Apache-2.0
// Range barriers of VK_KHR_device_address_commands, in the pNext of dependency infos.
#pragma once

#include <vector>

#include "vellum/vulkan_opacity_micromap.h"

namespace vellum::layer
{

struct DeviceCommandBuffers;

// Appends the range barriers of a dependency info as memory and buffer barriers, which every driver knows.
void addRangeBarriers(const DeviceCommandBuffers &device, VkCommandBuffer commandBuffer,
                      const VkMemoryRangeBarriersInfoKHR &info, std::vector<VkMemoryBarrier2> &memory,
                      std::vector<VkBufferMemoryBarrier2> &buffers);

} // namespace vellum::layer
