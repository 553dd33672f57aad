// SPDX-License-Identifier: Apache-2.0
// A build of a micromap by either extension, as the back ends record it: made of an accepted input.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/curve.h"
#include "layer/micromaps/micromap_extent.h"
#include "layer/rules/rule.h"
#include "layer/state/micromap_object.h"
#include "vk/newer.h"

namespace vellum::layer
{

struct AccelerationStructure;

// The builds that emulation supports.
inline constexpr MicromapSupport kEmulatedSupport{{shared::kMaxSubdivisionLevel, shared::kMaxSubdivisionLevel,
                                                   shared::kMaxSubdivisionLevel, shared::kMaxMicromapTriangles},
                                                  true};

struct MicromapBuild {
    Micromap target;                                  // null for a query of sizes
    std::shared_ptr<AccelerationStructure> structure; // the target, in VK_KHR_opacity_micromap
    VkDeviceSize bytes = 0;                           // the most that the build writes
    VkBuildMicromapFlagsEXT flags = 0;                // may hold kLossyBuild
    std::vector<VkMicromapUsageEXT> usages;           // only counts above 0; unknown formats count as 4-state
    MicromapExtent extent;
    VkDeviceOrHostAddressConstKHR data{};
    VkDeviceOrHostAddressConstKHR triangles{};
    VkDeviceSize triangleStride = 0;
    VkDeviceAddress scratch = 0;
};
// The build without its target.
MicromapBuild micromapBuildOf(const input::MicromapBuild &given);
// The memory that an emulated build needs; nullopt: its shaders cannot count its triangles or units.
std::optional<input::BuildNeeds> emulatedNeeds(const input::MicromapBuild &build);

// The size of a micromap as queries report it. It marks GENERIC structures that are created for micromaps.
VkDeviceSize markedMicromapSize(VkDeviceSize bytes);

// A VkMicromapEXT, as rules see it.
inline ObjectFacts micromapFacts(ObjectHandle handle)
{
    const auto *micromap = reinterpret_cast<const Micromap *>(handle.handle);
    return {.exists = micromap != nullptr,
            .type = VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR,
            .size = micromap ? micromap->size : 0};
}

} // namespace vellum::layer
