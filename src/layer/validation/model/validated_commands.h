// SPDX-License-Identifier: Apache-2.0
// The commands that validation intercepts, and the functions that they lead to: those of the implementation of
// micromaps below, the layer's or the driver's.
#pragma once

#include <vulkan/vulkan.h>

#include "layer/base/dispatch.h"
#include "layer/base/vulkan_newer.h"
#include "layer/base/vulkan_vendors.h"

// Commands that run shaders of one bind point: X(name of the command without vk, function of namespace validation).
#define VELLUM_DRAW_COMMANDS(X)                                                                                        \
    X(CmdDraw, cmdDraw)                                                                                                \
    X(CmdDrawIndexed, cmdDrawIndexed)                                                                                  \
    X(CmdDrawIndirect, cmdDrawIndirect)                                                                                \
    X(CmdDrawIndexedIndirect, cmdDrawIndexedIndirect)                                                                  \
    X(CmdDrawIndirectCount, cmdDrawIndirectCount)                                                                      \
    X(CmdDrawIndexedIndirectCount, cmdDrawIndexedIndirectCount)                                                        \
    X(CmdDrawIndirectByteCountEXT, cmdDrawIndirectByteCountEXT)                                                        \
    X(CmdDrawMultiEXT, cmdDrawMultiEXT)                                                                                \
    X(CmdDrawMultiIndexedEXT, cmdDrawMultiIndexedEXT)                                                                  \
    X(CmdDrawMeshTasksEXT, cmdDrawMeshTasksEXT)                                                                        \
    X(CmdDrawMeshTasksIndirectEXT, cmdDrawMeshTasksIndirectEXT)                                                        \
    X(CmdDrawMeshTasksIndirectCountEXT, cmdDrawMeshTasksIndirectCountEXT)                                              \
    X(CmdDrawMeshTasksNV, cmdDrawMeshTasksNV)                                                                          \
    X(CmdDrawMeshTasksIndirectNV, cmdDrawMeshTasksIndirectNV)                                                          \
    X(CmdDrawMeshTasksIndirectCountNV, cmdDrawMeshTasksIndirectCountNV)
#define VELLUM_DISPATCH_COMMANDS(X)                                                                                    \
    X(CmdDispatch, cmdDispatch)                                                                                        \
    X(CmdDispatchBase, cmdDispatchBase)                                                                                \
    X(CmdDispatchIndirect, cmdDispatchIndirect)
#define VELLUM_TRACE_COMMANDS(X)                                                                                       \
    X(CmdTraceRaysKHR, cmdTraceRaysKHR)                                                                                \
    X(CmdTraceRaysNV, cmdTraceRaysNV)                                                                                  \
    X(CmdTraceRaysIndirectKHR, cmdTraceRaysIndirectKHR)                                                                \
    X(CmdTraceRaysIndirect2KHR, cmdTraceRaysIndirect2KHR)

// Of commands that the oldest headers do not declare: X(name, type in base/vulkan_newer.h, function).
#define VELLUM_NEWER_DISPATCH_COMMANDS(X) X(CmdDispatchTileQCOM, CmdDispatchTile, cmdDispatchTile)

