// SPDX-License-Identifier: Apache-2.0
#include "cli/renderer/ray_tracing_pipeline.h"

#include <algorithm>
#include <iterator>

#include "core/align.h"
#include "shaders/render_rahit.h"
#include "shaders/render_rchit.h"
#include "shaders/render_rgen.h"
#include "shaders/render_rmiss.h"

namespace vellum::cli
{
namespace
{

enum Stage : uint32_t { Raygen, Miss, AnyHit, ClosestHit };

// In the order of their records in the shader binding table.
enum Group : uint32_t { RaygenGroup, MissGroup, HitGroup, kGroups };

VkRayTracingShaderGroupCreateInfoKHR emptyGroup(VkRayTracingShaderGroupTypeKHR type)
{
    return {VK_STRUCTURE_TYPE_RAY_TRACING_SHADER_GROUP_CREATE_INFO_KHR,
            nullptr,
            type,
            VK_SHADER_UNUSED_KHR,
            VK_SHADER_UNUSED_KHR,
            VK_SHADER_UNUSED_KHR,
            VK_SHADER_UNUSED_KHR,
            nullptr};
}

VkPhysicalDeviceRayTracingPipelinePropertiesKHR limitsOf(VkPhysicalDevice device)
{
    VkPhysicalDeviceRayTracingPipelinePropertiesKHR limits{};
    limits.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_PROPERTIES_KHR;
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &limits, {}};
    vkGetPhysicalDeviceProperties2(device, &properties);
    return limits;
}

} // namespace

// Delegates, so that the destructor also runs where this throws.
RayTracingPipeline::RayTracingPipeline(Device &device, const TracePipelineInfo &info) : RayTracingPipeline(device)
{
    create(info);
    const VkPhysicalDeviceRayTracingPipelinePropertiesKHR limits = limitsOf(device.info().handle);
    mostRays_ = limits.maxRayDispatchInvocationCount;
    createTable(limits);
}

RayTracingPipeline::~RayTracingPipeline()
{
    vkDestroyPipeline(device_.handle(), pipeline_, nullptr);
}

void RayTracingPipeline::create(const TracePipelineInfo &info)
{
    const ShaderStage shaders[] = {{device_, VK_SHADER_STAGE_RAYGEN_BIT_KHR, render_rgen, info.constants},
                                   {device_, VK_SHADER_STAGE_MISS_BIT_KHR, render_rmiss, info.constants},
                                   {device_, VK_SHADER_STAGE_ANY_HIT_BIT_KHR, render_rahit, info.constants},
                                   {device_, VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, render_rchit, info.constants}};
    VkPipelineShaderStageCreateInfo stages[std::size(shaders)];
    std::transform(std::begin(shaders), std::end(shaders), stages, [](const ShaderStage &s) { return s.info(); });

    VkRayTracingShaderGroupCreateInfoKHR groups[kGroups];
    groups[RaygenGroup] = emptyGroup(VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR);
    groups[RaygenGroup].generalShader = Raygen;
    groups[MissGroup] = emptyGroup(VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR);
    groups[MissGroup].generalShader = Miss;
    groups[HitGroup] = emptyGroup(VK_RAY_TRACING_SHADER_GROUP_TYPE_TRIANGLES_HIT_GROUP_KHR);
    groups[HitGroup].anyHitShader = AnyHit;
    groups[HitGroup].closestHitShader = ClosestHit;

    VkRayTracingPipelineCreateInfoKHR create{};
    create.sType = VK_STRUCTURE_TYPE_RAY_TRACING_PIPELINE_CREATE_INFO_KHR;
    // The same bit with either extension.
    create.flags = info.micromaps ? VkPipelineCreateFlags{VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT} : 0u;
    create.stageCount = static_cast<uint32_t>(std::size(stages));
    create.pStages = stages;
    create.groupCount = kGroups;
    create.pGroups = groups;
    create.maxPipelineRayRecursionDepth = 1;
    create.layout = info.layout;
    check(device_.functions().createRayTracingPipelines(device_.handle(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &create,
                                                        nullptr, &pipeline_),
          "creating the pipeline");
}

void RayTracingPipeline::createTable(const VkPhysicalDeviceRayTracingPipelinePropertiesKHR &limits)
{
    const uint32_t handleSize = limits.shaderGroupHandleSize;
    std::vector<std::byte> handles(size_t{kGroups} * handleSize);
    check(device_.functions().getRayTracingShaderGroupHandles(device_.handle(), pipeline_, 0, kGroups, handles.size(),
                                                              handles.data()),
          "reading shader group handles");
    // One record each, so every record is the base of its region.
    const VkDeviceSize record = alignUp(handleSize, limits.shaderGroupHandleAlignment);
    const VkDeviceSize step = alignUp(record, limits.shaderGroupBaseAlignment);
    std::vector<std::byte> table(kGroups * step);
    for (uint32_t i = 0; i < kGroups; ++i)
        std::copy_n(handles.data() + size_t{i} * handleSize, handleSize, table.data() + i * step);
    table_ = uploadBuffer(device_, table,
                          VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
                          limits.shaderGroupBaseAlignment);
    const VkDeviceAddress base = table_.address(limits.shaderGroupBaseAlignment);
    raygen_ = {base + RaygenGroup * step, record, record};
    miss_ = {base + MissGroup * step, record, record};
    hit_ = {base + HitGroup * step, record, record};
}

void RayTracingPipeline::record(VkCommandBuffer commands, uint32_t width, uint32_t height) const
{
    if (uint64_t{width} * height > mostRays_)
        throw Error("the picture is too large for the device: it traces at most " + std::to_string(mostRays_) +
                    " pixels at once");
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, pipeline_);
    const VkStridedDeviceAddressRegionKHR callable{};
    device_.functions().cmdTraceRays(commands, &raygen_, &miss_, &hit_, &callable, width, height, 1);
}

} // namespace vellum::cli
