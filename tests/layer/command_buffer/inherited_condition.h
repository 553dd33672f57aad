// Secondary command buffers that inherit conditional rendering. Lavapipe does not say that it lets a command buffer
// inherit it, which is the validation layer's to mind.
#pragma once

#include "harness/harness.h"

namespace vt
{

// Begun; to be freed by the caller.
inline VkCommandBuffer beginInheritingCondition(Gpu &gpu)
{
    VkCommandBufferAllocateInfo allocation{};
    allocation.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
    allocation.commandPool = gpu.pool();
    allocation.level = VK_COMMAND_BUFFER_LEVEL_SECONDARY;
    allocation.commandBufferCount = 1;
    VkCommandBuffer secondary = VK_NULL_HANDLE;
    VT_CHECK(vkAllocateCommandBuffers(gpu.device(), &allocation, &secondary));
    VkCommandBufferInheritanceConditionalRenderingInfoEXT conditional{};
    conditional.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_INHERITANCE_CONDITIONAL_RENDERING_INFO_EXT;
    conditional.conditionalRenderingEnable = VK_TRUE;
    VkCommandBufferInheritanceInfo inheritance{};
    inheritance.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_INHERITANCE_INFO;
    inheritance.pNext = &conditional;
    VkCommandBufferBeginInfo begin{};
    begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    begin.pInheritanceInfo = &inheritance;
    VT_CHECK(vkBeginCommandBuffer(secondary, &begin));
    return secondary;
}

} // namespace vt