// X(name of the command without vk, function of namespace validation that validates it). A command is also found by its
// aliases.
#define VELLUM_VALIDATED_COMMANDS(X)                                                                                   \
    X(GetDeviceQueue, getDeviceQueue)                                                                                  \
    X(GetDeviceQueue2, getDeviceQueue2)                                                                                \
    X(AllocateMemory, allocateMemory)                                                                                  \
    X(FreeMemory, freeMemory)                                                                                          \
    X(CreateBuffer, createBuffer)                                                                                      \
    X(DestroyBuffer, destroyBuffer)                                                                                    \
    X(BindBufferMemory, bindBufferMemory)                                                                              \
    X(BindBufferMemory2, bindBufferMemory2)                                                                            \
    X(GetBufferDeviceAddress, getBufferDeviceAddress)                                                                  \
    X(CreateAccelerationStructureKHR, createAccelerationStructure)                                                     \
    X(CreateAccelerationStructure2KHR, createAccelerationStructure2)                                                   \
    X(DestroyAccelerationStructureKHR, destroyAccelerationStructure)                                                   \
    X(GetAccelerationStructureDeviceAddressKHR, getAccelerationStructureDeviceAddress)                                 \
    X(CreateMicromapEXT, createMicromap)                                                                               \
    X(DestroyMicromapEXT, destroyMicromap)                                                                             \
    X(CreateCommandPool, createCommandPool)                                                                            \
    X(DestroyCommandPool, destroyCommandPool)                                                                          \
    X(ResetCommandPool, resetCommandPool)                                                                              \
    X(AllocateCommandBuffers, allocateCommandBuffers)                                                                  \
    X(FreeCommandBuffers, freeCommandBuffers)                                                                          \
    X(BeginCommandBuffer, beginCommandBuffer)                                                                          \
    X(EndCommandBuffer, endCommandBuffer)                                                                              \
    X(ResetCommandBuffer, resetCommandBuffer)                                                                          \
    X(CmdBindPipeline, cmdBindPipeline)                                                                                \
    X(CmdPushConstants, cmdPushConstants)                                                                              \
    X(CmdExecuteCommands, cmdExecuteCommands)                                                                          \
    X(CmdBeginConditionalRenderingEXT, cmdBeginConditionalRendering)                                                   \
    X(CmdEndConditionalRenderingEXT, cmdEndConditionalRendering)                                                       \
    X(QueueWaitIdle, queueWaitIdle)                                                                                    \
    X(DeviceWaitIdle, deviceWaitIdle)                                                                                  \
    X(WaitForFences, waitForFences)                                                                                    \
    X(GetFenceStatus, getFenceStatus)                                                                                  \
    X(WaitSemaphores, waitSemaphores)                                                                                  \
    X(GetSemaphoreCounterValue, getSemaphoreCounterValue)                                                              \
    X(QueueSubmit, queueSubmit)                                                                                        \
    X(QueueSubmit2, queueSubmit2)                                                                                      \
    X(GetMicromapBuildSizesEXT, getMicromapBuildSizes)                                                                 \
    X(GetAccelerationStructureBuildSizesKHR, getAccelerationStructureBuildSizes)                                       \
    X(CmdPipelineBarrier, cmdPipelineBarrier)                                                                          \
    X(CmdPipelineBarrier2, cmdPipelineBarrier2)                                                                        \
    X(CmdBeginRenderPass, cmdBeginRenderPass)                                                                          \
    X(CmdBeginRenderPass2, cmdBeginRenderPass2)                                                                        \
    X(CmdEndRenderPass, cmdEndRenderPass)                                                                              \
    X(CmdBeginRendering, cmdBeginRendering)                                                                            \
    X(CmdEndRendering, cmdEndRendering)                                                                                \
    X(CmdEndRenderPass2, cmdEndRenderPass2)                                                                            \
    X(CmdSetEvent, cmdSetEvent)                                                                                        \
    X(CmdSetEvent2, cmdSetEvent2)                                                                                      \
    X(CmdResetEvent, cmdResetEvent)                                                                                    \
    X(CmdResetEvent2, cmdResetEvent2)                                                                                  \
    X(CmdWaitEvents, cmdWaitEvents)                                                                                    \
    X(CmdWaitEvents2, cmdWaitEvents2)                                                                                  \
    X(CmdWriteTimestamp2, cmdWriteTimestamp2)                                                                          \
    X(CmdWriteBufferMarker2AMD, cmdWriteBufferMarker2)                                                                 \
    X(CmdCopyBuffer, cmdCopyBuffer)                                                                                    \
    X(CmdCopyBuffer2, cmdCopyBuffer2)                                                                                  \
    X(CmdFillBuffer, cmdFillBuffer)                                                                                    \
    X(CmdUpdateBuffer, cmdUpdateBuffer)                                                                                \
    X(ResetFences, resetFences)                                                                                        \
    X(DestroyFence, destroyFence)                                                                                      \
    X(CreateSemaphore, createSemaphore)                                                                                \
    X(DestroySemaphore, destroySemaphore)                                                                              \
    X(SignalSemaphore, signalSemaphore)                                                                                \
    X(GetQueryPoolResults, getQueryPoolResults)                                                                        \
    X(GetEventStatus, getEventStatus)                                                                                  \
    X(SetEvent, setEvent)                                                                                              \
    X(ResetEvent, resetEvent)                                                                                          \
    X(DestroyEvent, destroyEvent)                                                                                      \
    X(CmdCopyMicromapEXT, cmdCopyMicromap)                                                                             \
    X(CmdCopyMicromapToMemoryEXT, cmdCopyMicromapToMemory)                                                             \
    X(CmdCopyMemoryToMicromapEXT, cmdCopyMemoryToMicromap)                                                             \
    X(CmdCopyAccelerationStructureKHR, cmdCopyAccelerationStructure)                                                   \
    X(CmdCopyAccelerationStructureToMemoryKHR, cmdCopyAccelerationStructureToMemory)                                   \
    X(CmdCopyMemoryToAccelerationStructureKHR, cmdCopyMemoryToAccelerationStructure)                                   \
    X(CreateQueryPool, createQueryPool)                                                                                \
    X(DestroyQueryPool, destroyQueryPool)                                                                              \
    X(ResetQueryPool, resetQueryPool)                                                                                  \
    X(CmdResetQueryPool, cmdResetQueryPool)                                                                            \
    X(CmdBeginQuery, cmdBeginQuery)                                                                                    \
    X(CmdBeginQueryIndexedEXT, cmdBeginQueryIndexed)                                                                   \
    X(CmdWriteMicromapsPropertiesEXT, cmdWriteMicromapsProperties)                                                     \
    X(CmdWriteAccelerationStructuresPropertiesKHR, cmdWriteAccelerationStructuresProperties)                           \
    X(BuildAccelerationStructuresKHR, buildAccelerationStructures)                                                     \
    X(BuildMicromapsEXT, buildMicromaps)                                                                               \
    X(CopyMicromapEXT, copyMicromap)                                                                                   \
    X(CopyMicromapToMemoryEXT, copyMicromapToMemory)                                                                   \
    X(CopyMemoryToMicromapEXT, copyMemoryToMicromap)                                                                   \
    X(WriteMicromapsPropertiesEXT, writeMicromapsProperties)                                                           \
    X(CopyAccelerationStructureKHR, copyAccelerationStructure)                                                         \
    X(CopyMemoryToAccelerationStructureKHR, copyMemoryToAccelerationStructure)                                         \
    X(WriteAccelerationStructuresPropertiesKHR, writeAccelerationStructuresProperties)                                 \
    X(GetDeviceMicromapCompatibilityEXT, getDeviceMicromapCompatibility)                                               \
    X(CreateImage, createImage)                                                                                        \
    X(DestroyImage, destroyImage)                                                                                      \
    X(QueueBindSparse, queueBindSparse)                                                                                \
    X(CreateShaderModule, createShaderModule)                                                                          \
    X(DestroyShaderModule, destroyShaderModule)                                                                        \
    X(CreateComputePipelines, createComputePipelines)                                                                  \
    X(CreateGraphicsPipelines, createGraphicsPipelines)                                                                \
    X(CreateRayTracingPipelinesKHR, createRayTracingPipelines)                                                         \
    X(DestroyPipeline, destroyPipeline)                                                                                \
    X(CmdCopyMemoryKHR, cmdCopyMemory)                                                                                 \
    X(CmdUpdateMemoryKHR, cmdUpdateMemory)                                                                             \
    X(CmdFillMemoryKHR, cmdFillMemory)                                                                                 \
    X(CmdCopyMemoryToImageKHR, cmdCopyMemoryToImage)                                                                   \
    X(CmdCopyImageToMemoryKHR, cmdCopyImageToMemory)                                                                   \
    X(CmdCopyQueryPoolResultsToMemoryKHR, cmdCopyQueryPoolResultsToMemory)                                             \
    X(CmdWriteMarkerToMemoryAMD, cmdWriteMarkerToMemory)                                                               \
    X(CmdBindIndexBuffer3KHR, cmdBindIndexBuffer3)                                                                     \
    X(CmdBindVertexBuffers3KHR, cmdBindVertexBuffers3)                                                                 \
    X(CmdDrawIndirect2KHR, cmdDrawIndirect2)                                                                           \
    X(CmdDrawIndexedIndirect2KHR, cmdDrawIndexedIndirect2)                                                             \
    X(CmdDrawMeshTasksIndirect2EXT, cmdDrawMeshTasksIndirect2)                                                         \
    X(CmdDrawIndirectCount2KHR, cmdDrawIndirectCount2)                                                                 \
    X(CmdDrawIndexedIndirectCount2KHR, cmdDrawIndexedIndirectCount2)                                                   \
    X(CmdDrawMeshTasksIndirectCount2EXT, cmdDrawMeshTasksIndirectCount2)                                               \
    X(CmdDispatchIndirect2KHR, cmdDispatchIndirect2)                                                                   \
    X(CmdBeginConditionalRendering2EXT, cmdBeginConditionalRendering2)                                                 \
    X(CmdBindTransformFeedbackBuffers2EXT, cmdBindTransformFeedbackBuffers2)                                           \
    X(CmdBeginTransformFeedback2EXT, cmdBeginTransformFeedback2)                                                       \
    X(CmdEndTransformFeedback2EXT, cmdEndTransformFeedback2)                                                           \
    X(CmdDrawIndirectByteCount2EXT, cmdDrawIndirectByteCount2)                                                         \
    X(CmdBuildMicromapsEXT, cmdBuildMicromaps)                                                                         \
    X(CmdBuildAccelerationStructuresKHR, cmdBuildAccelerationStructures)                                               \
    X(CmdBuildAccelerationStructuresIndirectKHR, cmdBuildAccelerationStructuresIndirect)                               \
    X(CreateDescriptorSetLayout, createDescriptorSetLayout)                                                            \
    X(DestroyDescriptorSetLayout, destroyDescriptorSetLayout)                                                          \
    X(DestroyDescriptorPool, destroyDescriptorPool)                                                                    \
    X(ResetDescriptorPool, resetDescriptorPool)                                                                        \
    X(AllocateDescriptorSets, allocateDescriptorSets)                                                                  \
    X(FreeDescriptorSets, freeDescriptorSets)                                                                          \
    X(UpdateDescriptorSets, updateDescriptorSets)                                                                      \
    X(CreateDescriptorUpdateTemplate, createDescriptorUpdateTemplate)                                                  \
    X(DestroyDescriptorUpdateTemplate, destroyDescriptorUpdateTemplate)                                                \
    X(UpdateDescriptorSetWithTemplate, updateDescriptorSetWithTemplate)                                                \
    X(CmdBindDescriptorSets, cmdBindDescriptorSets)                                                                    \
    X(CmdPushDescriptorSetKHR, cmdPushDescriptorSet)                                                                   \
    X(CmdPushDescriptorSetWithTemplateKHR, cmdPushDescriptorSetWithTemplate)                                           \
    VELLUM_DRAW_COMMANDS(X)                                                                                            \
    VELLUM_DISPATCH_COMMANDS(X)                                                                                        \
    VELLUM_TRACE_COMMANDS(X)                                                                                           \
    X(CmdSubpassShadingHUAWEI, cmdSubpassShading)                                                                      \
    X(CmdExecuteGeneratedCommandsNV, cmdExecuteGeneratedCommandsNV)

