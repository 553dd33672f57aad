#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

constexpr VkDeviceSize alignUp(VkDeviceSize value, VkDeviceSize alignment)
{
    return (value + alignment - 1) / alignment * alignment;
}

} // namespace vellum::layer
