// SPDX-License-Identifier: Apache-2.0
// The rules of builds of micromaps and acceleration structures, and of queries of their sizes. Each check sets what the
// builds need, and whether they are accepted.
#pragma once

#include "layer/rules/rule.h"

namespace vellum::layer::rules
{

// Scratch memory of micromap builds has at least this alignment on all known drivers.
inline constexpr uint64_t kLeastScratchAlignment = 4;
// The rule of the size of a target: back ends find out what structures other than micromaps need.
inline constexpr const char *kTargetSizeId = "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10126";
// The rule of the size of scratch memory: for structures other than micromaps, validation queries the driver's size.
inline constexpr const char *kScratchSizeId = "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12258";
std::string tooFewBytes(VkDeviceSize available, VkDeviceSize needed);

// Rules of addresses, which validation checks again when a build is executed: the buffers may be destroyed by then.
inline constexpr const char *kExtDataId = "VUID-vkCmdBuildMicromapsEXT-pInfos-10896";
inline constexpr const char *kExtTrianglesId = "VUID-vkCmdBuildMicromapsEXT-pInfos-10897";
inline constexpr const char *kExtScratchId = "VUID-vkCmdBuildMicromapsEXT-pInfos-07512";
inline constexpr const char *kKhrInputId = "VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11550";
inline constexpr const char *kScratchId = "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12261";
inline constexpr const char *kExtIndicesId = "VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10905";
inline constexpr const char *kKhrIndicesId =
    "VUID-VkAccelerationStructureTrianglesOpacityMicromapKHR-indexBuffer-11572";

// The builds of a command on the device, and of vkBuildMicromapsEXT.
void checkBuilds(const RuleDevice &device, const Place &command, input::Builds &builds, const Facts &facts);
// The builds of vkBuildAccelerationStructuresKHR.
void checkHostBuilds(const RuleDevice &device, const Place &command, input::Builds &builds);

// vkGetMicromapBuildSizesEXT, and the structure that vkGetAccelerationStructureBuildSizesKHR is called with.
void checkSizes(const RuleDevice &device, const Place &command, input::Builds &query);
// The other parameters of vkGetAccelerationStructureBuildSizesKHR.
void checkSizeParameters(const RuleDevice &device, const Place &command, const input::Builds &query,
                         VkAccelerationStructureBuildTypeKHR type, bool hasCounts);

} // namespace vellum::layer::rules
