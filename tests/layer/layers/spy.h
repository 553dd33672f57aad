// What the files of the spy layer (spy_layer.cpp) share. Each has the commands of one kind.
#pragma once

#include <vulkan/vk_layer.h>

#include "vellum/vulkan_opacity_micromap.h"

#include <mutex>
#include <span>
#include <string>
#include <string_view>

namespace spy
{

extern std::mutex mutex; // of everything that the spy remembers

// Looked up at creation: later, the loader's end of the chain may answer with the chain's beginning.
struct InstanceTable {
    VkInstance handle = VK_NULL_HANDLE;
    PFN_vkGetInstanceProcAddr getProcAddr = nullptr;
    PFN_vkCreateDebugUtilsMessengerEXT createMessenger = nullptr;
    PFN_vkDestroyDebugUtilsMessengerEXT destroyMessenger = nullptr;
    PFN_vkGetPhysicalDeviceMemoryProperties getMemoryProperties = nullptr;
    PFN_vkEnumerateDeviceExtensionProperties enumerateExtensions = nullptr;
    PFN_vkGetPhysicalDeviceFeatures2 getFeatures = nullptr;
    PFN_vkGetPhysicalDeviceProperties2 getProperties = nullptr;
};

// The dispatch key.
template <class Handle>
void *keyOf(Handle handle)
{
    return *reinterpret_cast<void **>(handle);
}

InstanceTable tableOf(void *key);
PFN_vkVoidFunction nextOfDevice(void *key, const char *name);
template <class Function>
Function nextOfDevice(void *key, const char *name)
{
    return reinterpret_cast<Function>(nextOfDevice(key, name));
}
#define SPY_NEXT(function) nextOfDevice<PFN_##function>(keyOf(handle), #function)

// To all debug messengers.
void tell(const std::string &text);

inline const void *inChain(const void *chain, VkStructureType type)
{
    const auto *structure = static_cast<const VkBaseInStructure *>(chain);
    while (structure != nullptr && structure->sType != type)
        structure = structure->pNext;
    return structure;
}

void expectStages(const char *where, VkPipelineStageFlags2 stages);
// There was a build in the command buffer.
void noteBuild(VkCommandBuffer commands);

// A command of a device, by its name without the KHR of the extension it came from.
struct Row {
    const char *name;
    PFN_vkVoidFunction function;
};
#define SPY_FUNCTION(name) reinterpret_cast<PFN_vkVoidFunction>(name)
std::span<const Row> synchronization(); // spy_synchronization.cpp
std::span<const Row> structures();      // spy_structures.cpp
std::span<const Row> memory();          // spy_memory.cpp
std::span<const Row> pipelines();       // spy_pipelines.cpp
std::span<const Row> pipelineCaches();  // spy_cache.cpp

// A pipeline was made: whether it was in the cache.
void lookInCache(VkPipelineCache cache, const VkComputePipelineCreateInfo &info, VkPipeline pipeline);
void lookInCache(VkPipelineCache cache, const VkRayTracingPipelineCreateInfoKHR &info, VkPipeline pipeline);

// Commands that are there whether the driver has them or not; lavapipe has not.
PFN_vkVoidFunction markerFunction(std::string_view name);       // of VK_EXT_debug_marker
PFN_vkVoidFunction bufferMarkerFunction(std::string_view name); // of VK_AMD_buffer_marker

// When an instance is made: whether it has one more type of memory.
void setMoreMemory(bool more);
VKAPI_ATTR void VKAPI_CALL getMemoryProperties(VkPhysicalDevice handle, VkPhysicalDeviceMemoryProperties *memory);

} // namespace spy
