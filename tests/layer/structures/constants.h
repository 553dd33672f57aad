// SPDX-License-Identifier: Apache-2.0
// Short names of constants for acceleration structures.
#pragma once

#include <vulkan/vulkan.h>

#include "vellum/vulkan_opacity_micromap.h"

namespace vt
{

inline constexpr auto kBottom = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
inline constexpr auto kTop = VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR;
inline constexpr auto kGeneric = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
inline constexpr auto kMicromapType = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;

inline constexpr VkBuildAccelerationStructureFlagsKHR kCompactable =
    VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR;
inline constexpr VkBuildAccelerationStructureFlagsKHR kUpdatable = VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR;

inline constexpr auto kUpdate = VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
inline constexpr auto kClone = VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR;
inline constexpr auto kCompact = VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR;

} // namespace vt
