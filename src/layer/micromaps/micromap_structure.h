// Micromaps as acceleration structures: the front end of VK_KHR_opacity_micromap. The objects and the work are those of
// VkMicromapEXT (micromap.h); here the KHR structures are checked and translated.
#pragma once

#include <cstdint>

#include "layer/ground/vulkan_newer.h"
#include "layer/micromaps/micromap_input.h"

namespace vellum::layer
{

struct DeviceMicromaps;

void getMicromapStructureSizes(const DeviceMicromaps &device, const VkAccelerationStructureBuildGeometryInfoKHR &info,
                               VkAccelerationStructureBuildSizesInfoKHR &sizes);

// The builds of micromaps among those of one command.
void cmdBuildMicromapStructures(DeviceMicromaps &device, VkCommandBuffer commandBuffer, const char *command,
                                uint32_t count, const VkAccelerationStructureBuildGeometryInfoKHR *infos);

// Copies whose source or target is a micromap: true, and the copy is dealt with. False: it is none of micromaps.
bool copiesMicromapStructure(DeviceMicromaps &device, VkCommandBuffer commandBuffer,
                             const VkCopyAccelerationStructureInfoKHR &info);
bool savesMicromapStructure(DeviceMicromaps &device, VkCommandBuffer commandBuffer,
                            const VkCopyAccelerationStructureToMemoryInfoKHR &info);
bool restoresMicromapStructure(DeviceMicromaps &device, VkCommandBuffer commandBuffer,
                               const VkCopyMemoryToAccelerationStructureInfoKHR &info);

} // namespace vellum::layer
