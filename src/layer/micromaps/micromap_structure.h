// Micromaps as acceleration structures: the front end of VK_KHR_opacity_micromap. The objects and the work are those of
// VkMicromapEXT (micromap.h); here the KHR structures are checked and translated.
#pragma once

#include <cstdint>
#include <memory>

#include "layer/ground/vulkan_newer.h"

namespace vellum::layer
{

struct AccelerationStructure;
struct Device;

// Whether a build is one of a micromap.
inline bool isMicromapBuild(const VkAccelerationStructureBuildGeometryInfoKHR &info)
{
    return info.type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
}

// Whether a structure is a micromap, or a GENERIC one that something of a micromap was recorded into last.
bool holdsMicromap(AccelerationStructure &structure);
// The micromap that a structure is, or that a GENERIC one is taken for.
VkMicromapEXT micromapIn(AccelerationStructure &structure);
// The micromap of a handle that a geometry names; null, where it is no micromap.
VkMicromapEXT micromapOf(const Device &device, VkAccelerationStructureKHR structure);

// Serialized structures may name the micromap that a structure is or may become, by the address of its memory.
void letMicromapBeNamed(Device &device, AccelerationStructure &structure);
// The same of one that vkCreateAccelerationStructureKHR has made: now, or when its buffer gets memory.
void letMicromapBeNamedOnceBound(Device &device, const std::shared_ptr<AccelerationStructure> &structure);
void bufferHasAddress(Device &device, VkBuffer buffer);

void getMicromapStructureSizes(const Device &device, const VkAccelerationStructureBuildGeometryInfoKHR &info,
                               VkAccelerationStructureBuildSizesInfoKHR &sizes);

// The builds of micromaps among those of one vkCmdBuildAccelerationStructuresKHR.
void cmdBuildMicromapStructures(VkCommandBuffer commandBuffer, uint32_t count,
                                const VkAccelerationStructureBuildGeometryInfoKHR *infos);

// Copies whose source or target is a micromap: true, and the copy is dealt with. False: it is none of micromaps.
bool copiesMicromapStructure(Device &device, VkCommandBuffer commandBuffer,
                             const VkCopyAccelerationStructureInfoKHR &info);
bool savesMicromapStructure(Device &device, VkCommandBuffer commandBuffer,
                            const VkCopyAccelerationStructureToMemoryInfoKHR &info);
bool restoresMicromapStructure(Device &device, VkCommandBuffer commandBuffer,
                               const VkCopyMemoryToAccelerationStructureInfoKHR &info);

VKAPI_ATTR VkResult VKAPI_CALL createAccelerationStructure2(VkDevice, const VkAccelerationStructureCreateInfo2KHR *,
                                                            const VkAllocationCallbacks *,
                                                            VkAccelerationStructureKHR *);

} // namespace vellum::layer
