// SPDX-License-Identifier: Apache-2.0
#include "render/trace_pipeline.h"

#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>

#include "gpu/pipeline_builder.h"
#include "shaders/render_comp.h"
#include "shaders/render_comp_micromaps.h"
#include "shaders/render_rahit.h"
#include "shaders/render_rchit.h"
#include "shaders/render_rgen.h"
#include "shaders/render_rmiss.h"

namespace vellum::render
{
namespace
{

constexpr VkSpecializationMapEntry kConstants[] = {
    {0, offsetof(TraceConstants, textures), sizeof(TraceConstants::textures)},
    {1, offsetof(TraceConstants, heavyReads), sizeof(TraceConstants::heavyReads)},
    {2, offsetof(TraceConstants, counting), sizeof(TraceConstants::counting)},
    {3, offsetof(TraceConstants, painting), sizeof(TraceConstants::painting)},
    {4, offsetof(TraceConstants, vertexAlphas), sizeof(TraceConstants::vertexAlphas)}};

constexpr uint32_t kGroupEdge = 8; // local size of the compute shader, along both axes

VkSpecializationInfo specializationOf(const TraceConstants &constants)
{
    return {static_cast<uint32_t>(std::size(kConstants)), kConstants, sizeof constants, &constants};
}

// Draws by ray queries: one compute shader, shaders/render.comp.
class QueryPipeline final : public TracePipeline
{
public:
    QueryPipeline(gpu::Device &device, const TracePipelineInfo &info) : device_(device)
    {
        // With VK_EXT_opacity_micromap all ray queries consume micromaps, with VK_KHR_opacity_micromap those of shaders
        // with the execution mode, which is allowed with that extension only.
        const VkShaderModule module = device.shader(
            info.micromaps && device.khr() ? std::span<const uint32_t>(render_comp_micromaps) : render_comp);
        const VkSpecializationInfo specialization = specializationOf(info.constants);
        auto create = vkInit<VkComputePipelineCreateInfo>({.layout = info.layout});
        create.stage = vkInit<VkPipelineShaderStageCreateInfo>({.stage = VK_SHADER_STAGE_COMPUTE_BIT,
                                                                .module = module,
                                                                .pName = "main",
                                                                .pSpecializationInfo = &specialization});
        const VkResult result =
            vkCreateComputePipelines(device.device(), VK_NULL_HANDLE, 1, &create, nullptr, &pipeline_);
        vkDestroyShaderModule(device.device(), module, nullptr);
        gpu::checkResult(result, "vkCreateComputePipelines");
    }
    ~QueryPipeline() override { vkDestroyPipeline(device_.device(), pipeline_, nullptr); }

    void record(VkCommandBuffer commands, uint32_t width, uint32_t height) const override
    {
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline_);
        vkCmdDispatch(commands, (width + kGroupEdge - 1) / kGroupEdge, (height + kGroupEdge - 1) / kGroupEdge, 1);
    }

private:
    gpu::Device &device_;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
};

// Draws by a ray tracing pipeline: the ray generation shader traces and shades, the any-hit shader does the alpha test.
// One hit group serves all geometry; solid geometry is opaque and does not reach the any-hit shader.
class RayTracingPipeline final : public TracePipeline
{
public:
    RayTracingPipeline(gpu::Device &device, const TracePipelineInfo &info)
        : mostRays_(device.pipelineProperties().maxRayDispatchInvocationCount), pipeline_(device, setupOf(info)),
          table_(device, pipeline_, {.raygen = {0, {}}, .miss = {{1, {}}}, .hit = {{2, {}}}, .dataWords = 0})
    {
    }

    void record(VkCommandBuffer commands, uint32_t width, uint32_t height) const override
    {
        if (uint64_t{width} * height > mostRays_)
            throw std::runtime_error("the picture is too large for the device: it traces at most " +
                                     std::to_string(mostRays_) + " pixels at once");
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, pipeline_.handle());
        table_.trace(commands, width, height);
    }

private:
    gpu::PipelineSetup setupOf(const TracePipelineInfo &info)
    {
        constants_ = info.constants;
        specialization_ = specializationOf(constants_);
        gpu::PipelineSetup setup;
        const auto add = [&](VkShaderStageFlagBits stage, std::span<const uint32_t> words) {
            setup.stages.push_back({.stage = stage, .words = words, .specialization = &specialization_});
        };
        add(VK_SHADER_STAGE_RAYGEN_BIT_KHR, render_rgen);
        add(VK_SHADER_STAGE_MISS_BIT_KHR, render_rmiss);
        add(VK_SHADER_STAGE_ANY_HIT_BIT_KHR, render_rahit);
        add(VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, render_rchit);
        setup.groups = {{.general = 0}, {.general = 1}, {.closestHit = 3, .anyHit = 2}};
        setup.layout = info.layout;
        // The bit is the same with either extension.
        setup.flags = info.micromaps ? gpu::kMicromapBit : VkPipelineCreateFlags{0};
        return setup;
    }

    uint32_t mostRays_; // of one vkCmdTraceRaysKHR
    TraceConstants constants_;
    VkSpecializationInfo specialization_{};
    gpu::RayPipeline pipeline_;
    gpu::BindingTable table_;
};

} // namespace

std::vector<Trace> tracesOf(const gpu::DeviceInfo &device)
{
    std::vector<Trace> traces;
    if (device.rayQueries)
        traces.push_back(Trace::Query);
    if (device.rayTracingPipelines)
        traces.push_back(Trace::Pipeline);
    return traces;
}

TraceStages stagesOf(Trace trace)
{
    if (trace == Trace::Query)
        return {VK_PIPELINE_BIND_POINT_COMPUTE, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_SHADER_STAGE_COMPUTE_BIT};
    return {VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, VK_PIPELINE_STAGE_RAY_TRACING_SHADER_BIT_KHR,
            VK_SHADER_STAGE_RAYGEN_BIT_KHR | VK_SHADER_STAGE_ANY_HIT_BIT_KHR | VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR |
                VK_SHADER_STAGE_MISS_BIT_KHR};
}

std::unique_ptr<TracePipeline> makeTracePipeline(gpu::Device &device, Trace trace, const TracePipelineInfo &info)
{
    if (trace == Trace::Query)
        return std::make_unique<QueryPipeline>(device, info);
    return std::make_unique<RayTracingPipeline>(device, info);
}

} // namespace vellum::render
