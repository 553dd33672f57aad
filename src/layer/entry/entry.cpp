// The layer's way in: the loader's negotiation, and one table row per intercepted command.
#include <cstdio>
#include <cstring>
#include <exception>
#include <iterator>
#include <type_traits>

#include <vulkan/vk_layer.h>

#include "layer/command_buffer/synchronization.h"
#include "layer/entry/debug_messages.h"
#include "layer/entry/device.h"
#include "layer/khr_over_ext/shader_translation.h"
#include "layer/memory/buffers.h"
#include "layer/micromaps/micromap.h"
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

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance instance, const char *name);
VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice device, const char *name);

enum class Scope {
    Global,     // before there is an instance
    Instance,   // where the next layer has it
    Device,     // on every device
    Debug,      // on every device, where the next layer has it; loaders call it through the instance's chain
    Emulated,   // on emulated devices, where the next layer has it
    Identified, // likewise, and where only identifiers of shader modules are the layer's
    Translated, // on devices whose VK_KHR_opacity_micromap is the driver's VK_EXT_opacity_micromap, likewise
    Provided,   // on both, likewise
    Own,        // on emulated devices: the commands of VK_EXT_opacity_micromap
    Address,    // where VK_KHR_device_address_commands is enabled and the layer's
    Create2,    // where VK_KHR_device_address_commands is enabled, whoever's it is
};

struct Row {
    const char *name;
    Scope scope;
    PFN_vkVoidFunction function;
    const char *from = nullptr; // where the command is given only on devices that have another, that one
};

// No exception crosses the Vulkan ABI. The layer throws nothing itself; the library does when memory runs out.
template <typename Result, typename Function>
Result guarded(Function function) noexcept
{
    try {
        return function();
    } catch (const std::exception &) {
        std::fputs("vellum: VELLUM-out-of-memory: out of host memory; the command was not carried out\n", stderr);
    }
    if constexpr (std::is_same_v<Result, VkResult>)
        return VK_ERROR_OUT_OF_HOST_MEMORY;
    else if constexpr (!std::is_void_v<Result>)
        return Result{};
}

// A function as Vulkan calls it.
template <auto function>
struct Command;

template <typename Result, typename First, typename... Others, Result(VKAPI_PTR *function)(First, Others...)>
requires(!std::is_reference_v<First>) struct Command<function> {
    static VKAPI_ATTR Result VKAPI_CALL call(First first, Others... others) noexcept
    {
        return guarded<Result>([&] { return function(first, others...); });
    }
};

// One of a room, which works on what the room has of a device.
template <typename Result, typename Subsystem, typename Handle, typename... Arguments,
          Result (*function)(Subsystem &, Handle, Arguments...)>
struct Command<function> {
    static VKAPI_ATTR Result VKAPI_CALL call(Handle handle, Arguments... arguments) noexcept
    {
        return guarded<Result>(
            [&] { return function(subsystemOf<Subsystem>(deviceOf(handle)), handle, arguments...); });
    }
};

