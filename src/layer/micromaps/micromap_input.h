// SPDX-License-Identifier: Apache-2.0
// Micromap builds, parsed from the structures of either extension and checked. Nothing after this reads those
// structures.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "layer/base/input_check.h"
#include "layer/micromaps/micromap_extent.h"
#include "layer/state/micromap_object.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct AccelerationStructure;
struct DeviceState;
struct Driver;

struct MicromapBuild {
    Micromap target;                                  // null for a query of sizes
    std::shared_ptr<AccelerationStructure> structure; // the target, in VK_KHR_opacity_micromap
    VkDeviceSize bytes = 0;                           // of the micromap, as the back end reports them; with `structure`
    VkBuildMicromapFlagsEXT flags = 0;                // may hold kLossyBuild
    std::vector<VkMicromapUsageEXT> usages;           // only counts above 0; unknown formats count as 4-state
    MicromapExtent extent;
    VkDeviceOrHostAddressConstKHR data{};
    VkDeviceOrHostAddressConstKHR triangles{};
    VkDeviceSize triangleStride = 0;
    VkDeviceAddress scratch = 0;
};

// The limits of a back end's micromaps.
struct MicromapLimits {
    uint32_t twoStateLevel = 0;
    uint32_t fourStateLevel = 0;
    uint32_t lossyLevel = 0;
    bool takesUnknownFormats = false;
};

// Bytes of the micromap and of scratch memory that a build needs.
struct MicromapBuildSizes {
    VkDeviceSize micromap = 0;
    VkDeviceSize scratch = 0;
};

// The build of a VkMicromapBuildInfoEXT. nullopt, after a message, if its sizes cannot be computed.
std::optional<MicromapBuild> parseMicromapBuild(const InputCheck &check, const VkMicromapBuildInfoEXT &info);
// The rules that device and host builds have in common.
struct MicromapBuildRules {
    const char *mode;
    const char *target;
    const char *size;
};
inline constexpr MicromapBuildRules kDeviceBuildRules{"VELLUM-VUID-vkCmdBuildMicromapsEXT-mode-07462",
                                                      "VELLUM-VUID-vkCmdBuildMicromapsEXT-dstMicromap-07463",
                                                      "VELLUM-VUID-vkCmdBuildMicromapsEXT-pInfos-07461"};
inline constexpr MicromapBuildRules kHostBuildRules{"VELLUM-VUID-vkBuildMicromapsEXT-mode-07462",
                                                    "VELLUM-VUID-vkBuildMicromapsEXT-dstMicromap-07463",
                                                    "VELLUM-VUID-vkBuildMicromapsEXT-pInfos-07461"};
// Finds the target, and checks these rules.
bool checkMicromapBuild(const InputCheck &check, const MicromapBuildRules &rules, const VkMicromapBuildInfoEXT &info,
                        MicromapBuild &build);

inline bool isMicromapBuild(const VkAccelerationStructureBuildGeometryInfoKHR &info)
{
    return info.type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
}
// The same for VK_KHR_opacity_micromap. `limits`: null if the device has no such micromaps.
std::optional<MicromapBuild> parseMicromapBuild(const Driver &driver, const InputCheck &check,
                                                const VkAccelerationStructureBuildGeometryInfoKHR &info,
                                                const MicromapLimits *limits);
// Finds the target, and checks it and the input.
bool checkMicromapBuild(const DeviceState &objects, const InputCheck &check,
                        const VkAccelerationStructureBuildGeometryInfoKHR &info, const MicromapBuildSizes &sizes,
                        MicromapBuild &build);

// The size of a micromap as queries report it. It marks GENERIC structures that are created for micromaps.
VkDeviceSize markedMicromapSize(VkDeviceSize bytes);

} // namespace vellum::layer
