// SPDX-License-Identifier: Apache-2.0
// Commands that synchronize, on devices and between them and the host, and transfers of buffers.
#pragma once

#include <vulkan/vulkan.h>

#include "layer/validation/sync/sync_tracker.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct DeviceValidation;
struct ValidatedBuffer;
struct ValidatedStructure;

namespace sync
{

// What a batch of a submission waits for and signals.
std::vector<SemaphoreUse> waitsOf(const DeviceValidation &, const VkSubmitInfo &);
std::vector<SemaphoreUse> waitsOf(const DeviceValidation &, const VkSubmitInfo2 &);
std::vector<SemaphoreUse> signalsOf(const DeviceValidation &, const VkSubmitInfo &);
std::vector<SemaphoreUse> signalsOf(const DeviceValidation &, const VkSubmitInfo2 &);
// Around the steps of its command buffers.
void beginBatch(DeviceValidation &, VkQueue, const std::vector<SemaphoreUse> &waits);
void endBatch(DeviceValidation &, VkQueue, const std::vector<SemaphoreUse> &signals);
void signalFence(DeviceValidation &, VkQueue, VkFence);

void recordBarriers(DeviceValidation &, VkCommandBuffer, const VkDependencyInfo &);
void recordSet(DeviceValidation &, VkCommandBuffer, VkEvent);
void recordReset(DeviceValidation &, VkCommandBuffer, VkEvent);
void recordWait(DeviceValidation &, VkCommandBuffer, uint32_t, const VkEvent *, const VkDependencyInfo *);

// What the host learned by a wait that succeeded. `all`: of all fences, and not of some.
void fencesComplete(DeviceValidation &, VkDevice, uint32_t, const VkFence *, bool all);
void semaphoresReached(DeviceValidation &, VkDevice, const VkSemaphoreWaitInfo &);
// Before a structure or a buffer is destroyed. `rule`: that commands which refer to it must be complete.
void checkDestruction(DeviceValidation &, const char *command, const char *rule, const ValidatedStructure *);
void checkDestruction(DeviceValidation &, const ValidatedBuffer *);
void checkFree(DeviceValidation &, VkDeviceMemory);

} // namespace sync

namespace validation
{

void cmdPipelineBarrier(DeviceValidation &, VkCommandBuffer, VkPipelineStageFlags, VkPipelineStageFlags,
                        VkDependencyFlags, uint32_t, const VkMemoryBarrier *, uint32_t, const VkBufferMemoryBarrier *,
                        uint32_t, const VkImageMemoryBarrier *);
void cmdBeginRenderPass(DeviceValidation &, VkCommandBuffer, const VkRenderPassBeginInfo *, VkSubpassContents);
void cmdBeginRenderPass2(DeviceValidation &, VkCommandBuffer, const VkRenderPassBeginInfo *,
                         const VkSubpassBeginInfo *);
void cmdEndRenderPass(DeviceValidation &, VkCommandBuffer);
void cmdBeginRendering(DeviceValidation &, VkCommandBuffer, const VkRenderingInfo *);
void cmdEndRendering(DeviceValidation &, VkCommandBuffer);
void cmdEndRendering2(DeviceValidation &, VkCommandBuffer, const VkRenderingEndInfoKHR *);
void cmdEndRenderPass2(DeviceValidation &, VkCommandBuffer, const VkSubpassEndInfo *);
void cmdSetEvent(DeviceValidation &, VkCommandBuffer, VkEvent, VkPipelineStageFlags);
void cmdResetEvent(DeviceValidation &, VkCommandBuffer, VkEvent, VkPipelineStageFlags);
void cmdWaitEvents(DeviceValidation &, VkCommandBuffer, uint32_t, const VkEvent *, VkPipelineStageFlags,
                   VkPipelineStageFlags, uint32_t, const VkMemoryBarrier *, uint32_t, const VkBufferMemoryBarrier *,
                   uint32_t, const VkImageMemoryBarrier *);

void cmdCopyBuffer(DeviceValidation &, VkCommandBuffer, VkBuffer, VkBuffer, uint32_t, const VkBufferCopy *);
void cmdCopyBuffer2(DeviceValidation &, VkCommandBuffer, const VkCopyBufferInfo2 *);
void cmdFillBuffer(DeviceValidation &, VkCommandBuffer, VkBuffer, VkDeviceSize, VkDeviceSize, uint32_t);
void cmdUpdateBuffer(DeviceValidation &, VkCommandBuffer, VkBuffer, VkDeviceSize, VkDeviceSize, const void *);

VkResult resetFences(DeviceValidation &, VkDevice, uint32_t, const VkFence *);
void destroyFence(DeviceValidation &, VkDevice, VkFence, const VkAllocationCallbacks *);
VkResult createSemaphore(DeviceValidation &, VkDevice, const VkSemaphoreCreateInfo *, const VkAllocationCallbacks *,
                         VkSemaphore *);
void destroySemaphore(DeviceValidation &, VkDevice, VkSemaphore, const VkAllocationCallbacks *);
VkResult signalSemaphore(DeviceValidation &, VkDevice, const VkSemaphoreSignalInfo *);
VkResult getQueryPoolResults(DeviceValidation &, VkDevice, VkQueryPool, uint32_t, uint32_t, size_t, void *,
                             VkDeviceSize, VkQueryResultFlags);
VkResult getEventStatus(DeviceValidation &, VkDevice, VkEvent);
VkResult setEvent(DeviceValidation &, VkDevice, VkEvent);
VkResult resetEvent(DeviceValidation &, VkDevice, VkEvent);
void destroyEvent(DeviceValidation &, VkDevice, VkEvent, const VkAllocationCallbacks *);

} // namespace validation
} // namespace vellum::layer
