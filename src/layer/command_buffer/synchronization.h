// SPDX-License-Identifier: Apache-2.0
// Commands that order memory accesses: those after which hit tables may have other content (hit_table_copies.h), and
// those that take pipeline stages and accesses, of which the driver does not know those of micromap builds:
// VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT, VK_ACCESS_2_MICROMAP_READ/WRITE_BIT_EXT. They exist as 64-bit flags only.
#pragma once

#include "vk/newer.h"

namespace vellum::layer
{

struct DeviceCommandBuffers;

// The stage that the driver gets in commands that take exactly one.
VkPipelineStageFlags2 driverStage(VkPipelineStageFlags2 stage);

void cmdPipelineBarrier(DeviceCommandBuffers &, VkCommandBuffer, VkPipelineStageFlags, VkPipelineStageFlags,
                        VkDependencyFlags, uint32_t, const VkMemoryBarrier *, uint32_t, const VkBufferMemoryBarrier *,
                        uint32_t, const VkImageMemoryBarrier *);
void cmdWaitEvents(DeviceCommandBuffers &, VkCommandBuffer, uint32_t, const VkEvent *, VkPipelineStageFlags,
                   VkPipelineStageFlags, uint32_t, const VkMemoryBarrier *, uint32_t, const VkBufferMemoryBarrier *,
                   uint32_t, const VkImageMemoryBarrier *);
void cmdBeginRenderPass(DeviceCommandBuffers &, VkCommandBuffer, const VkRenderPassBeginInfo *, VkSubpassContents);
void cmdBeginRenderPass2(DeviceCommandBuffers &, VkCommandBuffer, const VkRenderPassBeginInfo *,
                         const VkSubpassBeginInfo *);
void cmdPipelineBarrier2(DeviceCommandBuffers &, VkCommandBuffer, const VkDependencyInfo *);
void cmdSetEvent2(DeviceCommandBuffers &, VkCommandBuffer, VkEvent, const VkDependencyInfo *);
void cmdResetEvent2(DeviceCommandBuffers &, VkCommandBuffer, VkEvent, VkPipelineStageFlags2);
void cmdWaitEvents2(DeviceCommandBuffers &, VkCommandBuffer, uint32_t, const VkEvent *, const VkDependencyInfo *);
void cmdWriteTimestamp2(DeviceCommandBuffers &, VkCommandBuffer, VkPipelineStageFlags2, VkQueryPool, uint32_t);
void cmdWriteBufferMarker2(DeviceCommandBuffers &, VkCommandBuffer, VkPipelineStageFlags2, VkBuffer, VkDeviceSize,
                           uint32_t);
VkResult queueWaitIdle(DeviceCommandBuffers &, VkQueue);
VkResult deviceWaitIdle(DeviceCommandBuffers &, VkDevice);
VkResult queueSubmit(DeviceCommandBuffers &, VkQueue, uint32_t, const VkSubmitInfo *, VkFence);
VkResult queueSubmit2(DeviceCommandBuffers &, VkQueue, uint32_t, const VkSubmitInfo2 *, VkFence);
// Queue commands, which may use the queue of probes (driver_probe.h).
VkResult queueBindSparse(DeviceCommandBuffers &, VkQueue, uint32_t, const VkBindSparseInfo *, VkFence);
void queueBeginDebugUtilsLabel(DeviceCommandBuffers &, VkQueue, const VkDebugUtilsLabelEXT *);
void queueEndDebugUtilsLabel(DeviceCommandBuffers &, VkQueue);
void queueInsertDebugUtilsLabel(DeviceCommandBuffers &, VkQueue, const VkDebugUtilsLabelEXT *);
VkResult queuePresent(DeviceCommandBuffers &, VkQueue, const VkPresentInfoKHR *);
VkResult queueSetPerformanceConfiguration(DeviceCommandBuffers &, VkQueue, VkPerformanceConfigurationINTEL);
VkResult queueSetPerfHint(DeviceCommandBuffers &, VkQueue, const VkPerfHintInfoQCOM *);
VkResult createRenderPass2(DeviceCommandBuffers &, VkDevice, const VkRenderPassCreateInfo2 *,
                           const VkAllocationCallbacks *, VkRenderPass *);

} // namespace vellum::layer
