// SPDX-License-Identifier: Apache-2.0
// Facts that the create info of a pipeline states.
#pragma once

#include "layer/base/pnext.h"
#include "spirv/module/micromap_mode.h"
#include "vk/newer.h"

namespace vellum::layer
{

// The flags of a pipeline: VkPipelineCreateFlags2CreateInfo replaces the create info's own flags.
inline VkFlags64 pipelineFlags(const void *pNext, VkPipelineCreateFlags flags)
{
    const auto *flags2 = findInChain<VkPipelineCreateFlags2CreateInfoKHR>(
        pNext, VK_STRUCTURE_TYPE_PIPELINE_CREATE_FLAGS_2_CREATE_INFO_KHR);
    return flags2 ? flags2->flags : flags;
}

// Returns whether pStages may be read: a pipeline library without shaders ignores it, and it may be invalid. Without
// VkGraphicsPipelineLibraryCreateInfoEXT, a library, and a pipeline that links some, has no shaders of its own.
inline bool hasShaderStages(const VkGraphicsPipelineCreateInfo &info)
{
    const auto *library = findInChain<VkGraphicsPipelineLibraryCreateInfoEXT>(
        info.pNext, VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_LIBRARY_CREATE_INFO_EXT);
    const auto *linked =
        findInChain<VkPipelineLibraryCreateInfoKHR>(info.pNext, VK_STRUCTURE_TYPE_PIPELINE_LIBRARY_CREATE_INFO_KHR);
    const VkGraphicsPipelineLibraryFlagsEXT withShaders =
        VK_GRAPHICS_PIPELINE_LIBRARY_PRE_RASTERIZATION_SHADERS_BIT_EXT |
        VK_GRAPHICS_PIPELINE_LIBRARY_FRAGMENT_SHADER_BIT_EXT;
    if (library)
        return (library->flags & withShaders) != 0;
    return (pipelineFlags(info.pNext, info.flags) & VK_PIPELINE_CREATE_LIBRARY_BIT_KHR) == 0 &&
           (!linked || linked->libraryCount == 0);
}

// SPIR-V's execution model of a stage; nothing for an unknown one.
std::optional<uint32_t> executionModelOf(VkShaderStageFlagBits stage);

// The value of an execution mode's operand with these specialization constants, false without the mode; nothing if it
// is not known.
std::optional<bool> valueOf(const spirv::MicromapMode &mode, const VkSpecializationInfo *constants);

} // namespace vellum::layer
