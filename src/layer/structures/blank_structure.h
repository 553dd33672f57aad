// A bottom-level structure of one triangle as the driver serializes it, made when the device is made: how the driver
// serializes can only be found out by trying.
#pragma once

#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

struct DeviceStructures;

// It begins with the driver's UUIDs, and stands in for serialized data that the driver must not see.
struct BlankStructure {
    GpuBuffer memory;
    uint32_t units = 0;              // of 16 bytes; 0: there is none
    VkDeviceSize structureBytes = 0; // of the structure that it is deserialized to
    // The driver serializes and deserializes as many bytes as the structure was created with.
    bool wholeCopies = false;
};

// Sets Device::blank, where the application enabled acceleration structures and has a queue that can build them.
// `info` as the application passed it to vkCreateDevice.
void makeBlankStructure(DeviceStructures &device, const VkDeviceCreateInfo &info,
                        PFN_vkSetDeviceLoaderData setLoaderData);

} // namespace vellum::layer
