// SPDX-License-Identifier: Apache-2.0
// One table row per intercepted command.
#include "layer/entry/commands.h"

#include <algorithm>
#include <cstring>
#include <iterator>

#include "layer/command_buffer/synchronization.h"
#include "layer/entry/command.h"
#include "layer/entry/debug_messages.h"
#include "layer/entry/validated_commands.h"
#include "layer/memory/buffers.h"
#include "layer/micromaps/micromap.h"
#include "layer/micromaps/micromap_build.h"
#include "layer/micromaps/micromap_copy.h"
#include "layer/micromaps/micromap_host.h"
#include "layer/pipelines/hit_records.h"
#include "layer/pipelines/pipeline_binaries.h"
#include "layer/pipelines/shader_binary.h"
#include "layer/pipelines/shaders.h"
#include "layer/state/object_names.h"
#include "layer/structures/structure_commands.h"

namespace vellum::layer
{
namespace
{

// The instances or devices on which the layer intercepts a command.
enum class Scope {
    Global,         // before there is an instance
    Instance,       // if the next layer has the command
    Device,         // every device
    Debug,          // every device, if the next layer has it; loaders call it through the chain of the instance
    Emulated,       // emulated devices, if the next layer has it
    Provided,       // emulated and translated devices, if the next layer has it
    Shaders,        // these, devices of Mode::Identifiers, and those on which assume_micromaps counts
    Ext,            // emulated devices with VK_EXT_opacity_micromap
    Address,        // devices with the layer's VK_KHR_device_address_commands
    AddressEnabled, // emulated and translated devices with VK_KHR_device_address_commands, whoever implements it
};

// One intercepted command. It is also found by its aliases (commandOf).
struct Row {
    const char *command;
    Scope scope;
    PFN_vkVoidFunction function;
    const char *required = nullptr; // the command is there only if the driver has this one
};

template <auto function>
Row row(const char *name, Scope scope, const char *required = nullptr)
{
    return {commandOf(name), scope, reinterpret_cast<PFN_vkVoidFunction>(&Command<function>::call), required};
}

const Row kRows[] = {
    row<getInstanceProcAddr>("vkGetInstanceProcAddr", Scope::Global),
    row<createInstance>("vkCreateInstance", Scope::Global),
    row<enumerateInstanceLayerProperties>("vkEnumerateInstanceLayerProperties", Scope::Global),
    row<enumerateInstanceExtensionProperties>("vkEnumerateInstanceExtensionProperties", Scope::Global),
    row<destroyInstance>("vkDestroyInstance", Scope::Instance),
    row<createDevice>("vkCreateDevice", Scope::Instance),
    row<enumerateDeviceExtensionProperties>("vkEnumerateDeviceExtensionProperties", Scope::Instance),
    row<getPhysicalDeviceFeatures2>("vkGetPhysicalDeviceFeatures2", Scope::Instance),
    row<getPhysicalDeviceProperties2>("vkGetPhysicalDeviceProperties2", Scope::Instance),
    row<getPhysicalDeviceToolProperties>("vkGetPhysicalDeviceToolProperties", Scope::Instance),
    row<getPhysicalDeviceExternalBufferProperties>("vkGetPhysicalDeviceExternalBufferProperties", Scope::Instance),
    row<createDebugUtilsMessenger>("vkCreateDebugUtilsMessengerEXT", Scope::Instance),
    row<destroyDebugUtilsMessenger>("vkDestroyDebugUtilsMessengerEXT", Scope::Instance),
    row<submitDebugUtilsMessage>("vkSubmitDebugUtilsMessageEXT", Scope::Instance),
    row<debugReportMessage>("vkDebugReportMessageEXT", Scope::Instance),

    row<getDeviceProcAddr>("vkGetDeviceProcAddr", Scope::Device),
    row<destroyDevice>("vkDestroyDevice", Scope::Device),

    row<createBuffer>("vkCreateBuffer", Scope::Provided),
    row<destroyBuffer>("vkDestroyBuffer", Scope::Provided),
    row<getDeviceBufferMemoryRequirements>("vkGetDeviceBufferMemoryRequirements", Scope::Provided),
    row<allocateMemory>("vkAllocateMemory", Scope::Emulated),
    row<freeMemory>("vkFreeMemory", Scope::Provided),
    row<bindBufferMemory>("vkBindBufferMemory", Scope::Provided),
    row<bindBufferMemory2>("vkBindBufferMemory2", Scope::Provided),
    row<mapMemory>("vkMapMemory", Scope::Emulated),
    row<unmapMemory>("vkUnmapMemory", Scope::Emulated),
    row<mapMemory2>("vkMapMemory2", Scope::Emulated),
    row<unmapMemory2>("vkUnmapMemory2", Scope::Emulated),
    row<getBufferDeviceAddress>("vkGetBufferDeviceAddress", Scope::Provided),
    row<cmdBindDescriptorBuffers>("vkCmdBindDescriptorBuffersEXT", Scope::Provided),
    row<createQueryPool>("vkCreateQueryPool", Scope::Provided),
    row<destroyQueryPool>("vkDestroyQueryPool", Scope::Provided),
    row<resetQueryPool>("vkResetQueryPool", Scope::Provided),
    row<getQueryPoolResults>("vkGetQueryPoolResults", Scope::Provided),
    row<cmdResetQueryPool>("vkCmdResetQueryPool", Scope::Provided),
    row<cmdCopyQueryPoolResults>("vkCmdCopyQueryPoolResults", Scope::Provided),
    row<cmdWriteAccelerationStructuresProperties>("vkCmdWriteAccelerationStructuresPropertiesKHR", Scope::Provided),
    row<writeAccelerationStructuresProperties>("vkWriteAccelerationStructuresPropertiesKHR", Scope::Provided),
    row<queueWaitIdle>("vkQueueWaitIdle", Scope::Emulated),
    row<deviceWaitIdle>("vkDeviceWaitIdle", Scope::Emulated),
    row<queueSubmit>("vkQueueSubmit", Scope::Emulated),
    row<queueBindSparse>("vkQueueBindSparse", Scope::Emulated),
    row<queuePresent>("vkQueuePresentKHR", Scope::Emulated),
    row<queueSetPerformanceConfiguration>("vkQueueSetPerformanceConfigurationINTEL", Scope::Emulated),
    row<queueSetPerfHint>("vkQueueSetPerfHintQCOM", Scope::Emulated),
    row<setPrivateData>("vkSetPrivateData", Scope::Provided),
    row<getPrivateData>("vkGetPrivateData", Scope::Provided),
    row<destroyPrivateDataSlot>("vkDestroyPrivateDataSlot", Scope::Provided),
    row<queueBeginDebugUtilsLabel>("vkQueueBeginDebugUtilsLabelEXT", Scope::Debug),
    row<queueEndDebugUtilsLabel>("vkQueueEndDebugUtilsLabelEXT", Scope::Debug),
    row<queueInsertDebugUtilsLabel>("vkQueueInsertDebugUtilsLabelEXT", Scope::Debug),
    row<setDebugUtilsObjectName>("vkSetDebugUtilsObjectNameEXT", Scope::Debug),
    row<setDebugUtilsObjectTag>("vkSetDebugUtilsObjectTagEXT", Scope::Debug),
    row<debugMarkerSetObjectName>("vkDebugMarkerSetObjectNameEXT", Scope::Debug),
    row<debugMarkerSetObjectTag>("vkDebugMarkerSetObjectTagEXT", Scope::Debug),

    row<createShaderModule>("vkCreateShaderModule", Scope::Shaders),
    row<createComputePipelines>("vkCreateComputePipelines", Scope::Shaders),
    row<createGraphicsPipelines>("vkCreateGraphicsPipelines", Scope::Shaders),
    row<destroyShaderModule>("vkDestroyShaderModule", Scope::Shaders),
    row<getShaderModuleIdentifier>("vkGetShaderModuleIdentifierEXT", Scope::Shaders),
    row<getShaderModuleCreateInfoIdentifier>("vkGetShaderModuleCreateInfoIdentifierEXT", Scope::Shaders),
    row<createPipelineBinaries>("vkCreatePipelineBinariesKHR", Scope::Shaders),
    row<destroyPipelineBinary>("vkDestroyPipelineBinaryKHR", Scope::Emulated),
    row<getPipelineKey>("vkGetPipelineKeyKHR", Scope::Shaders),
    row<getPipelineBinaryData>("vkGetPipelineBinaryDataKHR", Scope::Emulated),
    row<createRayTracingPipelines>("vkCreateRayTracingPipelinesKHR", Scope::Shaders),
    row<destroyPipeline>("vkDestroyPipeline", Scope::Shaders),
    row<getShaderGroupHandles>("vkGetRayTracingShaderGroupHandlesKHR", Scope::Emulated),
    row<getCaptureReplayShaderGroupHandles>("vkGetRayTracingCaptureReplayShaderGroupHandlesKHR", Scope::Emulated),
    row<getShaderGroupStackSize>("vkGetRayTracingShaderGroupStackSizeKHR", Scope::Emulated),
    row<cmdSetRayTracingPipelineStackSize>("vkCmdSetRayTracingPipelineStackSizeKHR", Scope::Emulated),
    row<cmdTraceRays>("vkCmdTraceRaysKHR", Scope::Emulated),
    row<cmdTraceRaysIndirect>("vkCmdTraceRaysIndirectKHR", Scope::Emulated),
    row<cmdTraceRaysIndirect2>("vkCmdTraceRaysIndirect2KHR", Scope::Emulated),
    row<deferredOperationJoin>("vkDeferredOperationJoinKHR", Scope::Shaders),
    row<getDeferredOperationResult>("vkGetDeferredOperationResultKHR", Scope::Shaders),
    row<destroyDeferredOperation>("vkDestroyDeferredOperationKHR", Scope::Shaders),
    row<createShaders>("vkCreateShadersEXT", Scope::Shaders),
    row<getShaderBinaryData>("vkGetShaderBinaryDataEXT", Scope::Emulated),

    row<createAccelerationStructure>("vkCreateAccelerationStructureKHR", Scope::Provided),
    row<destroyAccelerationStructure>("vkDestroyAccelerationStructureKHR", Scope::Provided),
    row<getAccelerationStructureBuildSizes>("vkGetAccelerationStructureBuildSizesKHR", Scope::Provided),
    row<getAccelerationStructureDeviceAddress>("vkGetAccelerationStructureDeviceAddressKHR", Scope::Provided),
    row<getAccelerationStructureCaptureData>("vkGetAccelerationStructureOpaqueCaptureDescriptorDataEXT",
                                             Scope::Provided),
    row<getDeviceAccelerationStructureCompatibility>("vkGetDeviceAccelerationStructureCompatibilityKHR",
                                                     Scope::Provided),
    row<cmdBuildAccelerationStructures>("vkCmdBuildAccelerationStructuresKHR", Scope::Provided),

    row<cmdBuildAccelerationStructuresIndirect>("vkCmdBuildAccelerationStructuresIndirectKHR", Scope::Provided),
    row<buildAccelerationStructures>("vkBuildAccelerationStructuresKHR", Scope::Provided),
    row<copyAccelerationStructure>("vkCopyAccelerationStructureKHR", Scope::Provided),
    row<copyAccelerationStructureToMemory>("vkCopyAccelerationStructureToMemoryKHR", Scope::Provided),
    row<copyMemoryToAccelerationStructure>("vkCopyMemoryToAccelerationStructureKHR", Scope::Provided),
    row<cmdCopyAccelerationStructure>("vkCmdCopyAccelerationStructureKHR", Scope::Provided),
    row<cmdCopyMemoryToAccelerationStructure>("vkCmdCopyMemoryToAccelerationStructureKHR", Scope::Provided),
    row<cmdCopyAccelerationStructureToMemory>("vkCmdCopyAccelerationStructureToMemoryKHR", Scope::Provided),

    row<allocateCommandBuffers>("vkAllocateCommandBuffers", Scope::Provided),
    row<freeCommandBuffers>("vkFreeCommandBuffers", Scope::Provided),
    row<resetCommandBuffer>("vkResetCommandBuffer", Scope::Provided),
    row<resetCommandPool>("vkResetCommandPool", Scope::Provided),
    row<trimCommandPool>("vkTrimCommandPool", Scope::Provided),
    row<destroyCommandPool>("vkDestroyCommandPool", Scope::Provided),
    row<beginCommandBuffer>("vkBeginCommandBuffer", Scope::Provided),
    row<cmdBindPipeline>("vkCmdBindPipeline", Scope::Provided),
    row<cmdBindShaders>("vkCmdBindShadersEXT", Scope::Provided),
    row<cmdPushConstants>("vkCmdPushConstants", Scope::Provided),
    row<cmdPushConstants2>("vkCmdPushConstants2", Scope::Provided),
    row<cmdExecuteCommands>("vkCmdExecuteCommands", Scope::Provided),
    row<cmdBeginConditionalRendering>("vkCmdBeginConditionalRenderingEXT", Scope::Provided),
    row<cmdEndConditionalRendering>("vkCmdEndConditionalRenderingEXT", Scope::Provided),

    row<cmdPipelineBarrier2>("vkCmdPipelineBarrier2", Scope::Provided),
    row<cmdSetEvent2>("vkCmdSetEvent2", Scope::Provided),
    row<cmdResetEvent2>("vkCmdResetEvent2", Scope::Emulated),
    row<cmdWaitEvents2>("vkCmdWaitEvents2", Scope::Provided),
    row<cmdWriteTimestamp2>("vkCmdWriteTimestamp2", Scope::Emulated),
    row<cmdWriteBufferMarker2>("vkCmdWriteBufferMarker2AMD", Scope::Emulated),
    row<queueSubmit2>("vkQueueSubmit2", Scope::Emulated),
    row<createRenderPass2>("vkCreateRenderPass2", Scope::Emulated),

    row<createAccelerationStructure2>("vkCreateAccelerationStructure2KHR", Scope::AddressEnabled),

    row<createMicromap>("vkCreateMicromapEXT", Scope::Ext),
    row<destroyMicromap>("vkDestroyMicromapEXT", Scope::Ext),
    row<getMicromapBuildSizes>("vkGetMicromapBuildSizesEXT", Scope::Ext),
    row<getDeviceMicromapCompatibility>("vkGetDeviceMicromapCompatibilityEXT", Scope::Ext),
    row<cmdBuildMicromaps>("vkCmdBuildMicromapsEXT", Scope::Ext),
    row<cmdCopyMicromap>("vkCmdCopyMicromapEXT", Scope::Ext),
    row<cmdCopyMicromapToMemory>("vkCmdCopyMicromapToMemoryEXT", Scope::Ext),
    row<cmdCopyMemoryToMicromap>("vkCmdCopyMemoryToMicromapEXT", Scope::Ext),
    row<cmdWriteMicromapsProperties>("vkCmdWriteMicromapsPropertiesEXT", Scope::Ext),
    row<buildMicromaps>("vkBuildMicromapsEXT", Scope::Ext),
    row<copyMicromap>("vkCopyMicromapEXT", Scope::Ext),
    row<copyMicromapToMemory>("vkCopyMicromapToMemoryEXT", Scope::Ext),
    row<copyMemoryToMicromap>("vkCopyMemoryToMicromapEXT", Scope::Ext),
    row<writeMicromapsProperties>("vkWriteMicromapsPropertiesEXT", Scope::Ext),

    row<cmdCopyMemory>("vkCmdCopyMemoryKHR", Scope::Address),
    row<cmdCopyMemoryToImage>("vkCmdCopyMemoryToImageKHR", Scope::Address),
    row<cmdCopyImageToMemory>("vkCmdCopyImageToMemoryKHR", Scope::Address),
    row<cmdUpdateMemory>("vkCmdUpdateMemoryKHR", Scope::Address),
    row<cmdFillMemory>("vkCmdFillMemoryKHR", Scope::Address),
    row<cmdCopyQueryPoolResultsToMemory>("vkCmdCopyQueryPoolResultsToMemoryKHR", Scope::AddressEnabled),
    row<cmdWriteMarkerToMemory>("vkCmdWriteMarkerToMemoryAMD", Scope::AddressEnabled, "vkCmdWriteBufferMarkerAMD"),
    row<cmdBindIndexBuffer3>("vkCmdBindIndexBuffer3KHR", Scope::Address),
    row<cmdBindVertexBuffers3>("vkCmdBindVertexBuffers3KHR", Scope::Address),
    row<cmdDrawIndirect2>("vkCmdDrawIndirect2KHR", Scope::Address),
    row<cmdDrawIndexedIndirect2>("vkCmdDrawIndexedIndirect2KHR", Scope::Address),
    row<cmdDrawIndirectCount2>("vkCmdDrawIndirectCount2KHR", Scope::Address),
    row<cmdDrawIndexedIndirectCount2>("vkCmdDrawIndexedIndirectCount2KHR", Scope::Address),
    row<cmdDrawMeshTasksIndirect2>("vkCmdDrawMeshTasksIndirect2EXT", Scope::Address, "vkCmdDrawMeshTasksIndirectEXT"),
    row<cmdDrawMeshTasksIndirectCount2>("vkCmdDrawMeshTasksIndirectCount2EXT", Scope::Address,
                                        "vkCmdDrawMeshTasksIndirectCountEXT"),
    row<cmdDispatchIndirect2>("vkCmdDispatchIndirect2KHR", Scope::Address),
    row<cmdBeginConditionalRendering2>("vkCmdBeginConditionalRendering2EXT", Scope::AddressEnabled,
                                       "vkCmdBeginConditionalRenderingEXT"),
    row<cmdBindTransformFeedbackBuffers2>("vkCmdBindTransformFeedbackBuffers2EXT", Scope::Address,
                                          "vkCmdBindTransformFeedbackBuffersEXT"),
    row<cmdBeginTransformFeedback2>("vkCmdBeginTransformFeedback2EXT", Scope::Address,
                                    "vkCmdBeginTransformFeedbackEXT"),
    row<cmdEndTransformFeedback2>("vkCmdEndTransformFeedback2EXT", Scope::Address, "vkCmdEndTransformFeedbackEXT"),
    row<cmdDrawIndirectByteCount2>("vkCmdDrawIndirectByteCount2EXT", Scope::Address, "vkCmdDrawIndirectByteCountEXT"),
};

// The row of a command, by any of its names.
const Row *find(const char *name)
{
    const char *command = commandOf(name);
    const auto *row = std::ranges::find_if(kRows, [=](const Row &r) { return std::strcmp(r.command, command) == 0; });
    return row == std::end(kRows) ? nullptr : row;
}

// Whether the layer intercepts a command on a device; `next` is the command of the next layer.
bool applies(Scope scope, const Driver &driver, PFN_vkVoidFunction next)
{
    const bool provided = driver.providesMicromaps();
    switch (scope) {
    case Scope::Global:
    case Scope::Instance: return false;
    case Scope::Device: return true;
    case Scope::Debug: return next;
    case Scope::Emulated: return next && driver.emulated();
    case Scope::Shaders: return next && (driver.mode != Mode::PassThrough || driver.assumesMicromaps());
    case Scope::Provided: return next && provided;
    case Scope::Ext: return driver.emulated() && driver.enabled.ext;
    case Scope::Address: return provided && driver.ownAddressCommands;
    case Scope::AddressEnabled: return provided && driver.enabled.addressCommands;
    }
    return false;
}

} // namespace

// A device command that is queried by instance has to serve all devices of the instance, emulated or not. So the layer
// returns those of the next layer, except vkDestroyDevice and vkGetDeviceProcAddr, which every device has. The loader
// queries the others for each device, by vkGetDeviceProcAddr.
VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance handle, const char *name)
{
    const Row *r = find(name);
    if (r && r->scope == Scope::Global)
        return r->function;
    // Layers above may query instance commands without an instance, as MangoHud 0.6.8 and vkBasalt 0.3.2 do for
    // vkCreateDevice.
    if (!handle)
        return r && (r->scope == Scope::Instance || r->scope == Scope::Device) ? r->function : nullptr;
    Instance &instance = instanceOf(handle);
    const PFN_vkVoidFunction next = instance.next.GetInstanceProcAddr(handle, name);
    const bool ours = r && (r->scope == Scope::Instance || r->scope == Scope::Device || r->scope == Scope::Debug);
    if (ours && next)
        return r->function;
    return next;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL implementationProcAddr(VkDevice handle, const char *name)
{
    const Row *row = find(name);
    if (row && row->scope == Scope::Device)
        return row->function;
    Device *device = deviceOfKey(dispatchKey(handle));
    if (!device)
        return nullptr;
    const Driver &driver = device->driver;
    const PFN_vkVoidFunction next = driver.next.GetDeviceProcAddr(handle, name);
    if (!row)
        return next;
    if (row->required && driver.providesMicromaps() && !driver.next.GetDeviceProcAddr(handle, row->required))
        return nullptr;
    // On translated devices the layer has enabled VK_EXT_opacity_micromap, and not the application.
    if (row->scope == Scope::Ext && driver.translated() && !driver.enabled.ext)
        return nullptr;
    return applies(row->scope, driver, next) ? row->function : next;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice handle, const char *name)
{
    const PFN_vkVoidFunction function = implementationProcAddr(handle, name);
    const Device *device = deviceOfKey(dispatchKey(handle));
    if (!function || !device || !device->validation)
        return function;
    const PFN_vkVoidFunction validated = validatedCommand(name);
    return validated ? validated : function;
}

} // namespace vellum::layer
