// SPDX-License-Identifier: Apache-2.0
#include "cli/renderer/query_pipeline.h"

#include "shaders/render_comp.h"
#include "shaders/render_comp_micromaps.h"

namespace vellum::cli
{
namespace
{

constexpr uint32_t kGroup = 8; // local size of the shader, both ways

} // namespace

QueryPipeline::QueryPipeline(Device &device, const TracePipelineInfo &info) : device_(device)
{
    // With VK_EXT_opacity_micromap all ray queries consume micromaps, with VK_KHR_opacity_micromap those of shaders
    // that declare it, which they may with that extension only.
    const bool declares = info.micromaps && device.micromapApi() == MicromapApi::Khr;
    const ShaderStage shader(device, VK_SHADER_STAGE_COMPUTE_BIT,
                             declares ? std::span<const uint32_t>(render_comp_micromaps) : render_comp, info.constants);
    VkComputePipelineCreateInfo create{};
    create.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
    create.stage = shader.info();
    create.layout = info.layout;
    check(vkCreateComputePipelines(device.handle(), VK_NULL_HANDLE, 1, &create, nullptr, &pipeline_),
          "creating the pipeline");
}

QueryPipeline::~QueryPipeline()
{
    vkDestroyPipeline(device_.handle(), pipeline_, nullptr);
}

void QueryPipeline::record(VkCommandBuffer commands, uint32_t width, uint32_t height) const
{
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline_);
    vkCmdDispatch(commands, (width + kGroup - 1) / kGroup, (height + kGroup - 1) / kGroup, 1);
}

} // namespace vellum::cli
