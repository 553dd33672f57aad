// Builds of micromaps as VK_KHR_opacity_micromap puts them: what is wrong with them, and the same builds as
// VK_EXT_opacity_micromap puts them. For the layer's micromaps and for those of a driver that has only EXT.
#pragma once

#include <cstdint>
#include <vector>

#include "layer/ground/judge.h"
#include "layer/ground/vulkan_newer.h"

namespace vellum::layer
{

class AddressMap;
struct Driver;

// Whether a build is one of a micromap.
inline bool isMicromapBuild(const VkAccelerationStructureBuildGeometryInfoKHR &info)
{
    return info.type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
}

// What the geometry of such a build has to say; null where it is missing.
const VkAccelerationStructureGeometryMicromapDataKHR *
micromapDataOf(const VkAccelerationStructureBuildGeometryInfoKHR &info);

// A build as VK_EXT_opacity_micromap puts it. Points into itself. The flags may hold kLossyBuild (micromap_extent.h).
struct TranslatedMicromapBuild {
    TranslatedMicromapBuild(const VkAccelerationStructureBuildGeometryInfoKHR &khr,
                            const VkAccelerationStructureGeometryMicromapDataKHR &data, VkMicromapEXT target);
    TranslatedMicromapBuild(TranslatedMicromapBuild &&) = default;
    TranslatedMicromapBuild(const TranslatedMicromapBuild &) = delete;
    TranslatedMicromapBuild &operator=(const TranslatedMicromapBuild &) = delete;
    TranslatedMicromapBuild &operator=(TranslatedMicromapBuild &&) = delete;
    VkMicromapBuildInfoEXT info;
    std::vector<VkMicromapUsageEXT> usages;
};

// Of whoever builds micromaps.
struct MicromapLimits {
    uint32_t twoStateLevel = 0;
    uint32_t fourStateLevel = 0;
    uint32_t lossyLevel = 0;
    // Whether builds with unknown formats can be carried out. The layer's can.
    bool takesUnknownFormats = false;
};
// Whether the sizes of a build may be told.
bool mayMeasureMicromap(const Driver &driver, const Judge &judge,
                        const VkAccelerationStructureBuildGeometryInfoKHR &info, const MicromapLimits &limits);

// Whether the addresses of a build with triangles can be used: of its input, and of so many bytes of scratch memory.
bool mayReadInput(const AddressMap &addresses, const Judge &judge,
                  const VkAccelerationStructureBuildGeometryInfoKHR &info, VkDeviceSize scratchBytes);

// The least size of a micromap that is told to applications, so that a GENERIC structure made for it is known.
VkDeviceSize markedMicromapSize(VkDeviceSize bytes);

} // namespace vellum::layer
