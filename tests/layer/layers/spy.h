// SPDX-License-Identifier: Apache-2.0
// The quirk "spy": what the files with its commands share. It simulates a driver without micromaps, and
// reports every flag, structure and extension name of theirs that reaches it. (The validation layer does not: it knows
// the extension and lets most of its bits pass.) Each file has the commands of one kind.
#pragma once

#include "layers/driver.h"

namespace spy
{

using driver::inChain;
using driver::keyOf;
using driver::Row;

extern std::mutex mutex; // of everything that the spy remembers

constexpr auto kLevel = driver::Level::Spy;
template <class Function>
Function nextOfDevice(void *key, const char *name)
{
    return driver::next<Function>(kLevel, key, name);
}
#define SPY_NEXT(function) DRIVER_NEXT(function)

inline void report(const std::string &text)
{
    driver::report(text, "SPY");
}

// True if the device has the driver's own VK_EXT_opacity_micromap (quirk "ext"): the spy then accepts that extension.
bool knowsMicromaps(void *key);

void expectStages(void *key, const char *where, VkPipelineStageFlags2 stages);
// A command buffer was begun: what it traces with must be its own if it may run twice at once.
void noteUsage(VkCommandBuffer commands, VkCommandBufferUsageFlags usage);
// Records that the command buffer contains a build.
void noteBuild(VkCommandBuffer commands);

#define SPY_FUNCTION(name) DRIVER_FUNCTION(name)
std::span<const Row> synchronization(); // spy_synchronization.cpp
std::span<const Row> structures();      // spy_structures.cpp
std::span<const Row> memory();          // spy_memory.cpp
std::span<const Row> pipelines();       // spy_pipelines.cpp
std::span<const Row> pipelineCaches();  // spy_cache.cpp

// A module was made: what a pipeline of it is found by.
void keepWords(VkShaderModule module, const VkShaderModuleCreateInfo &info);
// A pipeline was made: whether it was in the cache.
void lookInCache(VkPipelineCache cache, const VkComputePipelineCreateInfo &info, VkPipeline pipeline);
void lookInCache(VkPipelineCache cache, const VkRayTracingPipelineCreateInfoKHR &info, VkPipeline pipeline);

VKAPI_ATTR void VKAPI_CALL getExternalBuffers(VkPhysicalDevice handle, const VkPhysicalDeviceExternalBufferInfo *info,
                                              VkExternalBufferProperties *properties);
VKAPI_ATTR void VKAPI_CALL getMemoryProperties(VkPhysicalDevice handle, VkPhysicalDeviceMemoryProperties *memory);

} // namespace spy
