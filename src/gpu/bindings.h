// SPDX-License-Identifier: Apache-2.0
// What a shader has besides its pipeline: a descriptor set and push constants.
#pragma once

#include "gpu/device.h"

namespace vellum::gpu
{

struct Bindings {
    VkPipelineBindPoint point{};
    VkPipelineLayout layout = VK_NULL_HANDLE;
    VkDescriptorSet set = VK_NULL_HANDLE; // set 0
    VkShaderStageFlags stages = 0;        // stages that use the push constants; all are of the bind point
    std::span<const std::byte> constants; // from offset 0 on
};

// maintenance6: by the commands of VK_KHR_maintenance6, which the device must have.
void recordBindings(const Device &gpu, VkCommandBuffer commands, const Bindings &bindings, bool maintenance6);

} // namespace vellum::gpu
