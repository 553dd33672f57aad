// SPDX-License-Identifier: Apache-2.0
// Function pointers of the next layer or driver: one row per command that the layer calls.
#pragma once

#include <vulkan/vulkan.h>

#include "layer/base/vulkan_newer.h"

namespace vellum::layer
{

// X(name). Where the command is missing, its aliases in the registry are tried.
#define VELLUM_INSTANCE_COMMANDS(X)                                                                                    \
    X(DestroyInstance)                                                                                                 \
    X(EnumerateDeviceExtensionProperties)                                                                              \
    X(GetPhysicalDeviceProperties)                                                                                     \
    X(GetPhysicalDeviceMemoryProperties)                                                                               \
    X(GetPhysicalDeviceQueueFamilyProperties)                                                                          \
    X(GetPhysicalDeviceExternalBufferProperties)                                                                       \
    X(GetPhysicalDeviceFeatures2)                                                                                      \
    X(GetPhysicalDeviceProperties2)                                                                                    \
    X(GetPhysicalDeviceToolProperties)                                                                                 \
    X(CreateDebugUtilsMessengerEXT)                                                                                    \
    X(DestroyDebugUtilsMessengerEXT)                                                                                   \
    X(SubmitDebugUtilsMessageEXT)                                                                                      \
    X(DebugReportMessageEXT)

#define VELLUM_DEVICE_COMMANDS(X)                                                                                      \
    X(DestroyDevice)                                                                                                   \
    X(GetDeviceQueue2)                                                                                                 \
    X(QueueSubmit)                                                                                                     \
    X(QueueBindSparse)                                                                                                 \
    X(QueuePresentKHR)                                                                                                 \
    X(CreateFence)                                                                                                     \
    X(DestroyFence)                                                                                                    \
    X(QueueWaitIdle)                                                                                                   \
    X(CreateCommandPool)                                                                                               \
    X(EndCommandBuffer)                                                                                                \
    X(CreateBuffer)                                                                                                    \
    X(DestroyBuffer)                                                                                                   \
    X(GetBufferMemoryRequirements)                                                                                     \
    X(GetDeviceBufferMemoryRequirements)                                                                               \
    X(AllocateMemory)                                                                                                  \
    X(GetMemoryHostPointerPropertiesEXT)                                                                               \
    X(FreeMemory)                                                                                                      \
    X(BindBufferMemory)                                                                                                \
    X(MapMemory)                                                                                                       \
    X(UnmapMemory)                                                                                                     \
    X(BindBufferMemory2)                                                                                               \
    X(FlushMappedMemoryRanges)                                                                                         \
    X(InvalidateMappedMemoryRanges)                                                                                    \
    X(GetBufferDeviceAddress)                                                                                          \
    X(GetBufferOpaqueCaptureAddress)                                                                                   \
    X(GetDeviceMemoryOpaqueCaptureAddress)                                                                             \
    X(CreateShaderModule)                                                                                              \
    X(DestroyShaderModule)                                                                                             \
    X(CreatePipelineLayout)                                                                                            \
    X(DestroyPipelineLayout)                                                                                           \
    X(CreateComputePipelines)                                                                                          \
    X(CreateGraphicsPipelines)                                                                                         \
    X(GetShaderModuleIdentifierEXT)                                                                                    \
    X(GetShaderModuleCreateInfoIdentifierEXT)                                                                          \
    X(CreateRayTracingPipelinesKHR)                                                                                    \
    X(GetRayTracingShaderGroupHandlesKHR)                                                                              \
    X(GetRayTracingCaptureReplayShaderGroupHandlesKHR)                                                                 \
    X(GetRayTracingShaderGroupStackSizeKHR)                                                                            \
    X(CmdSetRayTracingPipelineStackSizeKHR)                                                                            \
    X(CmdTraceRaysKHR)                                                                                                 \
    X(CmdTraceRaysIndirectKHR)                                                                                         \
    X(CmdTraceRaysIndirect2KHR)                                                                                        \
    X(DeferredOperationJoinKHR)                                                                                        \
    X(GetDeferredOperationResultKHR)                                                                                   \
    X(DestroyDeferredOperationKHR)                                                                                     \
    X(DestroyPipeline)                                                                                                 \
    X(CreateRenderPass2)                                                                                               \
    X(CreateAccelerationStructureKHR)                                                                                  \
    X(CreateAccelerationStructure2KHR)                                                                                 \
    X(DestroyAccelerationStructureKHR)                                                                                 \
    X(GetAccelerationStructureBuildSizesKHR)                                                                           \
    X(GetAccelerationStructureDeviceAddressKHR)                                                                        \
    X(GetAccelerationStructureOpaqueCaptureDescriptorDataEXT)                                                          \
    X(GetDeviceAccelerationStructureCompatibilityKHR)                                                                  \
    X(CmdBuildAccelerationStructuresKHR)                                                                               \
    X(CmdBuildAccelerationStructuresIndirectKHR)                                                                       \
    X(CmdCopyAccelerationStructureToMemoryKHR)                                                                         \
    X(CmdCopyAccelerationStructureKHR)                                                                                 \
    X(CmdCopyMemoryToAccelerationStructureKHR)                                                                         \
    X(BuildAccelerationStructuresKHR)                                                                                  \
    X(CopyAccelerationStructureKHR)                                                                                    \
    X(CopyAccelerationStructureToMemoryKHR)                                                                            \
    X(CopyMemoryToAccelerationStructureKHR)                                                                            \
    X(CreateMicromapEXT)                                                                                               \
    X(DestroyMicromapEXT)                                                                                              \
    X(GetMicromapBuildSizesEXT)                                                                                        \
    X(GetDeviceMicromapCompatibilityEXT)                                                                               \
    X(CmdBuildMicromapsEXT)                                                                                            \
    X(CmdCopyMicromapEXT)                                                                                              \
    X(CmdCopyMicromapToMemoryEXT)                                                                                      \
    X(CmdCopyMemoryToMicromapEXT)                                                                                      \
    X(CmdWriteMicromapsPropertiesEXT)                                                                                  \
    X(CreateQueryPool)                                                                                                 \
    X(DestroyQueryPool)                                                                                                \
    X(ResetQueryPool)                                                                                                  \
    X(GetQueryPoolResults)                                                                                             \
    X(CmdResetQueryPool)                                                                                               \
    X(CmdCopyQueryPoolResults)                                                                                         \
    X(CmdWriteAccelerationStructuresPropertiesKHR)                                                                     \
    X(WriteAccelerationStructuresPropertiesKHR)                                                                        \
    X(CmdFillBuffer)                                                                                                   \
    X(DeviceWaitIdle)                                                                                                  \
    X(WaitForFences)                                                                                                   \
    X(GetFenceStatus)                                                                                                  \
    X(WaitSemaphores)                                                                                                  \
    X(CmdBindDescriptorBuffersEXT)                                                                                     \
    X(SetPrivateData)                                                                                                  \
    X(GetPrivateData)                                                                                                  \
    X(DestroyPrivateDataSlot)                                                                                          \
    X(AllocateCommandBuffers)                                                                                          \
    X(FreeCommandBuffers)                                                                                              \
    X(ResetCommandBuffer)                                                                                              \
    X(ResetCommandPool)                                                                                                \
    X(TrimCommandPool)                                                                                                 \
    X(DestroyCommandPool)                                                                                              \
    X(BeginCommandBuffer)                                                                                              \
    X(CmdBindPipeline)                                                                                                 \
    X(CmdPushConstants)                                                                                                \
    X(CmdExecuteCommands)                                                                                              \
    X(CmdDispatch)                                                                                                     \
    X(CmdDispatchIndirect)                                                                                             \
    X(CmdPipelineBarrier)                                                                                              \
    X(CmdCopyBuffer)                                                                                                   \
    X(CmdUpdateBuffer)                                                                                                 \
    X(CmdBeginConditionalRenderingEXT)                                                                                 \
    X(CmdEndConditionalRenderingEXT)                                                                                   \
    X(CmdCopyBufferToImage2)                                                                                           \
    X(CmdCopyImageToBuffer2)                                                                                           \
    X(CmdBindIndexBuffer)                                                                                              \
    X(CmdBindVertexBuffers)                                                                                            \
    X(CmdBindVertexBuffers2)                                                                                           \
    X(CmdDrawIndirect)                                                                                                 \
    X(CmdDrawIndexedIndirect)                                                                                          \
    X(CmdDrawIndirectCount)                                                                                            \
    X(CmdDrawIndexedIndirectCount)                                                                                     \
    X(CmdDrawMeshTasksIndirectEXT)                                                                                     \
    X(CmdDrawMeshTasksIndirectCountEXT)                                                                                \
    X(CmdBindTransformFeedbackBuffersEXT)                                                                              \
    X(CmdBeginTransformFeedbackEXT)                                                                                    \
    X(CmdEndTransformFeedbackEXT)                                                                                      \
    X(CmdDrawIndirectByteCountEXT)                                                                                     \
    X(CmdPipelineBarrier2)                                                                                             \
    X(CmdSetEvent2)                                                                                                    \
    X(CmdResetEvent2)                                                                                                  \
    X(CmdWaitEvents2)                                                                                                  \
    X(CmdWriteTimestamp2)                                                                                              \
    X(CmdWriteBufferMarker2AMD)                                                                                        \
    X(CmdWriteMarkerToMemoryAMD)                                                                                       \
    X(QueueSubmit2)                                                                                                    \
    X(QueueSetPerformanceConfigurationINTEL)                                                                           \
    X(QueueBeginDebugUtilsLabelEXT)                                                                                    \
    X(QueueEndDebugUtilsLabelEXT)                                                                                      \
    X(QueueInsertDebugUtilsLabelEXT)                                                                                   \
    X(SetDebugUtilsObjectNameEXT)                                                                                      \
    X(SetDebugUtilsObjectTagEXT)                                                                                       \
    X(DebugMarkerSetObjectNameEXT)                                                                                     \
    X(DebugMarkerSetObjectTagEXT)

// Commands that the oldest headers do not declare: X(name, type in base/vulkan_newer.h).
#define VELLUM_NEWER_DEVICE_COMMANDS(X)                                                                                \
    X(CmdBindIndexBuffer2, CmdBindIndexBuffer2)                                                                        \
    X(CmdPushConstants2, CmdPushConstants2)                                                                            \
    X(MapMemory2, MapMemory2)                                                                                          \
    X(UnmapMemory2, UnmapMemory2)                                                                                      \
    X(QueueSetPerfHintQCOM, QueueSetPerfHint)                                                                          \
    X(CreateShadersEXT, CreateShaders)                                                                                 \
    X(CmdBindShadersEXT, CmdBindShaders)                                                                               \
    X(GetShaderBinaryDataEXT, GetShaderBinaryData)                                                                     \
    X(CreatePipelineBinariesKHR, CreatePipelineBinaries)                                                               \
    X(DestroyPipelineBinaryKHR, DestroyPipelineBinary)                                                                 \
    X(GetPipelineKeyKHR, GetPipelineKey)                                                                               \
    X(GetPipelineBinaryDataKHR, GetPipelineBinaryData)

// The name under which the registry describes a command: `name`, or what it is an alias of.
const char *commandOf(const char *name);
// A command of a device, by any of its names; null if the device lacks it.
PFN_vkVoidFunction commandByAnyName(VkDevice device, PFN_vkGetDeviceProcAddr next, const char *name);

struct InstanceTable {
#define VELLUM_MEMBER(name) PFN_vk##name name = nullptr;
    VELLUM_INSTANCE_COMMANDS(VELLUM_MEMBER)
    PFN_vkGetInstanceProcAddr GetInstanceProcAddr = nullptr;
    // `core`: the instance has Vulkan 1.1 or later. Others have the commands that 1.1 promoted under their aliases.
    void load(VkInstance instance, PFN_vkGetInstanceProcAddr next, bool core);
};

struct DeviceTable {
    VELLUM_DEVICE_COMMANDS(VELLUM_MEMBER)
#undef VELLUM_MEMBER
#define VELLUM_NEWER_MEMBER(name, type) newer::PFN_##type name = nullptr;
    VELLUM_NEWER_DEVICE_COMMANDS(VELLUM_NEWER_MEMBER)
#undef VELLUM_NEWER_MEMBER
    PFN_vkGetDeviceProcAddr GetDeviceProcAddr = nullptr;
    void load(VkDevice device, PFN_vkGetDeviceProcAddr next);
};

} // namespace vellum::layer
