// Whether the driver carries unused ray flag bits through a ray query and through traceRay (spirv/rewrite.h needs
// three). Found out by tracing one ray each way when the device is made, never by the driver's name.
#pragma once

#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct DevicePipelines;

// True where the bits come back and change no hit; also where the application did not enable that way of tracing, so
// that nothing depends on it.
struct CarriedRayFlagBits {
    bool inQueries = true;
    bool inPipelines = true;
};
// `info` as the application passed it to vkCreateDevice.
CarriedRayFlagBits probeRayFlagBits(DevicePipelines &device, const VkDeviceCreateInfo &info,
                                    PFN_vkSetDeviceLoaderData setLoaderData);

} // namespace vellum::layer