// Those that the oldest headers do not declare: X(name, type in base/vulkan_newer.h, function).
#define VELLUM_VALIDATED_NEWER_COMMANDS(X)                                                                             \
    X(CmdPushConstants2, CmdPushConstants2, cmdPushConstants2)                                                         \
    X(CmdBindShadersEXT, CmdBindShaders, cmdBindShaders)                                                               \
    X(CmdBindDescriptorSets2, CmdBindDescriptorSets2, cmdBindDescriptorSets2)                                          \
    X(CmdPushDescriptorSet2, CmdPushDescriptorSet2, cmdPushDescriptorSet2)                                             \
    X(CmdPushDescriptorSetWithTemplate2, CmdPushDescriptorSetWithTemplate2, cmdPushDescriptorSetWithTemplate2)         \
    X(CreateShadersEXT, CreateShaders, createShaders)                                                                  \
    X(GetShaderBinaryDataEXT, GetShaderBinaryData, getShaderBinaryData)                                                \
    X(DestroyShaderEXT, DestroyShader, destroyShader)                                                                  \
    X(CmdExecuteGeneratedCommandsEXT, CmdExecuteGeneratedCommands, cmdExecuteGeneratedCommandsEXT)                     \
    X(CmdEndRendering2KHR, CmdEndRendering2, cmdEndRendering2)                                                         \
    X(CmdEndRendering2EXT, CmdEndRendering2, cmdEndRendering2)                                                         \
    VELLUM_NEWER_DISPATCH_COMMANDS(X)

