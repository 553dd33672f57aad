// Flags of pipelines that mean something to the layer only.
#pragma once

#include <deque>

#include <vulkan/vulkan.h>

#include "layer/base/pnext.h"
#include "layer/base/vulkan_newer.h"

namespace vellum::layer
{

struct Driver;

// They promise what a pipeline meets. Only the first needs something done.
inline constexpr VkFlags64 kMicromapPipelineFlags =
    VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT | newer::kPipelineDisallowOpacityMicromap |
    VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR;

// Of all kinds of pipelines: VkPipelineCreateFlags2CreateInfo wins over the structure's own flags.
VkFlags64 pipelineFlags(const void *pNext, VkPipelineCreateFlags flags);

// Tells of the promise of no mixed special indices where it may not be made. It does no harm there; whether the object
// may be made.
bool toleratesMixedSpecialIndex(const Driver &driver, const char *id, const char *command);
// Takes the flag of a shader object away that only the layer knows; false, after a message, where it may not be there.
bool takeMixedSpecialIndex(const Driver &driver, newer::ShaderCreateInfo &info);

// The same of a compute or graphics pipeline with these flags.
bool mayHaveFlags(const Driver &driver, const void *pNext, VkPipelineCreateFlags flags, const char *id,
                  const char *command);

// pStages is ignored, and may be anything, for a pipeline library without the parts that have shaders.
bool hasShaderStages(const VkGraphicsPipelineCreateInfo &info);

// Takes them out of a pipeline's pNext chain; copies are kept in `chains`. Returns false, after a message, where they
// lie behind a structure of unknown size.
bool hideMicromapFlags(const Driver &driver, const void *&pNext, std::deque<Chain> &chains, const char *command);

} // namespace vellum::layer
