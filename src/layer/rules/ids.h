// SPDX-License-Identifier: Apache-2.0
// Ids of rules that several checks find: validation and the layer's implementation of creation and of pipelines, the
// host and the device.
#pragma once

namespace vellum::layer::rules::ids
{

// --- creation
inline constexpr const char *kCreationRangeEmpty = "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11608";
inline constexpr const char *kCreationRangeUnknown = "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11602";
inline constexpr const char *kCreationRangeUsage = "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11603";
inline constexpr const char *kCreationRangeAlignment = "VUID-VkAccelerationStructureCreateInfo2KHR-addressRange-11605";
inline constexpr const char *kCreationFeature = "VUID-VkAccelerationStructureCreateInfo2KHR-micromap-11609";
inline constexpr const char *kCreationCommand = "VUID-VkAccelerationStructureCreateInfoKHR-type-11600";
inline constexpr const char *kMicromapReplay = "VUID-VkMicromapCreateInfoEXT-micromapCaptureReplay-11616";
inline constexpr const char *kMicromapAddress = "VUID-VkMicromapCreateInfoEXT-deviceAddress-07433";
inline constexpr const char *kMicromapRange = "VUID-VkMicromapCreateInfoEXT-offset-07437";
inline constexpr const char *kMicromapOffset = "VUID-VkMicromapCreateInfoEXT-offset-07438";

// --- pipelines and shader objects
inline constexpr const char *kComputeMixed = "VUID-VkComputePipelineCreateInfo-flags-11593";
inline constexpr const char *kGraphicsMixed = "VUID-VkGraphicsPipelineCreateInfo-flags-11595";
inline constexpr const char *kRayTracingFeature = "VUID-VkRayTracingPipelineCreateInfoKHR-flags-11597";
inline constexpr const char *kRayTracingMixed = "VUID-VkRayTracingPipelineCreateInfoKHR-flags-11599";
inline constexpr const char *kRayTracingLibraries = "VUID-VkRayTracingPipelineCreateInfoKHR-pLibraries-11598";
inline constexpr const char *kShaderMixed = "VUID-VkShaderCreateInfoEXT-micromap-11623";

// --- data that only the device knows
inline constexpr const char *kCompactedSize = "VUID-VkCopyAccelerationStructureInfoKHR-mode-12419";
inline constexpr const char *kSerializedSize = "VUID-VkCopyAccelerationStructureToMemoryInfoKHR-dst-03561";
inline constexpr const char *kDeserializedSize = "VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-03746";
inline constexpr const char *kDeserializedMicromaps = "VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-11585";
inline constexpr const char *kCompatible = "VUID-VkCopyMemoryToAccelerationStructureInfoKHR-pInfo-03414";
inline constexpr const char *kDamaged = "VUID-VkCopyMemoryToAccelerationStructureInfoKHR-src-04960";
inline constexpr const char *kMicromapCompatible = "VUID-VkCopyMemoryToMicromapInfoEXT-src-07549";

} // namespace vellum::layer::rules::ids
