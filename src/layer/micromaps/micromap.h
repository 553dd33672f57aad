// SPDX-License-Identifier: Apache-2.0
// Creation of micromaps by VK_EXT_opacity_micromap, and what validation messages name them by.
#pragma once

#include <cstdint>

#include <vulkan/vulkan.h>

#include "layer/command_buffer/gpu_validation_log.h"
#include "layer/state/micromap_object.h"

namespace vellum::layer
{

struct DeviceMicromaps;

// What the validation log names a micromap by.
inline uint64_t findingObject(const Micromap &micromap)
{
    return findingObject(micromap.object.type, micromap.object.handle);
}

VkResult createMicromap(DeviceMicromaps &, VkDevice, const VkMicromapCreateInfoEXT *, const VkAllocationCallbacks *,
                        VkMicromapEXT *);
void destroyMicromap(DeviceMicromaps &, VkDevice, VkMicromapEXT, const VkAllocationCallbacks *);

} // namespace vellum::layer
