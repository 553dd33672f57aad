// SPDX-License-Identifier: Apache-2.0
#include "layer/pipelines/pipeline_flags.h"

#include <string>

#include "layer/base/driver.h"

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
    // Also if VkPipelineCreateFlags2CreateInfo replaces them: a driver may reject unknown flags nevertheless.
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

} // namespace vellum::layer
