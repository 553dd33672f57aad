// Micromap builds, parsed from the structures of either extension and checked. Past this nothing looks at those
// structures again.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "layer/base/input_check.h"
#include "layer/base/vulkan_newer.h"
#include "layer/micromaps/micromap_extent.h"
#include "layer/state/micromap_object.h"

namespace vellum::layer
{

struct AccelerationStructure;
struct DeviceState;
struct Driver;

struct MicromapBuild {
    Micromap target;                                  // none where only sizes are queried
    std::shared_ptr<AccelerationStructure> structure; // the target, in VK_KHR_opacity_micromap
    VkDeviceSize bytes = 0;                           // of the micromap, as the back end reports them; with `structure`
    VkBuildMicromapFlagsEXT flags = 0;                // may hold kLossyBuild
    std::vector<VkMicromapUsageEXT> usages;           // with counts above 0; unknown formats count as 4-state
    MicromapExtent extent;
    VkDeviceOrHostAddressConstKHR data{};
    VkDeviceOrHostAddressConstKHR triangles{};
    VkDeviceSize triangleStride = 0;
    VkDeviceAddress scratch = 0;
};

// What whoever builds micromaps can take.
struct MicromapLimits {
    uint32_t twoStateLevel = 0;
    uint32_t fourStateLevel = 0;
    uint32_t lossyLevel = 0;
    bool takesUnknownFormats = false;
};

// What a build needs: bytes of the micromap and of scratch memory.
struct MicromapBuildSizes {
    VkDeviceSize micromap = 0;
    VkDeviceSize scratch = 0;
};

// The build of a VkMicromapBuildInfoEXT. Nothing, after a message, if even its sizes are unknowable.
std::optional<MicromapBuild> parseMicromapBuild(const InputCheck &check, const VkMicromapBuildInfoEXT &info);
// Finds the target, and checks what device and host builds have in common.
bool checkMicromapBuild(const InputCheck &check, const VkMicromapBuildInfoEXT &info, MicromapBuild &build);

inline bool isMicromapBuild(const VkAccelerationStructureBuildGeometryInfoKHR &info)
{
    return info.type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
}
// The same of VK_KHR_opacity_micromap. `limits`: null if the device has no such micromaps.
std::optional<MicromapBuild> parseMicromapBuild(const Driver &driver, const InputCheck &check,
                                                const VkAccelerationStructureBuildGeometryInfoKHR &info,
                                                const MicromapLimits *limits);
// Finds the target, and checks it and the input.
bool checkMicromapBuild(const DeviceState &objects, const InputCheck &check,
                        const VkAccelerationStructureBuildGeometryInfoKHR &info, const MicromapBuildSizes &sizes,
                        MicromapBuild &build);

// The size of a micromap as queries report it, which tells a GENERIC structure made for it from others.
VkDeviceSize markedMicromapSize(VkDeviceSize bytes);

} // namespace vellum::layer
