// SPDX-License-Identifier: Apache-2.0
// Images that are copied from and to address ranges, and the memory that such a copy accesses.
#pragma once

#include <optional>

#include <vulkan/vulkan.h>

#include "vk/newer.h"

namespace vellum::layer
{

struct DeviceValidation;

struct ValidatedImage {
    VkFormat format = VK_FORMAT_UNDEFINED;
    VkImageCreateFlags flags = 0;
    uint32_t arrayLayers = 0;
};

// A block of texels in memory, of one aspect of a format.
struct TexelBlock {
    uint32_t bytes = 0;
    uint32_t width = 1;
    uint32_t height = 1;
};

bool isDepthStencil(VkFormat format);
bool isMultiPlanar(VkFormat format);
// Nothing for formats that are not known here.
std::optional<TexelBlock> texelBlockOf(VkFormat format, VkImageAspectFlags aspect);

namespace validation
{

VkResult createImage(DeviceValidation &, VkDevice, const VkImageCreateInfo *, const VkAllocationCallbacks *, VkImage *);
void destroyImage(DeviceValidation &, VkDevice, VkImage, const VkAllocationCallbacks *);

} // namespace validation
} // namespace vellum::layer
