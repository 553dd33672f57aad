#include "layer/pipelines/pipeline_flags.h"

#include <string>

#include "layer/base/driver.h"

namespace vellum::layer
{

VkFlags64 pipelineFlags(const void *pNext, VkPipelineCreateFlags flags)
{
    const auto *flags2 =
        findInChain<newer::PipelineCreateFlags2CreateInfo>(pNext, newer::kPipelineCreateFlags2CreateInfo);
    return flags2 ? flags2->flags : flags;
}

bool toleratesMixedSpecialIndex(const Driver &driver, const char *id, const char *command)
{
    return driver.report().tolerates(
        id, std::string(command) +
                ": OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX needs the feature micromap, and in a "
                "ray tracing pipeline RAY_TRACING_OPACITY_MICROMAP");
}

bool takeMixedSpecialIndex(const Driver &driver, newer::ShaderCreateInfo &info)
{
    constexpr VkFlags kDisallowMixedShader =
        static_cast<VkFlags>(VK_SHADER_CREATE_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_EXT);
    const bool asked = (info.flags & kDisallowMixedShader) != 0;
    info.flags &= ~kDisallowMixedShader;
    return !asked || driver.enabled.khrFeature ||
           toleratesMixedSpecialIndex(driver, "VELLUM-VUID-VkShaderCreateInfoEXT-micromap-11623", "vkCreateShadersEXT");
}

bool hasShaderStages(const VkGraphicsPipelineCreateInfo &info)
{
    const auto *library = findInChain<VkGraphicsPipelineLibraryCreateInfoEXT>(
        info.pNext, VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_LIBRARY_CREATE_INFO_EXT);
    const VkGraphicsPipelineLibraryFlagsEXT withShaders =
        VK_GRAPHICS_PIPELINE_LIBRARY_PRE_RASTERIZATION_SHADERS_BIT_EXT |
        VK_GRAPHICS_PIPELINE_LIBRARY_FRAGMENT_SHADER_BIT_EXT;
    return !library || (library->flags & withShaders) != 0;
}

bool mayHaveFlags(const Driver &driver, const void *pNext, VkPipelineCreateFlags flags, const char *id,
                  const char *command)
{
    return (pipelineFlags(pNext, flags) & VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR) ==
               0 ||
           driver.enabled.khrFeature || toleratesMixedSpecialIndex(driver, id, command);
}

bool hideMicromapFlags(const Driver &driver, const void *&pNext, std::deque<Chain> &chains, const char *command)
{
    const auto *flags2 =
        findInChain<newer::PipelineCreateFlags2CreateInfo>(pNext, newer::kPipelineCreateFlags2CreateInfo);
    if (!flags2 || (flags2->flags & kMicromapPipelineFlags) == 0)
        return true;
    Chain &chain = chains.emplace_back(pNext);
    auto *own = chain.edit<newer::PipelineCreateFlags2CreateInfo>(newer::kPipelineCreateFlags2CreateInfo);
    if (!own) {
        driver.report().error("VELLUM-pipeline-flags",
                              std::string(command) +
                                  ": VkPipelineCreateFlags2CreateInfo, with flags that the driver does not know, lies "
                                  "behind a structure of unknown size");
        return false;
    }
    own->flags &= ~kMicromapPipelineFlags;
    pNext = chain.head();
    return true;
}

} // namespace vellum::layer
