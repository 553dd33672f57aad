// Whether the driver carries unused ray flag bits through a ray query (spirv/rewrite.h needs three). Found out by
// tracing one ray when the device is made, never by the driver's name.
#pragma once

#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct Device;

// True where the bits come back and change no hit; also where the application enabled no ray queries, so that nothing
// depends on it. `info` as the application passed it to vkCreateDevice.
bool carriesRayFlagBits(Device &device, const VkDeviceCreateInfo &info, PFN_vkSetDeviceLoaderData setLoaderData);

} // namespace vellum::layer
