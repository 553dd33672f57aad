// SPDX-License-Identifier: Apache-2.0
// Builds of micromaps on the device, and the commands of VK_EXT_opacity_micromap for them; the command of
// VK_KHR_opacity_micromap is in structures/structure_commands.h.
#pragma once

#include <cstdint>
#include <span>

#include <vulkan/vulkan.h>

#include "layer/micromaps/micromap_input.h"
#include "layer/state/micromap_object.h"

namespace vellum::layer
{

struct DeviceMicromaps;

// Records builds that have been checked, whichever extension they came by.
void recordMicromapBuilds(DeviceMicromaps &device, VkCommandBuffer commandBuffer,
                          std::span<const MicromapBuild> builds);

void getMicromapBuildSizes(DeviceMicromaps &, VkDevice, VkAccelerationStructureBuildTypeKHR,
                           const VkMicromapBuildInfoEXT *, VkMicromapBuildSizesInfoEXT *);
void cmdBuildMicromaps(DeviceMicromaps &, VkCommandBuffer, uint32_t, const VkMicromapBuildInfoEXT *);

// Creation of micromaps by VK_EXT_opacity_micromap.
VkResult createMicromap(DeviceMicromaps &, VkDevice, const VkMicromapCreateInfoEXT *, const VkAllocationCallbacks *,
                        VkMicromapEXT *);
void destroyMicromap(DeviceMicromaps &, VkDevice, VkMicromapEXT, const VkAllocationCallbacks *);

} // namespace vellum::layer
