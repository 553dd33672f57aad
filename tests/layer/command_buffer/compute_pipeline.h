// A compute pipeline with flags of VkPipelineCreateFlags2CreateInfo, which the oldest supported headers do not know.
#pragma once

#include "harness/harness.h"

namespace vt
{

// VkPipelineCreateFlags2CreateInfo (VK_KHR_maintenance5).
struct PipelineFlags2 {
    VkStructureType sType = static_cast<VkStructureType>(1000470005);
    const void *pNext = nullptr;
    VkFlags64 flags = 0;
};

class ComputePipeline
{
public:
    // `inlineModule`: the code is in the stage's chain.
    ComputePipeline(Gpu &gpu, VkPipelineLayout layout, std::span<const uint32_t> words, VkFlags64 flags,
                    bool inlineModule = false)
        : gpu_(gpu)
    {
        const PipelineFlags2 flags2{.flags = flags};
        const std::vector<uint32_t> code = gpu.code(words);
        VkShaderModuleCreateInfo inlined{};
        inlined.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
        inlined.codeSize = code.size() * sizeof(uint32_t);
        inlined.pCode = code.data();
        VkComputePipelineCreateInfo info{};
        info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
        info.pNext = &flags2;
        info.layout = layout;
        info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
        info.stage.pNext = inlineModule ? &inlined : nullptr;
        info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
        info.stage.module = inlineModule ? VK_NULL_HANDLE : gpu.shader(words);
        info.stage.pName = "main";
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
