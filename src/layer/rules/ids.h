// SPDX-License-Identifier: Apache-2.0
// Ids of rules that several checks find: validation and the layer's implementation of creation and of pipelines, the
// host and the device.
#pragma once

#include <string_view>

namespace vellum::layer::rules::ids
{

// --- data that only the device knows
inline constexpr const char *kCompactedSize = "VUID-VkCopyAccelerationStructureInfoKHR-mode-12419";
inline constexpr const char *kSerializedSize = "VUID-VkCopyAccelerationStructureToMemoryInfoKHR-dst-03561";
inline constexpr const char *kDeserializedSize = "VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-03746";
inline constexpr const char *kDeserializedMicromaps = "VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-11585";
inline constexpr const char *kCompatible = "VUID-VkCopyMemoryToAccelerationStructureInfoKHR-pInfo-03414";
inline constexpr const char *kDamaged = "VUID-VkCopyMemoryToAccelerationStructureInfoKHR-src-04960";
// The specification has this rule in its text alone: VkAccelerationStructureTrianglesOpacityMicromapEXT.
inline constexpr const char *kAttachedCounts = "VELLUM-attachment-usage-counts";
inline constexpr const char *kReference = "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12281";
inline constexpr const char *kMicromapCompatible = "VUID-VkCopyMemoryToMicromapInfoEXT-src-07549";

// vkCmdBuildAccelerationStructuresIndirectKHR has many rules of vkCmdBuildAccelerationStructuresKHR under ids of its
// own. Checks name those of the direct command. Returns the id for a place, which begins with the name of the command.
const char *idAt(std::string_view place, const char *id);

} // namespace vellum::layer::rules::ids
