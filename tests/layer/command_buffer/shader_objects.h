// SPDX-License-Identifier: Apache-2.0
// VK_EXT_shader_object. The types are written out here because the oldest headers this project builds with lack them,
// and so does the validation layer of that age.
#pragma once

#include <cstddef>
#include <vector>

#include "gpu/tracer.h"
#include "harness/harness.h"

#include "shaders/tracer_comp.h"

namespace vt
{

using ShaderHandle = uint64_t; // VkShaderEXT

struct ShaderCreateInfo { // VkShaderCreateInfoEXT
    uint32_t sType = 1000482002;
    const void *pNext = nullptr;
    VkFlags flags = 0;
    VkShaderStageFlagBits stage{};
    VkShaderStageFlags nextStage = 0;
    uint32_t codeType = 1; // VK_SHADER_CODE_TYPE_SPIRV_EXT
    size_t codeSize = 0;
    const void *pCode = nullptr;
    const char *pName = "main";
    uint32_t setLayoutCount = 0;
    const VkDescriptorSetLayout *pSetLayouts = nullptr;
    uint32_t pushConstantRangeCount = 0;
    const VkPushConstantRange *pPushConstantRanges = nullptr;
    const VkSpecializationInfo *pSpecializationInfo = nullptr;
};

using CreateShaders = VkResult(VKAPI_PTR *)(VkDevice, uint32_t, const ShaderCreateInfo *, const VkAllocationCallbacks *,
                                            ShaderHandle *);
using DestroyShader = void(VKAPI_PTR *)(VkDevice, ShaderHandle, const VkAllocationCallbacks *);
using BindShaders = void(VKAPI_PTR *)(VkCommandBuffer, uint32_t, const VkShaderStageFlagBits *, const ShaderHandle *);

// The tracer as a shader object: what `info` points to lives as long as this.
struct TracerShader {
    explicit TracerShader(const Gpu &gpu, const Tracer &tracer, std::span<const uint32_t> words = tracer_comp)
        : setLayout(tracer.setLayout()), code(gpu.code(words))
    {
        info.stage = VK_SHADER_STAGE_COMPUTE_BIT;
        info.codeSize = code.size() * sizeof(uint32_t);
        info.pCode = code.data();
        info.setLayoutCount = 1;
        info.pSetLayouts = &setLayout;
        info.pushConstantRangeCount = 1;
        info.pPushConstantRanges = &range;
    }
    TracerShader(const TracerShader &) = delete;
    TracerShader &operator=(const TracerShader &) = delete;
    VkDescriptorSetLayout setLayout;
    std::vector<uint32_t> code;
    VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, 24}; // that of the tracer's layout
    ShaderCreateInfo info;
};

} // namespace vt
