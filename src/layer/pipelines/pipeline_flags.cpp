// SPDX-License-Identifier: Apache-2.0
#include "layer/pipelines/pipeline_flags.h"

#include <string>

#include "layer/base/driver.h"
#include "layer/rules/ids.h"

namespace vellum::layer
{

VkFlags64 unknownPipelineFlags(const Driver &driver)
{
    if (driver.emulated())
        return kMicromapPipelineFlags;
    if (!driver.translated())
        return 0;
    return VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR |
           (driver.enabled.pipelineMicromaps ? 0 : VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM);
}

bool changePipelineFlags(const Driver &driver, const void *&pNext, VkPipelineCreateFlags &flags, VkFlags64 removed,
                         VkFlags64 added, std::deque<Chain> &chains, const char *command)
{
    // Also where VkPipelineCreateFlags2CreateInfo replaces them: a driver may reject unknown flags all the same.
    flags = static_cast<VkPipelineCreateFlags>((flags & ~removed) | added);
    const auto *flags2 = findInChain<VkPipelineCreateFlags2CreateInfoKHR>(
        pNext, VK_STRUCTURE_TYPE_PIPELINE_CREATE_FLAGS_2_CREATE_INFO_KHR);
    if (!flags2 || flags2->flags == ((flags2->flags & ~removed) | added))
        return true;
    Chain &chain = chains.emplace_back(pNext);
    auto *own =
        chain.edit<VkPipelineCreateFlags2CreateInfoKHR>(VK_STRUCTURE_TYPE_PIPELINE_CREATE_FLAGS_2_CREATE_INFO_KHR);
    if (!own) {
        driver.report().error("VELLUM-pipeline-flags",
                              std::string(command) + ": VkPipelineCreateFlags2CreateInfo, whose flags the driver must "
                                                     "not get as they are, is behind a structure of unknown size");
        return false;
    }
    own->flags = (own->flags & ~removed) | added;
    pNext = chain.head();
    return true;
}

bool tolerateMixedSpecialIndex(const Driver &driver, const char *id, const char *command)
{
    return driver.report().tolerates(
        id, std::string(command) +
                ": OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX needs the feature micromap, and in a "
                "ray tracing pipeline RAY_TRACING_OPACITY_MICROMAP");
}

bool checkPipelineFlags(const Driver &driver, const void *pNext, VkPipelineCreateFlags flags, const char *id,
                        const char *command)
{
    return (pipelineFlags(pNext, flags) & VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR) ==
               0 ||
           driver.enabled.khrFeature || tolerateMixedSpecialIndex(driver, id, command);
}

bool checkShaderFlags(const Driver &driver, VkShaderCreateInfoEXT &info)
{
    constexpr VkFlags kDisallowMixedShader =
        static_cast<VkFlags>(VK_SHADER_CREATE_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_EXT);
    const bool requested = (info.flags & kDisallowMixedShader) != 0;
    info.flags &= ~kDisallowMixedShader;
    return !requested || driver.enabled.khrFeature ||
           tolerateMixedSpecialIndex(driver, rules::ids::kShaderMixed, "vkCreateShadersEXT");
}

} // namespace vellum::layer
