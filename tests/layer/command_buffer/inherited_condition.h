// SPDX-License-Identifier: Apache-2.0
// Secondary command buffers that inherit conditional rendering. Lavapipe does not say that it lets a command buffer
// inherit it, which is the validation layer's to mind.
#pragma once

#include "harness/harness.h"

namespace vt
{

// Begun; to be freed by the caller.
inline VkCommandBuffer beginInheritingCondition(Gpu &gpu)
{
    auto allocation = vkInit<VkCommandBufferAllocateInfo>(
        {.commandPool = gpu.pool(), .level = VK_COMMAND_BUFFER_LEVEL_SECONDARY, .commandBufferCount = 1});
    VkCommandBuffer secondary = VK_NULL_HANDLE;
    VT_CHECK(vkAllocateCommandBuffers(gpu.device(), &allocation, &secondary));
    auto conditional =
        vkInit<VkCommandBufferInheritanceConditionalRenderingInfoEXT>({.conditionalRenderingEnable = VK_TRUE});
    auto inheritance = vkInit<VkCommandBufferInheritanceInfo>({.pNext = &conditional});
    auto begin = vkInit<VkCommandBufferBeginInfo>({.pInheritanceInfo = &inheritance});
    VT_CHECK(vkBeginCommandBuffer(secondary, &begin));
    return secondary;
}

} // namespace vt
