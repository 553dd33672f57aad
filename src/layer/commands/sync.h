// Pipeline stages and accesses of micromap builds, which the driver does not know, wherever they can be passed. They
// exist only as 64-bit flags: VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT, VK_ACCESS_2_MICROMAP_READ/WRITE_BIT_EXT.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct DeviceCommands;

void cmdPipelineBarrier2(DeviceCommands &, VkCommandBuffer, const VkDependencyInfo *);
void cmdSetEvent2(DeviceCommands &, VkCommandBuffer, VkEvent, const VkDependencyInfo *);
void cmdResetEvent2(DeviceCommands &, VkCommandBuffer, VkEvent, VkPipelineStageFlags2);
void cmdWaitEvents2(DeviceCommands &, VkCommandBuffer, uint32_t, const VkEvent *, const VkDependencyInfo *);
void cmdWriteTimestamp2(DeviceCommands &, VkCommandBuffer, VkPipelineStageFlags2, VkQueryPool, uint32_t);
void cmdWriteBufferMarker2(DeviceCommands &, VkCommandBuffer, VkPipelineStageFlags2, VkBuffer, VkDeviceSize, uint32_t);
VkResult queueSubmit2(DeviceCommands &, VkQueue, uint32_t, const VkSubmitInfo2 *, VkFence);
// The layer may want the same queue (commands/trials.h).
VkResult queueBindSparse(DeviceCommands &, VkQueue, uint32_t, const VkBindSparseInfo *, VkFence);
void queueBeginDebugUtilsLabel(DeviceCommands &, VkQueue, const VkDebugUtilsLabelEXT *);
void queueEndDebugUtilsLabel(DeviceCommands &, VkQueue);
void queueInsertDebugUtilsLabel(DeviceCommands &, VkQueue, const VkDebugUtilsLabelEXT *);
VkResult queuePresent(DeviceCommands &, VkQueue, const VkPresentInfoKHR *);
VkResult createRenderPass2(DeviceCommands &, VkDevice, const VkRenderPassCreateInfo2 *, const VkAllocationCallbacks *,
                           VkRenderPass *);

} // namespace vellum::layer
