// The layer's way in: the loader's negotiation, and one table row per intercepted command.
#include <cstring>

#include <vulkan/vk_layer.h>

#include "layer/acceleration_structure.h"
#include "layer/command_state.h"
#include "layer/device.h"
#include "layer/instance.h"
#include "layer/micromap.h"
#include "layer/resources.h"
#include "layer/shaders.h"
#include "layer/sync.h"

namespace vellum::layer
{
namespace
{

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance instance, const char *name);
VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice device, const char *name);

enum class Scope {
    Global,   // before there is an instance
    Instance, // where the next layer has it
    Device,   // on every device
    Emulated, // on emulated devices, where the next layer has it
    Own,      // on emulated devices: the layer's own commands
};

struct Row {
    const char *name;
    Scope scope;
    PFN_vkVoidFunction function;
};

template <typename Function>
Row row(const char *name, Scope scope, Function function)
{
    return {name, scope, reinterpret_cast<PFN_vkVoidFunction>(function)};
}

const Row kRows[] = {
    row("vkGetInstanceProcAddr", Scope::Global, getInstanceProcAddr),
    row("vkCreateInstance", Scope::Global, createInstance),
    row("vkEnumerateInstanceLayerProperties", Scope::Global, enumerateInstanceLayerProperties),
    row("vkEnumerateInstanceExtensionProperties", Scope::Global, enumerateInstanceExtensionProperties),
    row("vkDestroyInstance", Scope::Instance, destroyInstance),
    row("vkCreateDevice", Scope::Instance, createDevice),
    row("vkEnumerateDeviceExtensionProperties", Scope::Instance, enumerateDeviceExtensionProperties),
    row("vkGetPhysicalDeviceFeatures2", Scope::Instance, getPhysicalDeviceFeatures2),
    row("vkGetPhysicalDeviceFeatures2KHR", Scope::Instance, getPhysicalDeviceFeatures2),
    row("vkGetPhysicalDeviceProperties2", Scope::Instance, getPhysicalDeviceProperties2),
    row("vkGetPhysicalDeviceProperties2KHR", Scope::Instance, getPhysicalDeviceProperties2),
    row("vkGetPhysicalDeviceToolProperties", Scope::Instance, getPhysicalDeviceToolProperties),
    row("vkGetPhysicalDeviceToolPropertiesEXT", Scope::Instance, getPhysicalDeviceToolProperties),
    row("vkCreateDebugUtilsMessengerEXT", Scope::Instance, createDebugUtilsMessenger),
    row("vkDestroyDebugUtilsMessengerEXT", Scope::Instance, destroyDebugUtilsMessenger),

    row("vkGetDeviceProcAddr", Scope::Device, getDeviceProcAddr),
    row("vkDestroyDevice", Scope::Device, destroyDevice),

    row("vkCreateBuffer", Scope::Emulated, createBuffer),
    row("vkDestroyBuffer", Scope::Emulated, destroyBuffer),
    row("vkGetDeviceBufferMemoryRequirements", Scope::Emulated, getDeviceBufferMemoryRequirements),
    row("vkGetDeviceBufferMemoryRequirementsKHR", Scope::Emulated, getDeviceBufferMemoryRequirements),
    row("vkAllocateMemory", Scope::Emulated, allocateMemory),
    row("vkGetBufferDeviceAddress", Scope::Emulated, getBufferDeviceAddress),
    row("vkGetBufferDeviceAddressKHR", Scope::Emulated, getBufferDeviceAddress),
    row("vkGetBufferDeviceAddressEXT", Scope::Emulated, getBufferDeviceAddress),
    row("vkSetDebugUtilsObjectNameEXT", Scope::Emulated, setDebugUtilsObjectName),
    row("vkSetDebugUtilsObjectTagEXT", Scope::Emulated, setDebugUtilsObjectTag),

    row("vkCreateShaderModule", Scope::Emulated, createShaderModule),
    row("vkCreateComputePipelines", Scope::Emulated, createComputePipelines),
    row("vkCreateGraphicsPipelines", Scope::Emulated, createGraphicsPipelines),
    row("vkCreateRayTracingPipelinesKHR", Scope::Emulated, createRayTracingPipelines),
    row("vkCreateShadersEXT", Scope::Emulated, createShaders),

    row("vkCreateAccelerationStructureKHR", Scope::Emulated, createAccelerationStructure),
    row("vkDestroyAccelerationStructureKHR", Scope::Emulated, destroyAccelerationStructure),
    row("vkGetAccelerationStructureBuildSizesKHR", Scope::Emulated, getAccelerationStructureBuildSizes),
    row("vkCmdBuildAccelerationStructuresKHR", Scope::Emulated, cmdBuildAccelerationStructures),

    row("vkCmdBuildAccelerationStructuresIndirectKHR", Scope::Emulated, cmdBuildAccelerationStructuresIndirect),
    row("vkBuildAccelerationStructuresKHR", Scope::Emulated, buildAccelerationStructures),
    row("vkCmdCopyAccelerationStructureKHR", Scope::Emulated, cmdCopyAccelerationStructure),
    row("vkCmdCopyAccelerationStructureToMemoryKHR", Scope::Emulated, cmdCopyAccelerationStructureToMemory),

    row("vkAllocateCommandBuffers", Scope::Emulated, allocateCommandBuffers),
    row("vkFreeCommandBuffers", Scope::Emulated, freeCommandBuffers),
    row("vkDestroyCommandPool", Scope::Emulated, destroyCommandPool),
    row("vkBeginCommandBuffer", Scope::Emulated, beginCommandBuffer),
    row("vkCmdBindPipeline", Scope::Emulated, cmdBindPipeline),
    row("vkCmdBindShadersEXT", Scope::Emulated, cmdBindShaders),
    row("vkCmdPushConstants", Scope::Emulated, cmdPushConstants),
    row("vkCmdPushConstants2", Scope::Emulated, cmdPushConstants2),
    row("vkCmdPushConstants2KHR", Scope::Emulated, cmdPushConstants2),
    row("vkCmdExecuteCommands", Scope::Emulated, cmdExecuteCommands),
    row("vkCmdBeginConditionalRenderingEXT", Scope::Emulated, cmdBeginConditionalRendering),
    row("vkCmdEndConditionalRenderingEXT", Scope::Emulated, cmdEndConditionalRendering),

    row("vkCmdPipelineBarrier2", Scope::Emulated, cmdPipelineBarrier2),
    row("vkCmdPipelineBarrier2KHR", Scope::Emulated, cmdPipelineBarrier2),
    row("vkCmdSetEvent2", Scope::Emulated, cmdSetEvent2),
    row("vkCmdSetEvent2KHR", Scope::Emulated, cmdSetEvent2),
    row("vkCmdResetEvent2", Scope::Emulated, cmdResetEvent2),
    row("vkCmdResetEvent2KHR", Scope::Emulated, cmdResetEvent2),
    row("vkCmdWaitEvents2", Scope::Emulated, cmdWaitEvents2),
    row("vkCmdWaitEvents2KHR", Scope::Emulated, cmdWaitEvents2),
    row("vkCmdWriteTimestamp2", Scope::Emulated, cmdWriteTimestamp2),
    row("vkCmdWriteTimestamp2KHR", Scope::Emulated, cmdWriteTimestamp2),
    row("vkQueueSubmit2", Scope::Emulated, queueSubmit2),
    row("vkQueueSubmit2KHR", Scope::Emulated, queueSubmit2),
    row("vkCreateRenderPass2", Scope::Emulated, createRenderPass2),
    row("vkCreateRenderPass2KHR", Scope::Emulated, createRenderPass2),

    row("vkCreateMicromapEXT", Scope::Own, createMicromap),
    row("vkDestroyMicromapEXT", Scope::Own, destroyMicromap),
    row("vkGetMicromapBuildSizesEXT", Scope::Own, getMicromapBuildSizes),
    row("vkGetDeviceMicromapCompatibilityEXT", Scope::Own, getDeviceMicromapCompatibility),
    row("vkCmdBuildMicromapsEXT", Scope::Own, cmdBuildMicromaps),
    row("vkCmdCopyMicromapEXT", Scope::Own, cmdCopyMicromap),
    row("vkCmdCopyMicromapToMemoryEXT", Scope::Own, cmdCopyMicromapToMemory),
    row("vkCmdCopyMemoryToMicromapEXT", Scope::Own, cmdCopyMemoryToMicromap),
    row("vkCmdWriteMicromapsPropertiesEXT", Scope::Own, cmdWriteMicromapsProperties),
    row("vkBuildMicromapsEXT", Scope::Own, buildMicromaps),
    row("vkCopyMicromapEXT", Scope::Own, copyMicromap),
    row("vkCopyMicromapToMemoryEXT", Scope::Own, copyMicromapToMemory),
    row("vkCopyMemoryToMicromapEXT", Scope::Own, copyMemoryToMicromap),
    row("vkWriteMicromapsPropertiesEXT", Scope::Own, writeMicromapsProperties),
};