namespace vellum::layer
{

struct NextCommands {
#define VELLUM_MEMBER(name, function) PFN_vk##name name = nullptr;
#define VELLUM_NEWER_MEMBER(name, type, function) newer::PFN_##type name = nullptr;
    VELLUM_VALIDATED_COMMANDS(VELLUM_MEMBER)
    VELLUM_VALIDATED_NEWER_COMMANDS(VELLUM_NEWER_MEMBER)
#undef VELLUM_MEMBER
#undef VELLUM_NEWER_MEMBER
    PFN_vkCmdCopyQueryPoolResults CmdCopyQueryPoolResults = nullptr; // validation calls it, and does not validate it

    void load(VkDevice device, PFN_vkGetDeviceProcAddr next)
    {
        const auto get = [=](const char *name) { return commandByAnyName(device, next, name); };
#define VELLUM_LOAD(name, function) name = reinterpret_cast<PFN_vk##name>(get("vk" #name));
#define VELLUM_LOAD_NEWER(name, type, function) name = reinterpret_cast<newer::PFN_##type>(get("vk" #name));
        VELLUM_VALIDATED_COMMANDS(VELLUM_LOAD)
        VELLUM_VALIDATED_NEWER_COMMANDS(VELLUM_LOAD_NEWER)
#undef VELLUM_LOAD
#undef VELLUM_LOAD_NEWER
        CmdCopyQueryPoolResults = reinterpret_cast<PFN_vkCmdCopyQueryPoolResults>(get("vkCmdCopyQueryPoolResults"));
    }
};

} // namespace vellum::layer
