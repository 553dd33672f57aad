// Function pointers of the next layer or driver, one row per command that the layer calls or intercepts.
#pragma once

#include <vulkan/vulkan.h>

#include "layer/base/vulkan_newer.h"

namespace vellum::layer
{

// X(name, name of an alias that may be there instead)
#define VELLUM_INSTANCE_COMMANDS(X)                                                                                    \
    X(DestroyInstance, DestroyInstance)                                                                                \
    X(EnumerateDeviceExtensionProperties, EnumerateDeviceExtensionProperties)                                          \
    X(GetPhysicalDeviceProperties, GetPhysicalDeviceProperties)                                                        \
    X(GetPhysicalDeviceMemoryProperties, GetPhysicalDeviceMemoryProperties)                                            \
    X(GetPhysicalDeviceQueueFamilyProperties, GetPhysicalDeviceQueueFamilyProperties)                                  \
    X(GetPhysicalDeviceExternalBufferProperties, GetPhysicalDeviceExternalBufferPropertiesKHR)                         \
    X(GetPhysicalDeviceFeatures2, GetPhysicalDeviceFeatures2KHR)                                                       \
    X(GetPhysicalDeviceProperties2, GetPhysicalDeviceProperties2KHR)                                                   \
    X(GetPhysicalDeviceToolProperties, GetPhysicalDeviceToolPropertiesEXT)                                             \
    X(CreateDebugUtilsMessengerEXT, CreateDebugUtilsMessengerEXT)                                                      \
    X(DestroyDebugUtilsMessengerEXT, DestroyDebugUtilsMessengerEXT)                                                    \
    X(SubmitDebugUtilsMessageEXT, SubmitDebugUtilsMessageEXT)                                                          \
    X(DebugReportMessageEXT, DebugReportMessageEXT)

#define VELLUM_DEVICE_COMMANDS(X)                                                                                      \
    X(DestroyDevice, DestroyDevice)                                                                                    \
    X(GetDeviceQueue2, GetDeviceQueue2)                                                                                \
    X(QueueSubmit, QueueSubmit)                                                                                        \
    X(QueueBindSparse, QueueBindSparse)                                                                                \
    X(QueuePresentKHR, QueuePresentKHR)                                                                                \
    X(CreateFence, CreateFence)                                                                                        \
    X(DestroyFence, DestroyFence)                                                                                      \
    X(QueueWaitIdle, QueueWaitIdle)                                                                                    \
    X(CreateCommandPool, CreateCommandPool)                                                                            \
    X(EndCommandBuffer, EndCommandBuffer)                                                                              \
    X(CreateBuffer, CreateBuffer)                                                                                      \
    X(DestroyBuffer, DestroyBuffer)                                                                                    \
    X(GetBufferMemoryRequirements, GetBufferMemoryRequirements)                                                        \
    X(GetDeviceBufferMemoryRequirements, GetDeviceBufferMemoryRequirementsKHR)                                         \
    X(AllocateMemory, AllocateMemory)                                                                                  \
    X(GetMemoryHostPointerPropertiesEXT, GetMemoryHostPointerPropertiesEXT)                                            \
    X(FreeMemory, FreeMemory)                                                                                          \
    X(BindBufferMemory, BindBufferMemory)                                                                              \
    X(MapMemory, MapMemory)                                                                                            \
    X(UnmapMemory, UnmapMemory)                                                                                        \
    X(BindBufferMemory2, BindBufferMemory2KHR)                                                                         \
    X(FlushMappedMemoryRanges, FlushMappedMemoryRanges)                                                                \
    X(InvalidateMappedMemoryRanges, InvalidateMappedMemoryRanges)                                                      \
    X(GetBufferDeviceAddress, GetBufferDeviceAddressKHR)                                                               \
    X(GetBufferOpaqueCaptureAddress, GetBufferOpaqueCaptureAddressKHR)                                                 \
    X(GetDeviceMemoryOpaqueCaptureAddress, GetDeviceMemoryOpaqueCaptureAddressKHR)                                     \
    X(CreateShaderModule, CreateShaderModule)                                                                          \
    X(DestroyShaderModule, DestroyShaderModule)                                                                        \
    X(CreatePipelineLayout, CreatePipelineLayout)                                                                      \
    X(DestroyPipelineLayout, DestroyPipelineLayout)                                                                    \
    X(CreateComputePipelines, CreateComputePipelines)                                                                  \
    X(CreateGraphicsPipelines, CreateGraphicsPipelines)                                                                \
    X(GetShaderModuleIdentifierEXT, GetShaderModuleIdentifierEXT)                                                      \
    X(GetShaderModuleCreateInfoIdentifierEXT, GetShaderModuleCreateInfoIdentifierEXT)                                  \
    X(CreateRayTracingPipelinesKHR, CreateRayTracingPipelinesKHR)                                                      \
    X(GetRayTracingShaderGroupHandlesKHR, GetRayTracingShaderGroupHandlesKHR)                                          \
    X(GetRayTracingCaptureReplayShaderGroupHandlesKHR, GetRayTracingCaptureReplayShaderGroupHandlesKHR)                \
    X(GetRayTracingShaderGroupStackSizeKHR, GetRayTracingShaderGroupStackSizeKHR)                                      \
    X(CmdSetRayTracingPipelineStackSizeKHR, CmdSetRayTracingPipelineStackSizeKHR)                                      \
    X(CmdTraceRaysKHR, CmdTraceRaysKHR)                                                                                \
    X(CmdTraceRaysIndirectKHR, CmdTraceRaysIndirectKHR)                                                                \
    X(CmdTraceRaysIndirect2KHR, CmdTraceRaysIndirect2KHR)                                                              \
    X(DeferredOperationJoinKHR, DeferredOperationJoinKHR)                                                              \
    X(GetDeferredOperationResultKHR, GetDeferredOperationResultKHR)                                                    \
    X(DestroyDeferredOperationKHR, DestroyDeferredOperationKHR)                                                        \
    X(DestroyPipeline, DestroyPipeline)                                                                                \
    X(CreateRenderPass2, CreateRenderPass2KHR)                                                                         \
    X(CreateAccelerationStructureKHR, CreateAccelerationStructureKHR)                                                  \
    X(CreateAccelerationStructure2KHR, CreateAccelerationStructure2KHR)                                                \
    X(DestroyAccelerationStructureKHR, DestroyAccelerationStructureKHR)                                                \
    X(GetAccelerationStructureBuildSizesKHR, GetAccelerationStructureBuildSizesKHR)                                    \
    X(GetAccelerationStructureDeviceAddressKHR, GetAccelerationStructureDeviceAddressKHR)                              \
    X(GetAccelerationStructureOpaqueCaptureDescriptorDataEXT, GetAccelerationStructureOpaqueCaptureDescriptorDataEXT)  \
    X(GetDeviceAccelerationStructureCompatibilityKHR, GetDeviceAccelerationStructureCompatibilityKHR)                  \
    X(CmdBuildAccelerationStructuresKHR, CmdBuildAccelerationStructuresKHR)                                            \
    X(CmdBuildAccelerationStructuresIndirectKHR, CmdBuildAccelerationStructuresIndirectKHR)                            \
    X(CmdCopyAccelerationStructureToMemoryKHR, CmdCopyAccelerationStructureToMemoryKHR)                                \
    X(CmdCopyAccelerationStructureKHR, CmdCopyAccelerationStructureKHR)                                                \
    X(CmdCopyMemoryToAccelerationStructureKHR, CmdCopyMemoryToAccelerationStructureKHR)                                \
    X(BuildAccelerationStructuresKHR, BuildAccelerationStructuresKHR)                                                  \
    X(CopyAccelerationStructureKHR, CopyAccelerationStructureKHR)                                                      \
    X(CopyAccelerationStructureToMemoryKHR, CopyAccelerationStructureToMemoryKHR)                                      \
    X(CopyMemoryToAccelerationStructureKHR, CopyMemoryToAccelerationStructureKHR)                                      \
    X(CreateMicromapEXT, CreateMicromapEXT)                                                                            \
    X(DestroyMicromapEXT, DestroyMicromapEXT)                                                                          \
    X(GetMicromapBuildSizesEXT, GetMicromapBuildSizesEXT)                                                              \
    X(GetDeviceMicromapCompatibilityEXT, GetDeviceMicromapCompatibilityEXT)                                            \
    X(CmdBuildMicromapsEXT, CmdBuildMicromapsEXT)                                                                      \
    X(CmdCopyMicromapEXT, CmdCopyMicromapEXT)                                                                          \
    X(CmdCopyMicromapToMemoryEXT, CmdCopyMicromapToMemoryEXT)                                                          \
    X(CmdCopyMemoryToMicromapEXT, CmdCopyMemoryToMicromapEXT)                                                          \
    X(CmdWriteMicromapsPropertiesEXT, CmdWriteMicromapsPropertiesEXT)                                                  \
    X(CreateQueryPool, CreateQueryPool)                                                                                \
    X(DestroyQueryPool, DestroyQueryPool)                                                                              \
    X(ResetQueryPool, ResetQueryPoolEXT)                                                                               \
    X(GetQueryPoolResults, GetQueryPoolResults)                                                                        \
    X(CmdResetQueryPool, CmdResetQueryPool)                                                                            \
    X(CmdCopyQueryPoolResults, CmdCopyQueryPoolResults)                                                                \
    X(CmdWriteAccelerationStructuresPropertiesKHR, CmdWriteAccelerationStructuresPropertiesKHR)                        \
    X(WriteAccelerationStructuresPropertiesKHR, WriteAccelerationStructuresPropertiesKHR)                              \
    X(CmdFillBuffer, CmdFillBuffer)                                                                                    \
    X(DeviceWaitIdle, DeviceWaitIdle)                                                                                  \
    X(WaitForFences, WaitForFences)                                                                                    \
    X(GetFenceStatus, GetFenceStatus)                                                                                  \
    X(WaitSemaphores, WaitSemaphoresKHR)                                                                               \
    X(CmdBindDescriptorBuffersEXT, CmdBindDescriptorBuffersEXT)                                                        \
    X(SetPrivateData, SetPrivateDataEXT)                                                                               \
    X(GetPrivateData, GetPrivateDataEXT)                                                                               \
    X(DestroyPrivateDataSlot, DestroyPrivateDataSlotEXT)                                                               \
    X(AllocateCommandBuffers, AllocateCommandBuffers)                                                                  \
    X(FreeCommandBuffers, FreeCommandBuffers)                                                                          \
    X(DestroyCommandPool, DestroyCommandPool)                                                                          \
    X(BeginCommandBuffer, BeginCommandBuffer)                                                                          \
    X(CmdBindPipeline, CmdBindPipeline)                                                                                \
    X(CmdPushConstants, CmdPushConstants)                                                                              \
    X(CmdExecuteCommands, CmdExecuteCommands)                                                                          \
    X(CmdDispatch, CmdDispatch)                                                                                        \
    X(CmdDispatchIndirect, CmdDispatchIndirect)                                                                        \
    X(CmdPipelineBarrier, CmdPipelineBarrier)                                                                          \
    X(CmdCopyBuffer, CmdCopyBuffer)                                                                                    \
    X(CmdUpdateBuffer, CmdUpdateBuffer)                                                                                \
    X(CmdBeginConditionalRenderingEXT, CmdBeginConditionalRenderingEXT)                                                \
    X(CmdEndConditionalRenderingEXT, CmdEndConditionalRenderingEXT)                                                    \
    X(CmdCopyBufferToImage2, CmdCopyBufferToImage2KHR)                                                                 \
    X(CmdCopyImageToBuffer2, CmdCopyImageToBuffer2KHR)                                                                 \
    X(CmdBindIndexBuffer, CmdBindIndexBuffer)                                                                          \
    X(CmdBindVertexBuffers, CmdBindVertexBuffers)                                                                      \
    X(CmdBindVertexBuffers2, CmdBindVertexBuffers2EXT)                                                                 \
    X(CmdDrawIndirect, CmdDrawIndirect)                                                                                \
    X(CmdDrawIndexedIndirect, CmdDrawIndexedIndirect)                                                                  \
    X(CmdDrawIndirectCount, CmdDrawIndirectCountKHR)                                                                   \
    X(CmdDrawIndexedIndirectCount, CmdDrawIndexedIndirectCountKHR)                                                     \
    X(CmdDrawMeshTasksIndirectEXT, CmdDrawMeshTasksIndirectEXT)                                                        \
    X(CmdDrawMeshTasksIndirectCountEXT, CmdDrawMeshTasksIndirectCountEXT)                                              \
    X(CmdBindTransformFeedbackBuffersEXT, CmdBindTransformFeedbackBuffersEXT)                                          \
    X(CmdBeginTransformFeedbackEXT, CmdBeginTransformFeedbackEXT)                                                      \
    X(CmdEndTransformFeedbackEXT, CmdEndTransformFeedbackEXT)                                                          \
    X(CmdDrawIndirectByteCountEXT, CmdDrawIndirectByteCountEXT)                                                        \
    X(CmdPipelineBarrier2, CmdPipelineBarrier2KHR)                                                                     \
    X(CmdSetEvent2, CmdSetEvent2KHR)                                                                                   \
    X(CmdResetEvent2, CmdResetEvent2KHR)                                                                               \
    X(CmdWaitEvents2, CmdWaitEvents2KHR)                                                                               \
    X(CmdWriteTimestamp2, CmdWriteTimestamp2KHR)                                                                       \
    X(CmdWriteBufferMarker2AMD, CmdWriteBufferMarker2AMD)                                                              \
    X(QueueSubmit2, QueueSubmit2KHR)                                                                                   \
    X(QueueBeginDebugUtilsLabelEXT, QueueBeginDebugUtilsLabelEXT)                                                      \
    X(QueueEndDebugUtilsLabelEXT, QueueEndDebugUtilsLabelEXT)                                                          \
    X(QueueInsertDebugUtilsLabelEXT, QueueInsertDebugUtilsLabelEXT)                                                    \
    X(SetDebugUtilsObjectNameEXT, SetDebugUtilsObjectNameEXT)                                                          \
    X(SetDebugUtilsObjectTagEXT, SetDebugUtilsObjectTagEXT)                                                            \
    X(DebugMarkerSetObjectNameEXT, DebugMarkerSetObjectNameEXT)                                                        \
    X(DebugMarkerSetObjectTagEXT, DebugMarkerSetObjectTagEXT)

struct InstanceTable {
#define VELLUM_MEMBER(name, alias) PFN_vk##name name = nullptr;
    VELLUM_INSTANCE_COMMANDS(VELLUM_MEMBER)
    PFN_vkGetInstanceProcAddr GetInstanceProcAddr = nullptr;
    // `core`: the instance is one of Vulkan 1.1 or later. In others, commands that 1.1 has taken over are those of
    // their extensions.
    void load(VkInstance instance, PFN_vkGetInstanceProcAddr next, bool core);
};

struct DeviceTable {
    VELLUM_DEVICE_COMMANDS(VELLUM_MEMBER)
#undef VELLUM_MEMBER
    // Commands that the oldest headers do not declare.
    newer::PFN_CmdBindIndexBuffer2 CmdBindIndexBuffer2 = nullptr;
    newer::PFN_CmdPushConstants2 CmdPushConstants2 = nullptr;
    newer::PFN_MapMemory2 MapMemory2 = nullptr;
    newer::PFN_UnmapMemory2 UnmapMemory2 = nullptr;
    newer::PFN_CreateShaders CreateShadersEXT = nullptr;
    newer::PFN_CmdBindShaders CmdBindShadersEXT = nullptr;
    newer::PFN_GetShaderBinaryData GetShaderBinaryDataEXT = nullptr;
    newer::PFN_CreatePipelineBinaries CreatePipelineBinariesKHR = nullptr;
    newer::PFN_DestroyPipelineBinary DestroyPipelineBinaryKHR = nullptr;
    newer::PFN_GetPipelineKey GetPipelineKeyKHR = nullptr;
    newer::PFN_GetPipelineBinaryData GetPipelineBinaryDataKHR = nullptr;
    PFN_vkGetDeviceProcAddr GetDeviceProcAddr = nullptr;
    void load(VkDevice device, PFN_vkGetDeviceProcAddr next);
};

} // namespace vellum::layer
