#include "cli/renderer/ray_tracing_pipeline.h"

#include <algorithm>
#include <iterator>

#include "shaders/render_rahit.h"
#include "shaders/render_rchit.h"
#include "shaders/render_rgen.h"
#include "shaders/render_rmiss.h"

namespace vellum::cli
{
namespace
{

enum Stage : std::uint32_t { Raygen, Miss, AnyHit, ClosestHit };

// In the order of their records in the shader binding table.
enum Group : std::uint32_t { RaygenGroup, MissGroup, HitGroup, kGroups };

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
    m_mostRays = limits.maxRayDispatchInvocationCount;
    createTable(limits);
}

RayTracingPipeline::~RayTracingPipeline()
{
    vkDestroyPipeline(m_device.handle(), m_pipeline, nullptr);
}

void RayTracingPipeline::create(const TracePipelineInfo &info)
{
    const ShaderStage shaders[] = {{m_device, VK_SHADER_STAGE_RAYGEN_BIT_KHR, render_rgen, info.constants},
                                   {m_device, VK_SHADER_STAGE_MISS_BIT_KHR, render_rmiss, info.constants},
                                   {m_device, VK_SHADER_STAGE_ANY_HIT_BIT_KHR, render_rahit, info.constants},
                                   {m_device, VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, render_rchit, info.constants}};
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
    create.stageCount = static_cast<std::uint32_t>(std::size(stages));
    create.pStages = stages;
    create.groupCount = kGroups;
    create.pGroups = groups;
    create.maxPipelineRayRecursionDepth = 1;
    create.layout = info.layout;
    check(m_device.functions().createRayTracingPipelines(m_device.handle(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &create,
                                                         nullptr, &m_pipeline),
          "creating the pipeline");
}

void RayTracingPipeline::createTable(const VkPhysicalDeviceRayTracingPipelinePropertiesKHR &limits)
{
    const std::uint32_t handleSize = limits.shaderGroupHandleSize;
    std::vector<std::byte> handles(std::size_t{kGroups} * handleSize);
    check(m_device.functions().getRayTracingShaderGroupHandles(m_device.handle(), m_pipeline, 0, kGroups,
                                                               handles.size(), handles.data()),
          "reading shader group handles");
    // One record each, so every record is the base of its region.
    const VkDeviceSize record = alignUp(handleSize, limits.shaderGroupHandleAlignment);
    const VkDeviceSize step = alignUp(record, limits.shaderGroupBaseAlignment);
    std::vector<std::byte> table(kGroups * step);
    for (std::uint32_t i = 0; i < kGroups; ++i)
        std::copy_n(handles.data() + std::size_t{i} * handleSize, handleSize, table.data() + i * step);
    m_table = uploadBuffer(m_device, table,
                           VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
                           limits.shaderGroupBaseAlignment);
    const VkDeviceAddress base = m_table.address(limits.shaderGroupBaseAlignment);
    m_raygen = {base + RaygenGroup * step, record, record};
    m_miss = {base + MissGroup * step, record, record};
    m_hit = {base + HitGroup * step, record, record};
}

void RayTracingPipeline::record(VkCommandBuffer commands, std::uint32_t width, std::uint32_t height) const
{
    if (std::uint64_t{width} * height > m_mostRays)
        throw Error("the picture is too large for the device: it traces at most " + std::to_string(m_mostRays) +
                    " pixels at once");
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, m_pipeline);
    const VkStridedDeviceAddressRegionKHR callable{};
    m_device.functions().cmdTraceRays(commands, &m_raygen, &m_miss, &m_hit, &callable, width, height, 1);
}

} // namespace vellum::cli
