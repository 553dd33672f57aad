// SPDX-License-Identifier: Apache-2.0
#include "cli/renderer/trace_pipeline.h"

#include <cstddef>
#include <iterator>

#include "cli/renderer/query_pipeline.h"
#include "cli/renderer/ray_tracing_pipeline.h"

namespace vellum::cli
{
namespace
{

constexpr VkSpecializationMapEntry kConstants[] = {
    {0, offsetof(TraceConstants, textures), sizeof(TraceConstants::textures)},
    {1, offsetof(TraceConstants, heavyReads), sizeof(TraceConstants::heavyReads)},
    {2, offsetof(TraceConstants, counting), sizeof(TraceConstants::counting)},
    {3, offsetof(TraceConstants, painting), sizeof(TraceConstants::painting)},
    {4, offsetof(TraceConstants, vertexAlphas), sizeof(TraceConstants::vertexAlphas)}};

} // namespace

TraceStages stagesOf(Trace trace)
{
    if (trace == Trace::Query)
        return {VK_PIPELINE_BIND_POINT_COMPUTE, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_SHADER_STAGE_COMPUTE_BIT};
    return {VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, VK_PIPELINE_STAGE_RAY_TRACING_SHADER_BIT_KHR,
            VK_SHADER_STAGE_RAYGEN_BIT_KHR | VK_SHADER_STAGE_ANY_HIT_BIT_KHR | VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR |
                VK_SHADER_STAGE_MISS_BIT_KHR};
}

std::unique_ptr<TracePipeline> makeTracePipeline(Device &device, Trace trace, const TracePipelineInfo &info)
{
    if (trace == Trace::Query)
        return std::make_unique<QueryPipeline>(device, info);
    return std::make_unique<RayTracingPipeline>(device, info);
}

ShaderStage::ShaderStage(Device &device, VkShaderStageFlagBits stage, std::span<const uint32_t> code,
                         const TraceConstants &constants)
    : device_(device.handle()), stage_(stage), specialization_{static_cast<uint32_t>(std::size(kConstants)), kConstants,
                                                               sizeof(constants), &constants}
{
    const VkShaderModuleCreateInfo info{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, nullptr, 0, code.size_bytes(),
                                        code.data()};
    check(vkCreateShaderModule(device_, &info, nullptr, &module_), "creating a shader module");
}

ShaderStage::~ShaderStage()
{
    vkDestroyShaderModule(device_, module_, nullptr);
}

VkPipelineShaderStageCreateInfo ShaderStage::info() const
{
    return {VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO, nullptr, 0, stage_, module_, "main", &specialization_};
}

} // namespace vellum::cli
