// SPDX-License-Identifier: Apache-2.0
#include "gpubake/pipelines.h"

#include <span>

#include "shaders/bake_begin.h"
#include "shaders/bake_blocks.h"
#include "shaders/bake_cells.h"
#include "shaders/bake_count.h"
#include "shaders/bake_measure.h"
#include "shaders/bake_params.h"
#include "shaders/bake_place.h"
#include "shaders/bake_plan.h"
#include "shaders/bake_probe.h"
#include "shaders/bake_records.h"
#include "shaders/bake_scan.h"
#include "shaders/bake_write.h"

namespace vellum::gpubake
{
bool Functions::load(VkDevice device, PFN_vkGetDeviceProcAddr getDeviceProcAddr)
{
    if (getDeviceProcAddr == nullptr)
        return false;
#define VELLUM_GPU_BAKE_LOAD(name)                                                                                     \
    name = reinterpret_cast<PFN_vk##name>(getDeviceProcAddr(device, "vk" #name));                                      \
    if (name == nullptr)                                                                                               \
        return false;
    VELLUM_GPU_BAKE_FUNCTIONS(VELLUM_GPU_BAKE_LOAD)
#undef VELLUM_GPU_BAKE_LOAD
    return true;
}

namespace
{

using Code = std::span<const uint32_t>;

// Indexed by Shader.
constexpr std::array<Code, kShaders> kCode = {
    Code(bake_params), Code(bake_begin), Code(bake_cells), Code(bake_blocks),  Code(bake_plan),  Code(bake_count),
    Code(bake_scan),   Code(bake_place), Code(bake_probe), Code(bake_measure), Code(bake_write), Code(bake_records)};

} // namespace

Pipelines::~Pipelines()
{
    if (!loaded_)
        return;
    for (VkPipeline pipeline : pipelines_)
        functions_.DestroyPipeline(device_, pipeline, allocator_);
    functions_.DestroyPipelineLayout(device_, layout_, allocator_);
    functions_.DestroyDescriptorSetLayout(device_, setLayout_, allocator_);
}

VkResult Pipelines::createLayouts()
{
    const VkDescriptorSetLayoutBinding image{0, VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE, 1, VK_SHADER_STAGE_COMPUTE_BIT,
                                             nullptr};
    const VkDescriptorSetLayoutCreateInfo set{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, nullptr, 0, 1,
                                              &image};
    const VkResult result = functions_.CreateDescriptorSetLayout(device_, &set, allocator_, &setLayout_);
    if (result != VK_SUCCESS)
        return result;
    const VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, kPushBytes};
    VkPipelineLayoutCreateInfo layout{};
    layout.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO;
    layout.setLayoutCount = 1;
    layout.pSetLayouts = &setLayout_;
    layout.pushConstantRangeCount = 1;
    layout.pPushConstantRanges = &push;
    return functions_.CreatePipelineLayout(device_, &layout, allocator_, &layout_);
}

VkResult Pipelines::create(PFN_vkGetDeviceProcAddr getDeviceProcAddr, VkPipelineCache cache)
{
    loaded_ = functions_.load(device_, getDeviceProcAddr);
    if (!loaded_)
        return VK_ERROR_INITIALIZATION_FAILED;
    VkResult result = createLayouts();
    for (size_t i = 0; i < kShaders && result == VK_SUCCESS; ++i) {
        const VkShaderModuleCreateInfo code{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, nullptr, 0,
                                            kCode[i].size_bytes(), kCode[i].data()};
        VkShaderModule module = VK_NULL_HANDLE;
        result = functions_.CreateShaderModule(device_, &code, allocator_, &module);
        if (result != VK_SUCCESS)
            break;
        VkComputePipelineCreateInfo info{};
        info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
        info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
        info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
        info.stage.module = module;
        info.stage.pName = "main";
        info.layout = layout_;
        result = functions_.CreateComputePipelines(device_, cache, 1, &info, allocator_, &pipelines_[i]);
        functions_.DestroyShaderModule(device_, module, allocator_);
    }
    return result;
}

} // namespace vellum::gpubake
