// SPDX-License-Identifier: Apache-2.0
#include "layer/pipelines/ray_tracing_pipeline.h"

#include <algorithm>
#include <array>

#include "layer/base/commands.h"
#include "layer/base/pipeline_info.h"
#include "layer/base/pnext.h"
#include "layer/pipelines/device_pipelines.h"

namespace vellum::layer
{

std::span<const uint32_t> stageCode(const DevicePipelines &device, const VkPipelineShaderStageCreateInfo &stage)
{
    if (const auto original = device.rayTracingModules.get(stage.module))
        return original->words;
    const auto *inlined =
        findInChain<VkShaderModuleCreateInfo>(stage.pNext, VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
    return inlined ? std::span(inlined->pCode, inlined->codeSize / 4) : std::span<const uint32_t>();
}

spirv::TracedFlags tracedBy(const DevicePipelines &device, const VkPipelineShaderStageCreateInfo &stage)
{
    const auto module = device.rayTracingModules.get(stage.module);
    return module ? module->traced : spirv::scan(stageCode(device, stage)).traced;
}

bool checkFlagTransport(DevicePipelines &device, const VkRayTracingPipelineCreateInfoKHR &info,
                        const spirv::HiddenFlags &hidden)
{
    const uint32_t libraries = info.pLibraryInfo ? info.pLibraryInfo->libraryCount : 0;
    if (libraries == 0 && (pipelineFlags(info.pNext, info.flags) & VK_PIPELINE_CREATE_LIBRARY_BIT_KHR) == 0)
        return true;
    bool alike = hidden.fixed == 0;
    for (uint32_t i = 0; i < libraries; ++i) {
        const auto library = device.rayTracingPipelines.get(info.pLibraryInfo->pLibraries[i]);
        alike = alike && library && library->hidden.fixed == 0;
    }
    if (!alike)
        device.driver.report().notAvailable("a ray tracing pipeline or library of binaries whose ray flags do not "
                                            "travel as in the other libraries of this "
                                            "device");
    return alike;
}

void writeStandIn(DevicePipelines &device, VkPipeline pipeline, RayTracingPipeline &record)
{
    std::array<uint32_t, kGroupHandleBytes / 4> handle{};
    if (device.driver.next.GetRayTracingShaderGroupHandlesKHR(device.driver.handle, pipeline, record.ownGroups, 1,
                                                              kGroupHandleBytes, handle.data()) != VK_SUCCESS) {
        device.driver.report().error("VELLUM-null-group", "the driver returned no handle for the layer's hit group");
        handle = {}; // the record stays null
    }
    std::copy(handle.begin(), handle.end(), record.standIn.words());
}

void measureStacks(DevicePipelines &device, VkPipeline pipeline, const std::vector<uint32_t> &groups)
{
    for (const uint32_t group : groups) {
        const VkDeviceSize bytes = device.driver.next.GetRayTracingShaderGroupStackSizeKHR(
            device.driver.handle, pipeline, group, VK_SHADER_GROUP_SHADER_ANY_HIT_KHR);
        atomicMax(device.anyHitStack, static_cast<uint32_t>(std::min<VkDeviceSize>(bytes, UINT32_MAX)));
    }
}

void destroyPipeline(DevicePipelines &device, VkDevice handle, VkPipeline pipeline,
                     const VkAllocationCallbacks *allocator)
{
    device.rayTracingPipelines.take(pipeline);
    device.librariesWithoutMicromaps.take(pipeline);
    device.driver.next.DestroyPipeline(handle, pipeline, allocator);
}

namespace
{

size_t captureReplayHandleBytes(const DevicePipelines &device)
{
    VkPhysicalDeviceRayTracingPipelinePropertiesKHR pipelines{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_PROPERTIES_KHR};
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &pipelines, {}};
    device.driver.instance->GetPhysicalDeviceProperties2(device.driver.physicalDevice, &properties);
    return pipelines.shaderGroupHandleCaptureReplaySize;
}

// Calls `get(first driver group, count, groups before)` for each run of groups that are contiguous in the driver's
// pipeline.
template <typename Get>
VkResult forDriverGroups(const DevicePipelines &device, VkPipeline pipeline, uint32_t first, uint32_t count, Get get)
{
    const auto record = device.rayTracingPipelines.get(pipeline);
    if (!record || !record->hasNullGroup || first + count <= record->ownGroups)
        return get(first, count, 0u);
    const uint32_t own = first < record->ownGroups ? record->ownGroups - first : 0;
    const VkResult result = own > 0 ? get(first, own, 0u) : VK_SUCCESS;
    return result == VK_SUCCESS ? get(record->driverGroup(first + own), count - own, own) : result;
}

} // namespace

VkResult getShaderGroupHandles(DevicePipelines &device, VkDevice handle, VkPipeline pipeline, uint32_t first,
                               uint32_t count, size_t bytes, void *data)
{
    return forDriverGroups(device, pipeline, first, count, [&](uint32_t group, uint32_t groups, uint32_t before) {
        const size_t offset = std::min<size_t>(size_t{before} * kGroupHandleBytes, bytes);
        return device.driver.next.GetRayTracingShaderGroupHandlesKHR(handle, pipeline, group, groups, bytes - offset,
                                                                     static_cast<std::byte *>(data) + offset);
    });
}

VkResult getCaptureReplayShaderGroupHandles(DevicePipelines &device, VkDevice handle, VkPipeline pipeline,
                                            uint32_t first, uint32_t count, size_t bytes, void *data)
{
    const size_t handleBytes = captureReplayHandleBytes(device);
    return forDriverGroups(device, pipeline, first, count, [&](uint32_t group, uint32_t groups, uint32_t before) {
        const size_t offset = std::min(before * handleBytes, bytes);
        return device.driver.next.GetRayTracingCaptureReplayShaderGroupHandlesKHR(
            handle, pipeline, group, groups, bytes - offset, static_cast<std::byte *>(data) + offset);
    });
}

VkDeviceSize getShaderGroupStackSize(DevicePipelines &device, VkDevice handle, VkPipeline pipeline, uint32_t group,
                                     VkShaderGroupShaderKHR shader)
{
    const auto record = device.rayTracingPipelines.get(pipeline);
    return device.driver.next.GetRayTracingShaderGroupStackSizeKHR(handle, pipeline,
                                                                   record ? record->driverGroup(group) : group, shader);
}

// The application's size covers its own shaders. In groups without an any-hit shader the layer's runs, one at a time
// and on top of at most the stack that the application has for one hit.
void cmdSetRayTracingPipelineStackSize(DevicePipelines &device, VkCommandBuffer commandBuffer, uint32_t bytes)
{
    const uint32_t own = device.anyHitStack.load();
    device.driver.next.CmdSetRayTracingPipelineStackSizeKHR(commandBuffer,
                                                            bytes > UINT32_MAX - own ? bytes : bytes + own);
}

} // namespace vellum::layer
