// SPDX-License-Identifier: Apache-2.0
#include "layer/micromaps/micromap_input.h"

#include "core/align.h"
#include "core/records.h"

namespace vellum::layer
{
namespace
{

using namespace shared;

constexpr VkBuildMicromapFlagsEXT kFlagsExt = VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT |
                                              VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT |
                                              VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;

VkBuildMicromapFlagsEXT flagsOf(const input::MicromapBuild &build)
{
    if (!build.khr)
        return build.flags & kFlagsExt; // kLossyBuild is not among them
    VkBuildMicromapFlagsEXT result = 0;
    if (build.flags & VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR)
        result |= VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT;
    if (build.flags & VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR)
        result |= VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT;
    if (build.flags & VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR)
        result |= VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
    if (build.flags & VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR)
        result |= kLossyBuild;
    return result;
}

} // namespace

MicromapBuild micromapBuildOf(const input::MicromapBuild &given)
{
    MicromapBuild build;
    build.bytes = given.needs.written;
    build.flags = flagsOf(given);
    build.data = given.data;
    build.triangles = given.triangles;
    build.triangleStride = given.triangleStride;
    build.scratch = given.scratch.deviceAddress;
    for (uint32_t i = 0; i < given.usages.size(); ++i) {
        if (given.usages[i].count > 0)
            build.usages.push_back(knownUsage(given.usages[i]));
    }
    build.extent = extentOf(given.usages, build.flags);
    return build;
}

std::optional<input::BuildNeeds> emulatedNeeds(const input::MicromapBuild &build)
{
    const MicromapExtent extent = extentOf(build.usages, flagsOf(build));
    if (!extent.countable())
        return std::nullopt;
    const VkDeviceSize bytes = extent.bytes();
    // Host builds need no scratch memory.
    return input::BuildNeeds{build.khr ? markedMicromapSize(bytes) : alignUp(bytes, 256), bytes,
                             build.host ? 0 : extent.scratchBytes()};
}

VkDeviceSize markedMicromapSize(VkDeviceSize bytes)
{
    return (bytes + 255 - kMicromapSizeMark) / 256 * 256 + kMicromapSizeMark;
}

} // namespace vellum::layer
