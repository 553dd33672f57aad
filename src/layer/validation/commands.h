// SPDX-License-Identifier: Apache-2.0
// The commands that validation intercepts: each checks, records what it changes in the model, and calls the
// implementation.
#pragma once

#include "layer/validation/device_validation.h"

namespace vellum::layer
{

struct TracingCommand {
    const char *name;
    VkPipelineBindPoint point;
};

template <auto next>
struct Traced;
template <typename... Arguments, void (VKAPI_PTR *DeviceTable::*next)(VkCommandBuffer, Arguments...)>
struct Traced<next> {
    template <const TracingCommand &command>
    static void call(DeviceValidation &device, VkCommandBuffer commandBuffer, Arguments... arguments)
    {
        runTracing(device.traces, commandBuffer, command.point, command.name);
        (device.next.*next)(commandBuffer, arguments...);
    }
};

namespace validation
{

// -- objects.cpp
void getDeviceQueue(DeviceValidation &, VkDevice, uint32_t, uint32_t, VkQueue *);
void getDeviceQueue2(DeviceValidation &, VkDevice, const VkDeviceQueueInfo2 *, VkQueue *);
VkResult allocateMemory(DeviceValidation &, VkDevice, const VkMemoryAllocateInfo *, const VkAllocationCallbacks *,
                        VkDeviceMemory *);
void freeMemory(DeviceValidation &, VkDevice, VkDeviceMemory, const VkAllocationCallbacks *);
VkResult createBuffer(DeviceValidation &, VkDevice, const VkBufferCreateInfo *, const VkAllocationCallbacks *,
                      VkBuffer *);
void destroyBuffer(DeviceValidation &, VkDevice, VkBuffer, const VkAllocationCallbacks *);
VkResult bindBufferMemory(DeviceValidation &, VkDevice, VkBuffer, VkDeviceMemory, VkDeviceSize);
VkResult bindBufferMemory2(DeviceValidation &, VkDevice, uint32_t, const VkBindBufferMemoryInfo *);
VkDeviceAddress getBufferDeviceAddress(DeviceValidation &, VkDevice, const VkBufferDeviceAddressInfo *);
VkResult createAccelerationStructure(DeviceValidation &, VkDevice, const VkAccelerationStructureCreateInfoKHR *,
                                     const VkAllocationCallbacks *, VkAccelerationStructureKHR *);
VkResult createAccelerationStructure2(DeviceValidation &, VkDevice, const VkAccelerationStructureCreateInfo2KHR *,
                                      const VkAllocationCallbacks *, VkAccelerationStructureKHR *);
void destroyAccelerationStructure(DeviceValidation &, VkDevice, VkAccelerationStructureKHR,
                                  const VkAllocationCallbacks *);
VkDeviceAddress getAccelerationStructureDeviceAddress(DeviceValidation &, VkDevice,
                                                      const VkAccelerationStructureDeviceAddressInfoKHR *);
VkResult createMicromap(DeviceValidation &, VkDevice, const VkMicromapCreateInfoEXT *, const VkAllocationCallbacks *,
                        VkMicromapEXT *);
void destroyMicromap(DeviceValidation &, VkDevice, VkMicromapEXT, const VkAllocationCallbacks *);
VkResult createImage(DeviceValidation &, VkDevice, const VkImageCreateInfo *, const VkAllocationCallbacks *, VkImage *);
void destroyImage(DeviceValidation &, VkDevice, VkImage, const VkAllocationCallbacks *);

// -- command_buffers.cpp
VkResult createCommandPool(DeviceValidation &, VkDevice, const VkCommandPoolCreateInfo *, const VkAllocationCallbacks *,
                           VkCommandPool *);
void destroyCommandPool(DeviceValidation &, VkDevice, VkCommandPool, const VkAllocationCallbacks *);
VkResult resetCommandPool(DeviceValidation &, VkDevice, VkCommandPool, VkCommandPoolResetFlags);
VkResult allocateCommandBuffers(DeviceValidation &, VkDevice, const VkCommandBufferAllocateInfo *, VkCommandBuffer *);
void freeCommandBuffers(DeviceValidation &, VkDevice, VkCommandPool, uint32_t, const VkCommandBuffer *);
VkResult beginCommandBuffer(DeviceValidation &, VkCommandBuffer, const VkCommandBufferBeginInfo *);
VkResult endCommandBuffer(DeviceValidation &, VkCommandBuffer);
VkResult resetCommandBuffer(DeviceValidation &, VkCommandBuffer, VkCommandBufferResetFlags);
void cmdBindPipeline(DeviceValidation &, VkCommandBuffer, VkPipelineBindPoint, VkPipeline);
void cmdBindShaders(DeviceValidation &, VkCommandBuffer, uint32_t, const VkShaderStageFlagBits *, const VkShaderEXT *);
void cmdPushConstants(DeviceValidation &, VkCommandBuffer, VkPipelineLayout, VkShaderStageFlags, uint32_t, uint32_t,
                      const void *);
void cmdPushConstants2(DeviceValidation &, VkCommandBuffer, const VkPushConstantsInfoKHR *);
void cmdExecuteCommands(DeviceValidation &, VkCommandBuffer, uint32_t, const VkCommandBuffer *);
void cmdBeginConditionalRendering(DeviceValidation &, VkCommandBuffer, const VkConditionalRenderingBeginInfoEXT *);
void cmdEndConditionalRendering(DeviceValidation &, VkCommandBuffer);
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
void cmdPipelineBarrier2(DeviceValidation &, VkCommandBuffer, const VkDependencyInfo *);
void cmdSetEvent2(DeviceValidation &, VkCommandBuffer, VkEvent, const VkDependencyInfo *);
void cmdWaitEvents2(DeviceValidation &, VkCommandBuffer, uint32_t, const VkEvent *, const VkDependencyInfo *);
void cmdResetEvent2(DeviceValidation &, VkCommandBuffer, VkEvent, VkPipelineStageFlags2);
void cmdWriteTimestamp2(DeviceValidation &, VkCommandBuffer, VkPipelineStageFlags2, VkQueryPool, uint32_t);
void cmdWriteBufferMarker2(DeviceValidation &, VkCommandBuffer, VkPipelineStageFlags2, VkBuffer, VkDeviceSize,
                           uint32_t);
// -- submissions.cpp
VkResult queueSubmit(DeviceValidation &, VkQueue, uint32_t, const VkSubmitInfo *, VkFence);
VkResult queueSubmit2(DeviceValidation &, VkQueue, uint32_t, const VkSubmitInfo2 *, VkFence);
VkResult queueBindSparse(DeviceValidation &, VkQueue, uint32_t, const VkBindSparseInfo *, VkFence);
VkResult queuePresent(DeviceValidation &, VkQueue, const VkPresentInfoKHR *);
VkResult queueWaitIdle(DeviceValidation &, VkQueue);
VkResult deviceWaitIdle(DeviceValidation &, VkDevice);
VkResult waitForFences(DeviceValidation &, VkDevice, uint32_t, const VkFence *, VkBool32, uint64_t);
VkResult getFenceStatus(DeviceValidation &, VkDevice, VkFence);
VkResult waitSemaphores(DeviceValidation &, VkDevice, const VkSemaphoreWaitInfo *, uint64_t);
VkResult getSemaphoreCounterValue(DeviceValidation &, VkDevice, VkSemaphore, uint64_t *);
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

// -- builds.cpp
void getMicromapBuildSizes(DeviceValidation &, VkDevice, VkAccelerationStructureBuildTypeKHR,
                           const VkMicromapBuildInfoEXT *, VkMicromapBuildSizesInfoEXT *);
void getAccelerationStructureBuildSizes(DeviceValidation &, VkDevice, VkAccelerationStructureBuildTypeKHR,
                                        const VkAccelerationStructureBuildGeometryInfoKHR *, const uint32_t *,
                                        VkAccelerationStructureBuildSizesInfoKHR *);
void cmdBuildMicromaps(DeviceValidation &, VkCommandBuffer, uint32_t, const VkMicromapBuildInfoEXT *);
void cmdBuildAccelerationStructures(DeviceValidation &, VkCommandBuffer, uint32_t,
                                    const VkAccelerationStructureBuildGeometryInfoKHR *,
                                    const VkAccelerationStructureBuildRangeInfoKHR *const *);
void cmdBuildAccelerationStructuresIndirect(DeviceValidation &, VkCommandBuffer, uint32_t,
                                            const VkAccelerationStructureBuildGeometryInfoKHR *,
                                            const VkDeviceAddress *, const uint32_t *, const uint32_t *const *);

// -- copies.cpp
void cmdCopyMicromap(DeviceValidation &, VkCommandBuffer, const VkCopyMicromapInfoEXT *);
void cmdCopyMicromapToMemory(DeviceValidation &, VkCommandBuffer, const VkCopyMicromapToMemoryInfoEXT *);
void cmdCopyMemoryToMicromap(DeviceValidation &, VkCommandBuffer, const VkCopyMemoryToMicromapInfoEXT *);
void cmdCopyAccelerationStructure(DeviceValidation &, VkCommandBuffer, const VkCopyAccelerationStructureInfoKHR *);
void cmdCopyAccelerationStructureToMemory(DeviceValidation &, VkCommandBuffer,
                                          const VkCopyAccelerationStructureToMemoryInfoKHR *);
void cmdCopyMemoryToAccelerationStructure(DeviceValidation &, VkCommandBuffer,
                                          const VkCopyMemoryToAccelerationStructureInfoKHR *);

// -- queries.cpp
VkResult createQueryPool(DeviceValidation &, VkDevice, const VkQueryPoolCreateInfo *, const VkAllocationCallbacks *,
                         VkQueryPool *);
void destroyQueryPool(DeviceValidation &, VkDevice, VkQueryPool, const VkAllocationCallbacks *);
void resetQueryPool(DeviceValidation &, VkDevice, VkQueryPool, uint32_t, uint32_t);
void cmdResetQueryPool(DeviceValidation &, VkCommandBuffer, VkQueryPool, uint32_t, uint32_t);
void cmdCopyQueryPoolResults(DeviceValidation &, VkCommandBuffer, VkQueryPool, uint32_t, uint32_t, VkBuffer,
                             VkDeviceSize, VkDeviceSize, VkQueryResultFlags);
void cmdBeginQuery(DeviceValidation &, VkCommandBuffer, VkQueryPool, uint32_t, VkQueryControlFlags);
void cmdBeginQueryIndexed(DeviceValidation &, VkCommandBuffer, VkQueryPool, uint32_t, VkQueryControlFlags, uint32_t);
void cmdWriteMicromapsProperties(DeviceValidation &, VkCommandBuffer, uint32_t, const VkMicromapEXT *, VkQueryType,
                                 VkQueryPool, uint32_t);
void cmdWriteAccelerationStructuresProperties(DeviceValidation &, VkCommandBuffer, uint32_t,
                                              const VkAccelerationStructureKHR *, VkQueryType, VkQueryPool, uint32_t);

// -- host.cpp
VkResult buildAccelerationStructures(DeviceValidation &, VkDevice, VkDeferredOperationKHR, uint32_t,
                                     const VkAccelerationStructureBuildGeometryInfoKHR *,
                                     const VkAccelerationStructureBuildRangeInfoKHR *const *);
VkResult buildMicromaps(DeviceValidation &, VkDevice, VkDeferredOperationKHR, uint32_t, const VkMicromapBuildInfoEXT *);
VkResult copyMicromap(DeviceValidation &, VkDevice, VkDeferredOperationKHR, const VkCopyMicromapInfoEXT *);
VkResult copyMicromapToMemory(DeviceValidation &, VkDevice, VkDeferredOperationKHR,
                              const VkCopyMicromapToMemoryInfoEXT *);
VkResult copyMemoryToMicromap(DeviceValidation &, VkDevice, VkDeferredOperationKHR,
                              const VkCopyMemoryToMicromapInfoEXT *);
VkResult writeMicromapsProperties(DeviceValidation &, VkDevice, uint32_t, const VkMicromapEXT *, VkQueryType, size_t,
                                  void *, size_t);
void getDeviceMicromapCompatibility(DeviceValidation &, VkDevice, const VkMicromapVersionInfoEXT *,
                                    VkAccelerationStructureCompatibilityKHR *);
VkResult copyAccelerationStructure(DeviceValidation &, VkDevice, VkDeferredOperationKHR,
                                   const VkCopyAccelerationStructureInfoKHR *);
VkResult copyMemoryToAccelerationStructure(DeviceValidation &, VkDevice, VkDeferredOperationKHR,
                                           const VkCopyMemoryToAccelerationStructureInfoKHR *);
VkResult writeAccelerationStructuresProperties(DeviceValidation &, VkDevice, uint32_t,
                                               const VkAccelerationStructureKHR *, VkQueryType, size_t, void *, size_t);

// -- memory_commands.cpp
void cmdCopyBuffer(DeviceValidation &, VkCommandBuffer, VkBuffer, VkBuffer, uint32_t, const VkBufferCopy *);
void cmdCopyBuffer2(DeviceValidation &, VkCommandBuffer, const VkCopyBufferInfo2 *);
void cmdFillBuffer(DeviceValidation &, VkCommandBuffer, VkBuffer, VkDeviceSize, VkDeviceSize, uint32_t);
void cmdUpdateBuffer(DeviceValidation &, VkCommandBuffer, VkBuffer, VkDeviceSize, VkDeviceSize, const void *);
void cmdCopyMemory(DeviceValidation &, VkCommandBuffer, const VkCopyDeviceMemoryInfoKHR *);
void cmdUpdateMemory(DeviceValidation &, VkCommandBuffer, const VkDeviceAddressRangeKHR *, VkAddressCommandFlagsKHR,
                     VkDeviceSize, const void *);
void cmdFillMemory(DeviceValidation &, VkCommandBuffer, const VkDeviceAddressRangeKHR *, VkAddressCommandFlagsKHR,
                   uint32_t);
void cmdCopyQueryPoolResultsToMemory(DeviceValidation &, VkCommandBuffer, VkQueryPool, uint32_t, uint32_t,
                                     const VkStridedDeviceAddressRangeKHR *, VkAddressCommandFlagsKHR,
                                     VkQueryResultFlags);
void cmdWriteMarkerToMemory(DeviceValidation &, VkCommandBuffer, const VkMemoryMarkerInfoAMD *);
void cmdCopyMemoryToImage(DeviceValidation &, VkCommandBuffer, const VkCopyDeviceMemoryImageInfoKHR *);
void cmdCopyImageToMemory(DeviceValidation &, VkCommandBuffer, const VkCopyDeviceMemoryImageInfoKHR *);
void cmdBindIndexBuffer3(DeviceValidation &, VkCommandBuffer, const VkBindIndexBuffer3InfoKHR *);
void cmdBindVertexBuffers3(DeviceValidation &, VkCommandBuffer, uint32_t, uint32_t, const VkBindVertexBuffer3InfoKHR *);
void cmdDrawIndirect2(DeviceValidation &, VkCommandBuffer, const VkDrawIndirect2InfoKHR *);
void cmdDrawIndexedIndirect2(DeviceValidation &, VkCommandBuffer, const VkDrawIndirect2InfoKHR *);
void cmdDrawMeshTasksIndirect2(DeviceValidation &, VkCommandBuffer, const VkDrawIndirect2InfoKHR *);
void cmdDrawIndirectCount2(DeviceValidation &, VkCommandBuffer, const VkDrawIndirectCount2InfoKHR *);
void cmdDrawIndexedIndirectCount2(DeviceValidation &, VkCommandBuffer, const VkDrawIndirectCount2InfoKHR *);
void cmdDrawMeshTasksIndirectCount2(DeviceValidation &, VkCommandBuffer, const VkDrawIndirectCount2InfoKHR *);
void cmdDispatchIndirect2(DeviceValidation &, VkCommandBuffer, const VkDispatchIndirect2InfoKHR *);
void cmdBeginConditionalRendering2(DeviceValidation &, VkCommandBuffer, const VkConditionalRenderingBeginInfo2EXT *);
void cmdBindTransformFeedbackBuffers2(DeviceValidation &, VkCommandBuffer, uint32_t, uint32_t,
                                      const VkBindTransformFeedbackBuffer2InfoEXT *);
void cmdBeginTransformFeedback2(DeviceValidation &, VkCommandBuffer, uint32_t, uint32_t,
                                const VkBindTransformFeedbackBuffer2InfoEXT *);
void cmdEndTransformFeedback2(DeviceValidation &, VkCommandBuffer, uint32_t, uint32_t,
                              const VkBindTransformFeedbackBuffer2InfoEXT *);
void cmdDrawIndirectByteCount2(DeviceValidation &, VkCommandBuffer, uint32_t, uint32_t,
                               const VkBindTransformFeedbackBuffer2InfoEXT *, uint32_t, uint32_t);

// -- descriptors.cpp
VkResult createDescriptorSetLayout(DeviceValidation &, VkDevice, const VkDescriptorSetLayoutCreateInfo *,
                                   const VkAllocationCallbacks *, VkDescriptorSetLayout *);
void destroyDescriptorSetLayout(DeviceValidation &, VkDevice, VkDescriptorSetLayout, const VkAllocationCallbacks *);
void destroyDescriptorPool(DeviceValidation &, VkDevice, VkDescriptorPool, const VkAllocationCallbacks *);
VkResult resetDescriptorPool(DeviceValidation &, VkDevice, VkDescriptorPool, VkDescriptorPoolResetFlags);
VkResult allocateDescriptorSets(DeviceValidation &, VkDevice, const VkDescriptorSetAllocateInfo *, VkDescriptorSet *);
VkResult freeDescriptorSets(DeviceValidation &, VkDevice, VkDescriptorPool, uint32_t, const VkDescriptorSet *);
void updateDescriptorSets(DeviceValidation &, VkDevice, uint32_t, const VkWriteDescriptorSet *, uint32_t,
                          const VkCopyDescriptorSet *);
VkResult createDescriptorUpdateTemplate(DeviceValidation &, VkDevice, const VkDescriptorUpdateTemplateCreateInfo *,
                                        const VkAllocationCallbacks *, VkDescriptorUpdateTemplate *);
void destroyDescriptorUpdateTemplate(DeviceValidation &, VkDevice, VkDescriptorUpdateTemplate,
                                     const VkAllocationCallbacks *);
void updateDescriptorSetWithTemplate(DeviceValidation &, VkDevice, VkDescriptorSet, VkDescriptorUpdateTemplate,
                                     const void *);
void cmdBindDescriptorSets(DeviceValidation &, VkCommandBuffer, VkPipelineBindPoint, VkPipelineLayout, uint32_t,
                           uint32_t, const VkDescriptorSet *, uint32_t, const uint32_t *);
void cmdBindDescriptorSets2(DeviceValidation &, VkCommandBuffer, const VkBindDescriptorSetsInfoKHR *);
void cmdPushDescriptorSet(DeviceValidation &, VkCommandBuffer, VkPipelineBindPoint, VkPipelineLayout, uint32_t,
                          uint32_t, const VkWriteDescriptorSet *);
void cmdPushDescriptorSet2(DeviceValidation &, VkCommandBuffer, const VkPushDescriptorSetInfoKHR *);
void cmdPushDescriptorSetWithTemplate(DeviceValidation &, VkCommandBuffer, VkDescriptorUpdateTemplate, VkPipelineLayout,
                                      uint32_t, const void *);
void cmdPushDescriptorSetWithTemplate2(DeviceValidation &, VkCommandBuffer,
                                       const VkPushDescriptorSetWithTemplateInfoKHR *);

// -- pipelines.cpp
VkResult createShaderModule(DeviceValidation &, VkDevice, const VkShaderModuleCreateInfo *,
                            const VkAllocationCallbacks *, VkShaderModule *);
void destroyShaderModule(DeviceValidation &, VkDevice, VkShaderModule, const VkAllocationCallbacks *);
VkResult createComputePipelines(DeviceValidation &, VkDevice, VkPipelineCache, uint32_t,
                                const VkComputePipelineCreateInfo *, const VkAllocationCallbacks *, VkPipeline *);
VkResult createGraphicsPipelines(DeviceValidation &, VkDevice, VkPipelineCache, uint32_t,
                                 const VkGraphicsPipelineCreateInfo *, const VkAllocationCallbacks *, VkPipeline *);
VkResult createRayTracingPipelines(DeviceValidation &, VkDevice, VkDeferredOperationKHR, VkPipelineCache, uint32_t,
                                   const VkRayTracingPipelineCreateInfoKHR *, const VkAllocationCallbacks *,
                                   VkPipeline *);
void destroyPipeline(DeviceValidation &, VkDevice, VkPipeline, const VkAllocationCallbacks *);
VkResult createShaders(DeviceValidation &, VkDevice, uint32_t, const VkShaderCreateInfoEXT *,
                       const VkAllocationCallbacks *, VkShaderEXT *);
VkResult getShaderBinaryData(DeviceValidation &, VkDevice, VkShaderEXT, size_t *, void *);
void destroyShader(DeviceValidation &, VkDevice, VkShaderEXT, const VkAllocationCallbacks *);

// -- Commands that run shaders.
#define VELLUM_TRACED(bindPoint, command, scope, implementation, function)                                             \
    inline constexpr TracingCommand k##command{"vk" #command, VK_PIPELINE_BIND_POINT_##bindPoint};                     \
    inline constexpr auto function = &Traced<&DeviceTable::command>::call<k##command>;
#define VELLUM_DRAW(...) VELLUM_TRACED(GRAPHICS, __VA_ARGS__)
#define VELLUM_DISPATCH(...) VELLUM_TRACED(COMPUTE, __VA_ARGS__)
#define VELLUM_TRACE(...) VELLUM_TRACED(RAY_TRACING_KHR, __VA_ARGS__)
#define VELLUM_SUBPASS_SHADING(...) VELLUM_TRACED(SUBPASS_SHADING_HUAWEI, __VA_ARGS__)
#include "layer/base/commands.inc"
#undef VELLUM_TRACED

// They run what is bound, except with a set of pipelines or shader objects, of which the device chooses.
void cmdExecuteGeneratedCommandsNV(DeviceValidation &, VkCommandBuffer, VkBool32, const VkGeneratedCommandsInfoNV *);
void cmdExecuteGeneratedCommandsEXT(DeviceValidation &, VkCommandBuffer, VkBool32, const VkGeneratedCommandsInfoEXT *);

} // namespace validation
} // namespace vellum::layer
