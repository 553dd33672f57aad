// SPDX-License-Identifier: Apache-2.0
// Secondary command buffers that inherit state.
#pragma once

#include "harness/harness.h"

namespace vt
{

// Begun, with structures that VkCommandBufferInheritanceInfo::pNext names; to be freed by the caller.
inline VkCommandBuffer beginInheriting(Gpu &gpu, const void *chain)
{
    auto allocation = vkInit<VkCommandBufferAllocateInfo>(
        {.commandPool = gpu.pool(), .level = VK_COMMAND_BUFFER_LEVEL_SECONDARY, .commandBufferCount = 1});
    VkCommandBuffer secondary = VK_NULL_HANDLE;
    VT_CHECK(vkAllocateCommandBuffers(gpu.device(), &allocation, &secondary));
    auto inheritance = vkInit<VkCommandBufferInheritanceInfo>({.pNext = chain});
    auto begin = vkInit<VkCommandBufferBeginInfo>({.pInheritanceInfo = &inheritance});
    VT_CHECK(vkBeginCommandBuffer(secondary, &begin));
    return secondary;
}

// Lavapipe does not say that it lets a command buffer inherit conditional rendering, which is the validation layer's to
// mind.
inline VkCommandBuffer beginInheritingCondition(Gpu &gpu)
{
    const auto conditional =
        vkInit<VkCommandBufferInheritanceConditionalRenderingInfoEXT>({.conditionalRenderingEnable = VK_TRUE});
    return beginInheriting(gpu, &conditional);
}

} // namespace vt
