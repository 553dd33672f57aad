// Flags of pipelines that mean something to the layer only.
#pragma once

#include <deque>

#include <vulkan/vulkan.h>

#include "layer/pnext.h"
#include "layer/vulkan_newer.h"

namespace vellum::layer
{

// Both promise what a pipeline meets. The second needs nothing done.
inline constexpr VkFlags64 kMicromapPipelineFlags =
    VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT | newer::kPipelineDisallowOpacityMicromap;

// A pipeline's pNext chain without them. Copies are kept in `chains`.
const void *driverChain(const void *pNext, std::deque<Chain> &chains);

} // namespace vellum::layer
