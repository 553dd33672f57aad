// SPDX-License-Identifier: Apache-2.0
// A compute pipeline with flags of VkPipelineCreateFlags2CreateInfo, which the oldest supported headers do not know.
#pragma once

#include "harness/harness.h"

namespace vt
{

class ComputePipeline
{
public:
    // `inlineModule`: the code is in the stage's chain.
    ComputePipeline(Gpu &gpu, VkPipelineLayout layout, std::span<const uint32_t> words, VkFlags64 flags,
                    bool inlineModule = false)
        : gpu_(gpu)
    {
        const auto flags2 = vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = flags});
        const std::vector<uint32_t> code = gpu.code(words);
        auto inlined =
            vkInit<VkShaderModuleCreateInfo>({.codeSize = code.size() * sizeof(uint32_t), .pCode = code.data()});
        auto info =
            vkInit<VkComputePipelineCreateInfo>({.pNext = &flags2,
                                                 .stage = vkInit<VkPipelineShaderStageCreateInfo>(
                                                     {.pNext = inlineModule ? &inlined : nullptr,
                                                      .stage = VK_SHADER_STAGE_COMPUTE_BIT,
                                                      .module = inlineModule ? VK_NULL_HANDLE : gpu.shader(words),
                                                      .pName = "main"}),
                                                 .layout = layout});
        VT_CHECK(vkCreateComputePipelines(gpu.device(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline_));
        vkDestroyShaderModule(gpu.device(), info.stage.module, nullptr);
    }
    ComputePipeline(const ComputePipeline &) = delete;
    ComputePipeline &operator=(const ComputePipeline &) = delete;
    ~ComputePipeline() { vkDestroyPipeline(gpu_.device(), pipeline_, nullptr); }
    [[nodiscard]] VkPipeline handle() const { return pipeline_; }

private:
    Gpu &gpu_;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
};

} // namespace vt