template <auto function>
Row row(const char *name, Scope scope, const char *from = nullptr)
{
    return {name, scope, reinterpret_cast<PFN_vkVoidFunction>(&Command<function>::call), from};
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
    row<getPhysicalDeviceFeatures2>("vkGetPhysicalDeviceFeatures2KHR", Scope::Instance),
    row<getPhysicalDeviceProperties2>("vkGetPhysicalDeviceProperties2", Scope::Instance),
    row<getPhysicalDeviceProperties2>("vkGetPhysicalDeviceProperties2KHR", Scope::Instance),
    row<getPhysicalDeviceToolProperties>("vkGetPhysicalDeviceToolProperties", Scope::Instance),
    row<getPhysicalDeviceToolProperties>("vkGetPhysicalDeviceToolPropertiesEXT", Scope::Instance),
    row<getPhysicalDeviceExternalBufferProperties>("vkGetPhysicalDeviceExternalBufferProperties", Scope::Instance),
    row<getPhysicalDeviceExternalBufferProperties>("vkGetPhysicalDeviceExternalBufferPropertiesKHR", Scope::Instance),
    row<createDebugUtilsMessenger>("vkCreateDebugUtilsMessengerEXT", Scope::Instance),
    row<destroyDebugUtilsMessenger>("vkDestroyDebugUtilsMessengerEXT", Scope::Instance),
    row<submitDebugUtilsMessage>("vkSubmitDebugUtilsMessageEXT", Scope::Instance),
    row<debugReportMessage>("vkDebugReportMessageEXT", Scope::Instance),

    row<getDeviceProcAddr>("vkGetDeviceProcAddr", Scope::Device),
    row<destroyDevice>("vkDestroyDevice", Scope::Device),

    row<createBuffer>("vkCreateBuffer", Scope::Provided),
    row<destroyBuffer>("vkDestroyBuffer", Scope::Provided),
    row<getDeviceBufferMemoryRequirements>("vkGetDeviceBufferMemoryRequirements", Scope::Provided),
    row<getDeviceBufferMemoryRequirements>("vkGetDeviceBufferMemoryRequirementsKHR", Scope::Provided),
    row<allocateMemory>("vkAllocateMemory", Scope::Emulated),
    row<freeMemory>("vkFreeMemory", Scope::Emulated),
    row<bindBufferMemory>("vkBindBufferMemory", Scope::Provided),
    row<bindBufferMemory2>("vkBindBufferMemory2", Scope::Provided),
    row<bindBufferMemory2>("vkBindBufferMemory2KHR", Scope::Provided),
    row<mapMemory>("vkMapMemory", Scope::Emulated),
    row<unmapMemory>("vkUnmapMemory", Scope::Emulated),
    row<mapMemory2>("vkMapMemory2", Scope::Emulated),
    row<mapMemory2>("vkMapMemory2KHR", Scope::Emulated),
    row<unmapMemory2>("vkUnmapMemory2", Scope::Emulated),
    row<unmapMemory2>("vkUnmapMemory2KHR", Scope::Emulated),
    row<getBufferDeviceAddress>("vkGetBufferDeviceAddress", Scope::Provided),
    row<getBufferDeviceAddress>("vkGetBufferDeviceAddressKHR", Scope::Provided),
    row<getBufferDeviceAddress>("vkGetBufferDeviceAddressEXT", Scope::Provided),
    row<cmdBindDescriptorBuffers>("vkCmdBindDescriptorBuffersEXT", Scope::Provided),
    row<createQueryPool>("vkCreateQueryPool", Scope::Provided),
    row<destroyQueryPool>("vkDestroyQueryPool", Scope::Provided),
    row<resetQueryPool>("vkResetQueryPool", Scope::Provided),
    row<resetQueryPool>("vkResetQueryPoolEXT", Scope::Provided),
    row<getQueryPoolResults>("vkGetQueryPoolResults", Scope::Provided),
    row<cmdResetQueryPool>("vkCmdResetQueryPool", Scope::Provided),
    row<cmdCopyQueryPoolResults>("vkCmdCopyQueryPoolResults", Scope::Provided),
    row<cmdWriteAccelerationStructuresProperties>("vkCmdWriteAccelerationStructuresPropertiesKHR", Scope::Provided),
    row<writeAccelerationStructuresProperties>("vkWriteAccelerationStructuresPropertiesKHR", Scope::Provided),
    row<queueWaitIdle>("vkQueueWaitIdle", Scope::Emulated),
    row<deviceWaitIdle>("vkDeviceWaitIdle", Scope::Emulated),
    row<waitForFences>("vkWaitForFences", Scope::Emulated),
    row<getFenceStatus>("vkGetFenceStatus", Scope::Emulated),
    row<waitSemaphores>("vkWaitSemaphores", Scope::Emulated),
    row<waitSemaphores>("vkWaitSemaphoresKHR", Scope::Emulated),
    row<queueSubmit>("vkQueueSubmit", Scope::Emulated),
    row<queueBindSparse>("vkQueueBindSparse", Scope::Emulated),
    row<queuePresent>("vkQueuePresentKHR", Scope::Emulated),
    row<setPrivateData>("vkSetPrivateData", Scope::Provided),
    row<setPrivateData>("vkSetPrivateDataEXT", Scope::Provided),
    row<getPrivateData>("vkGetPrivateData", Scope::Provided),
    row<getPrivateData>("vkGetPrivateDataEXT", Scope::Provided),
    row<destroyPrivateDataSlot>("vkDestroyPrivateDataSlot", Scope::Provided),
    row<destroyPrivateDataSlot>("vkDestroyPrivateDataSlotEXT", Scope::Provided),
    row<queueBeginDebugUtilsLabel>("vkQueueBeginDebugUtilsLabelEXT", Scope::Debug),
    row<queueEndDebugUtilsLabel>("vkQueueEndDebugUtilsLabelEXT", Scope::Debug),
    row<queueInsertDebugUtilsLabel>("vkQueueInsertDebugUtilsLabelEXT", Scope::Debug),
    row<setDebugUtilsObjectName>("vkSetDebugUtilsObjectNameEXT", Scope::Debug),
    row<setDebugUtilsObjectTag>("vkSetDebugUtilsObjectTagEXT", Scope::Debug),
    row<debugMarkerSetObjectName>("vkDebugMarkerSetObjectNameEXT", Scope::Debug),
    row<debugMarkerSetObjectTag>("vkDebugMarkerSetObjectTagEXT", Scope::Debug),

    row<createShaderModule>("vkCreateShaderModule", Scope::Identified),
    row<createComputePipelines>("vkCreateComputePipelines", Scope::Identified),
    row<createGraphicsPipelines>("vkCreateGraphicsPipelines", Scope::Identified),
    row<destroyShaderModule>("vkDestroyShaderModule", Scope::Identified),
    row<getShaderModuleIdentifier>("vkGetShaderModuleIdentifierEXT", Scope::Identified),
    row<getShaderModuleCreateInfoIdentifier>("vkGetShaderModuleCreateInfoIdentifierEXT", Scope::Identified),
    row<createPipelineBinaries>("vkCreatePipelineBinariesKHR", Scope::Identified),
    row<destroyPipelineBinary>("vkDestroyPipelineBinaryKHR", Scope::Emulated),
    row<getPipelineKey>("vkGetPipelineKeyKHR", Scope::Identified),
    row<getPipelineBinaryData>("vkGetPipelineBinaryDataKHR", Scope::Emulated),
    row<createRayTracingPipelines>("vkCreateRayTracingPipelinesKHR", Scope::Identified),
    row<destroyPipeline>("vkDestroyPipeline", Scope::Emulated),
    row<getShaderGroupHandles>("vkGetRayTracingShaderGroupHandlesKHR", Scope::Emulated),
    row<getCaptureReplayShaderGroupHandles>("vkGetRayTracingCaptureReplayShaderGroupHandlesKHR", Scope::Emulated),
    row<getShaderGroupStackSize>("vkGetRayTracingShaderGroupStackSizeKHR", Scope::Emulated),
    row<cmdSetRayTracingPipelineStackSize>("vkCmdSetRayTracingPipelineStackSizeKHR", Scope::Emulated),
    row<cmdTraceRays>("vkCmdTraceRaysKHR", Scope::Emulated),
    row<cmdTraceRaysIndirect>("vkCmdTraceRaysIndirectKHR", Scope::Emulated),
    row<cmdTraceRaysIndirect2>("vkCmdTraceRaysIndirect2KHR", Scope::Emulated),
    row<deferredOperationJoin>("vkDeferredOperationJoinKHR", Scope::Provided),
    row<getDeferredOperationResult>("vkGetDeferredOperationResultKHR", Scope::Provided),
    row<destroyDeferredOperation>("vkDestroyDeferredOperationKHR", Scope::Provided),
    row<createShaders>("vkCreateShadersEXT", Scope::Emulated),
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
    row<destroyCommandPool>("vkDestroyCommandPool", Scope::Provided),
    row<beginCommandBuffer>("vkBeginCommandBuffer", Scope::Provided),
    row<cmdBindPipeline>("vkCmdBindPipeline", Scope::Provided),
    row<cmdBindShaders>("vkCmdBindShadersEXT", Scope::Provided),
    row<cmdPushConstants>("vkCmdPushConstants", Scope::Provided),
    row<cmdPushConstants2>("vkCmdPushConstants2", Scope::Provided),
    row<cmdPushConstants2>("vkCmdPushConstants2KHR", Scope::Provided),
    row<cmdExecuteCommands>("vkCmdExecuteCommands", Scope::Provided),
    row<cmdBeginConditionalRendering>("vkCmdBeginConditionalRenderingEXT", Scope::Provided),
    row<cmdEndConditionalRendering>("vkCmdEndConditionalRenderingEXT", Scope::Provided),

    row<cmdPipelineBarrier2>("vkCmdPipelineBarrier2", Scope::Provided),
    row<cmdPipelineBarrier2>("vkCmdPipelineBarrier2KHR", Scope::Provided),
    row<cmdSetEvent2>("vkCmdSetEvent2", Scope::Provided),
    row<cmdSetEvent2>("vkCmdSetEvent2KHR", Scope::Provided),
    row<cmdResetEvent2>("vkCmdResetEvent2", Scope::Emulated),
    row<cmdResetEvent2>("vkCmdResetEvent2KHR", Scope::Emulated),
    row<cmdWaitEvents2>("vkCmdWaitEvents2", Scope::Provided),
    row<cmdWaitEvents2>("vkCmdWaitEvents2KHR", Scope::Provided),
    row<cmdWriteTimestamp2>("vkCmdWriteTimestamp2", Scope::Emulated),
    row<cmdWriteTimestamp2>("vkCmdWriteTimestamp2KHR", Scope::Emulated),
    row<cmdWriteBufferMarker2>("vkCmdWriteBufferMarker2AMD", Scope::Emulated),
    row<queueSubmit2>("vkQueueSubmit2", Scope::Emulated),
    row<queueSubmit2>("vkQueueSubmit2KHR", Scope::Emulated),
    row<createRenderPass2>("vkCreateRenderPass2", Scope::Emulated),
    row<createRenderPass2>("vkCreateRenderPass2KHR", Scope::Emulated),

    row<createAccelerationStructure2>("vkCreateAccelerationStructure2KHR", Scope::Create2),

    row<createMicromap>("vkCreateMicromapEXT", Scope::Own),
    row<destroyMicromap>("vkDestroyMicromapEXT", Scope::Own),
    row<getMicromapBuildSizes>("vkGetMicromapBuildSizesEXT", Scope::Own),
    row<getDeviceMicromapCompatibility>("vkGetDeviceMicromapCompatibilityEXT", Scope::Own),
    row<cmdBuildMicromaps>("vkCmdBuildMicromapsEXT", Scope::Own),
    row<cmdCopyMicromap>("vkCmdCopyMicromapEXT", Scope::Own),
    row<cmdCopyMicromapToMemory>("vkCmdCopyMicromapToMemoryEXT", Scope::Own),
    row<cmdCopyMemoryToMicromap>("vkCmdCopyMemoryToMicromapEXT", Scope::Own),
    row<cmdWriteMicromapsProperties>("vkCmdWriteMicromapsPropertiesEXT", Scope::Own),
    row<buildMicromaps>("vkBuildMicromapsEXT", Scope::Own),
    row<copyMicromap>("vkCopyMicromapEXT", Scope::Own),
    row<copyMicromapToMemory>("vkCopyMicromapToMemoryEXT", Scope::Own),
    row<copyMemoryToMicromap>("vkCopyMemoryToMicromapEXT", Scope::Own),
    row<writeMicromapsProperties>("vkWriteMicromapsPropertiesEXT", Scope::Own),

    row<createTranslatedModule>("vkCreateShaderModule", Scope::Translated),
    row<destroyTranslatedModule>("vkDestroyShaderModule", Scope::Translated),
    row<createTranslatedComputePipelines>("vkCreateComputePipelines", Scope::Translated),
    row<createTranslatedGraphicsPipelines>("vkCreateGraphicsPipelines", Scope::Translated),
    row<createTranslatedRayTracingPipelines>("vkCreateRayTracingPipelinesKHR", Scope::Translated),
    row<createTranslatedShaders>("vkCreateShadersEXT", Scope::Translated),
    row<getTranslatedInfoIdentifier>("vkGetShaderModuleCreateInfoIdentifierEXT", Scope::Translated),
    row<createTranslatedBinaries>("vkCreatePipelineBinariesKHR", Scope::Translated),
    row<getTranslatedKey>("vkGetPipelineKeyKHR", Scope::Translated),

    row<cmdCopyMemory>("vkCmdCopyMemoryKHR", Scope::Address),
    row<cmdCopyMemoryToImage>("vkCmdCopyMemoryToImageKHR", Scope::Address),
    row<cmdCopyImageToMemory>("vkCmdCopyImageToMemoryKHR", Scope::Address),
    row<cmdUpdateMemory>("vkCmdUpdateMemoryKHR", Scope::Address),
    row<cmdFillMemory>("vkCmdFillMemoryKHR", Scope::Address),
    row<cmdCopyQueryPoolResultsToMemory>("vkCmdCopyQueryPoolResultsToMemoryKHR", Scope::Create2),
    row<cmdWriteMarkerToMemory>("vkCmdWriteMarkerToMemoryAMD", Scope::Address, "vkCmdWriteBufferMarkerAMD"),
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
    row<cmdBeginConditionalRendering2>("vkCmdBeginConditionalRendering2EXT", Scope::Create2,
                                       "vkCmdBeginConditionalRenderingEXT"),
    row<cmdBindTransformFeedbackBuffers2>("vkCmdBindTransformFeedbackBuffers2EXT", Scope::Address,
                                          "vkCmdBindTransformFeedbackBuffersEXT"),
    row<cmdBeginTransformFeedback2>("vkCmdBeginTransformFeedback2EXT", Scope::Address,
                                    "vkCmdBeginTransformFeedbackEXT"),
    row<cmdEndTransformFeedback2>("vkCmdEndTransformFeedback2EXT", Scope::Address, "vkCmdEndTransformFeedbackEXT"),
    row<cmdDrawIndirectByteCount2>("vkCmdDrawIndirectByteCount2EXT", Scope::Address, "vkCmdDrawIndirectByteCountEXT"),
};

