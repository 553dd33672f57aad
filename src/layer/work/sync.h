// Pipeline stages and accesses of micromap builds, which the driver does not know, wherever they can be passed. They
// exist only as 64-bit flags: VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT, VK_ACCESS_2_MICROMAP_READ/WRITE_BIT_EXT.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

VKAPI_ATTR void VKAPI_CALL cmdPipelineBarrier2(VkCommandBuffer, const VkDependencyInfo *);
VKAPI_ATTR void VKAPI_CALL cmdSetEvent2(VkCommandBuffer, VkEvent, const VkDependencyInfo *);
VKAPI_ATTR void VKAPI_CALL cmdResetEvent2(VkCommandBuffer, VkEvent, VkPipelineStageFlags2);
VKAPI_ATTR void VKAPI_CALL cmdWaitEvents2(VkCommandBuffer, uint32_t, const VkEvent *, const VkDependencyInfo *);
VKAPI_ATTR void VKAPI_CALL cmdWriteTimestamp2(VkCommandBuffer, VkPipelineStageFlags2, VkQueryPool, uint32_t);
VKAPI_ATTR void VKAPI_CALL cmdWriteBufferMarker2(VkCommandBuffer, VkPipelineStageFlags2, VkBuffer, VkDeviceSize,
                                                 uint32_t);
VKAPI_ATTR VkResult VKAPI_CALL queueSubmit2(VkQueue, uint32_t, const VkSubmitInfo2 *, VkFence);
VKAPI_ATTR VkResult VKAPI_CALL createRenderPass2(VkDevice, const VkRenderPassCreateInfo2 *,
                                                 const VkAllocationCallbacks *, VkRenderPass *);

} // namespace vellum::layer