const Row *find(const char *name)
{
    for (const Row &r : kRows) {
        if (std::strcmp(r.name, name) == 0)
            return &r;
    }
    return nullptr;
}

// Device commands asked for by instance are the same for all its devices, emulated or not: they are left to
// vkGetDeviceProcAddr, which the loader asks for each device. Only vkDestroyDevice and vkGetDeviceProcAddr are the same
// for all.
VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance handle, const char *name)
{
    const Row *r = find(name);
    if (r && r->scope == Scope::Global)
        return r->function;
    if (!handle)
        return nullptr;
    Instance &instance = instanceOf(handle);
    const PFN_vkVoidFunction next = instance.next.GetInstanceProcAddr(handle, name);
    if (r && (r->scope == Scope::Instance || r->scope == Scope::Device) && next)
        return r->function;
    return next;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice handle, const char *name)
{
    const Row *r = find(name);
    if (r && r->scope == Scope::Device)
        return r->function;
    Device *device = deviceOfKey(dispatchKey(handle));
    if (!device)
        return nullptr;
    if (device->emulated && r && r->scope == Scope::Own)
        return r->function;
    const PFN_vkVoidFunction next = device->next.GetDeviceProcAddr(handle, name);
    return device->emulated && r && r->scope == Scope::Emulated && next ? r->function : next;
}

} // namespace
} // namespace vellum::layer

extern "C" VK_LAYER_EXPORT VKAPI_ATTR VkResult VKAPI_CALL
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
