// SPDX-License-Identifier: Apache-2.0
// Creation flags of pipelines and shader objects that concern opacity micromaps.
#pragma once

#include <deque>

#include <vulkan/vulkan.h>

#include "layer/base/pipeline_info.h"
#include "layer/base/pnext.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct Driver;

// All flags about opacity micromaps. Only the first changes what the layer does; the others are promises.
inline constexpr VkFlags64 kMicromapPipelineFlags =
    VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_EXT | VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM |
    VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR;

// The flags of kMicromapPipelineFlags that the driver does not know.
VkFlags64 unknownPipelineFlags(const Driver &driver);

// Removes and adds flags in a create info, with a copy of its VkPipelineCreateFlags2CreateInfo in `chains` if that
// changes. Returns false and reports an error if that structure is behind one of unknown size.
bool changePipelineFlags(const Driver &driver, const void *&pNext, VkPipelineCreateFlags &flags, VkFlags64 removed,
                         VkFlags64 added, std::deque<Chain> &chains, const char *command);

} // namespace vellum::layer
