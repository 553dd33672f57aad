// SPDX-License-Identifier: Apache-2.0
// The rules of builds that the host can check.
#pragma once

#include <span>
#include <vector>

#include "layer/validation/rules/build_input.h"
#include "layer/validation/rules/rule_check.h"

namespace vellum::layer
{

// `commandBuffer`: null for vkBuildMicromapsEXT.
void checkMicromapBuilds(DeviceModel &device, VkCommandBuffer commandBuffer, uint32_t count,
                         const VkMicromapBuildInfoEXT *infos);
void checkMicromapSizeQuery(DeviceModel &device, const VkMicromapBuildInfoEXT &info);

using StructureBuildInfos = std::span<const VkAccelerationStructureBuildGeometryInfoKHR>;
void checkStructureBuilds(DeviceModel &device, VkCommandBuffer commandBuffer, StructureBuildInfos infos,
                          const VkAccelerationStructureBuildRangeInfoKHR *const *ranges);
void checkIndirectStructureBuilds(DeviceModel &device, VkCommandBuffer commandBuffer, StructureBuildInfos infos);
void checkHostStructureBuilds(DeviceModel &device, StructureBuildInfos infos);
void checkStructureSizeQuery(DeviceModel &device, VkAccelerationStructureBuildTypeKHR type,
                             const VkAccelerationStructureBuildGeometryInfoKHR &info, const uint32_t *most);

// --- Parts of these ---

// The memory that one element of a build command writes.
struct BuildMemory {
    ObjectHandle target;
    MemoryRange targetRange;
    MemoryRange scratchRange;
};
// Rules for the memory of several builds by one command.
struct OverlapIds {
    const char *sameTarget; // null: as targets
    const char *targets;
    const char *targetAndScratch;
    const char *scratches;
};
void checkOverlaps(const RuleCheck &command, std::span<const BuildMemory> builds, const OverlapIds &ids);

struct UsageIds {
    const char *arrays;
    const char *format;
    const char *twoStateLevel;
    const char *fourStateLevel;
    const char *lossyLevel;
    const char *lossyFormat;
};
// Returns whether all rules are kept.
bool checkUsages(const RuleCheck &check, const std::vector<VkMicromapUsageEXT> &usages, const UsageIds &ids,
                 const MicromapRuleLimits &limits, bool lossy);

// The usage counts of a build by VK_KHR_opacity_micromap. Returns whether all rules are kept.
bool checkMicromapCounts(const RuleCheck &check, const VkAccelerationStructureBuildGeometryInfoKHR &info,
                         const MicromapBuildInput &build);
// The data of a build by VK_KHR_opacity_micromap. Returns the memory that it writes.
BuildMemory checkMicromapData(const RuleCheck &check, const VkAccelerationStructureBuildGeometryInfoKHR &info,
                              const MicromapBuildInput &build);

// The micromap of a geometry. `primitives`: of that geometry; 0 if the host does not know.
void checkAttachment(const RuleCheck &check, bool indirect, const AttachmentInput &attachment);
// An update, against what the source holds when the command is executed.
void checkUpdate(const RuleCheck &check, bool indirect, const VkAccelerationStructureBuildGeometryInfoKHR &info);

} // namespace vellum::layer