// Commands that are other ones on emulated and on translated devices have two rows, of which this is the first.
const Row *find(const char *name, const Row *after = nullptr)
{
    for (const Row *r = after ? after + 1 : std::begin(kRows); r != std::end(kRows); ++r) {
        if (std::strcmp(r->name, name) == 0)
            return r;
    }
    return nullptr;
}

// Whether the row counts on a device, `next` being the command of the next layer.
bool applies(const Row &row, const Driver &driver, PFN_vkVoidFunction next)
{
    const bool provided = driver.emulated() || driver.translated();
    switch (row.scope) {
    case Scope::Global:
    case Scope::Instance: return false;
    case Scope::Device: return true;
    case Scope::Debug: return next;
    case Scope::Emulated: return next && driver.emulated();
    case Scope::Identified: return next && (driver.emulated() || driver.mode == Mode::Identifiers);
    case Scope::Translated: return next && driver.translated();
    case Scope::Provided: return next && provided;
    case Scope::Own: return driver.emulated() && driver.enabled.ext;
    case Scope::Address: return provided && driver.ownAddressCommands;
    case Scope::Create2: return provided && driver.enabled.addressCommands;
    }
    return false;
}

// Device commands asked for by instance are the same for all its devices, emulated or not: they are left to
// vkGetDeviceProcAddr, which the loader asks for each device. Only vkDestroyDevice and vkGetDeviceProcAddr are the same
// for all.
VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance handle, const char *name)
{
    const Row *r = find(name);
    if (r && r->scope == Scope::Global)
        return r->function;
    // Layers above ask without an instance for what they call with one, as MangoHud 0.6.8 and vkBasalt 0.3.2 do for
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

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice handle, const char *name)
{
    const Row *first = find(name);
    if (first && first->scope == Scope::Device)
        return first->function;
    Device *device = deviceOfKey(dispatchKey(handle));
    if (!device)
        return nullptr;
    const Driver &driver = device->driver;
    if ((driver.emulated() || driver.translated()) && first && first->from &&
        !driver.next.GetDeviceProcAddr(handle, first->from))
        return nullptr;
    // On translated devices, what the layer itself enabled.
    if (driver.translated() && !driver.enabled.ext && first && first->scope == Scope::Own)
        return nullptr;
    const PFN_vkVoidFunction next = driver.next.GetDeviceProcAddr(handle, name);
    for (const Row *r = first; r; r = find(name, r)) {
        if (applies(*r, driver, next))
            return r->function;
    }
    return next;
}

} // namespace
} // namespace vellum::layer

extern "C" __attribute__((visibility("default"))) VKAPI_ATTR VkResult VKAPI_CALL
vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface *interface)
{
    if (interface->sType != LAYER_NEGOTIATE_INTERFACE_STRUCT || interface->loaderLayerInterfaceVersion < 2)
        return VK_ERROR_INITIALIZATION_FAILED;
    interface->loaderLayerInterfaceVersion = 2;
    interface->pfnGetInstanceProcAddr = vellum::layer::getInstanceProcAddr;
    interface->pfnGetDeviceProcAddr = vellum::layer::getDeviceProcAddr;
    interface->pfnGetPhysicalDeviceProcAddr = nullptr;
    return VK_SUCCESS;
}
