// SPDX-License-Identifier: Apache-2.0
// Short names of the flags of micromap builds.
#pragma once

#include <vulkan/vulkan.h>

namespace vt
{

inline constexpr VkBuildMicromapFlagsEXT kAllow = VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
inline constexpr VkBuildMicromapFlagsEXT kTrace = VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT;
inline constexpr VkBuildMicromapFlagsEXT kFast = VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT;

} // namespace vt
