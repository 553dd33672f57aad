// SPDX-License-Identifier: Apache-2.0
#include "gpu/programs/marker.h"

#include <utility>

#include "shaders/marker.h"

namespace vellum::gpu
{

Marker::Marker(Device &gpu)
    : gpu_(gpu),
      word_(gpu, sizeof(uint32_t), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT)
{
    const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof(VkDeviceAddress)};
    const auto layout =
        vkInit<VkPipelineLayoutCreateInfo>({.pushConstantRangeCount = 1, .pPushConstantRanges = &range});
    CHECK_VK(vkCreatePipelineLayout(gpu.device(), &layout, nullptr, &layout_));
    const VkShaderModule module = gpu.shader(marker);
    const auto info = vkInit<VkComputePipelineCreateInfo>(
        {.stage = vkInit<VkPipelineShaderStageCreateInfo>(
             {.stage = VK_SHADER_STAGE_COMPUTE_BIT, .module = module, .pName = "main"}),
         .layout = layout_});
    CHECK_VK(vkCreateComputePipelines(gpu.device(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline_));
    vkDestroyShaderModule(gpu.device(), module, nullptr);
}

Marker::~Marker()
{
    vkDestroyPipeline(gpu_.device(), pipeline_, nullptr);
    vkDestroyPipelineLayout(gpu_.device(), layout_, nullptr);
}

void Marker::record(VkCommandBuffer commands) const
{
    const VkDeviceAddress address = word_.address();
    vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline_);
    vkCmdPushConstants(commands, layout_, VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof address, &address);
    vkCmdDispatch(commands, 1, 1, 1);
    barrier(commands);
}

bool Marker::take()
{
    return std::exchange(word_.as<uint32_t>()[0], 0u) != 0;
}

} // namespace vellum::gpu
