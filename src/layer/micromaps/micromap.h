// SPDX-License-Identifier: Apache-2.0
// Creation of micromaps by VK_EXT_opacity_micromap.
#pragma once

#include <cstdint>

#include <vulkan/vulkan.h>

#include "layer/state/micromap_object.h"

namespace vellum::layer
{

struct DeviceMicromaps;

VkResult createMicromap(DeviceMicromaps &, VkDevice, const VkMicromapCreateInfoEXT *, const VkAllocationCallbacks *,
                        VkMicromapEXT *);
void destroyMicromap(DeviceMicromaps &, VkDevice, VkMicromapEXT, const VkAllocationCallbacks *);

} // namespace vellum::layer
