// A micromap as an object, whichever extension made it.
#pragma once

#include <cstdint>

#include <vulkan/vulkan.h>

#include "layer/ground/driver.h"

namespace vellum::layer
{

// The object of a VkMicromapEXT, whose handles are pointers to these, and part of an acceleration structure that is or
// may be one.
struct Micromap {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceSize offset = 0;
    VkDeviceSize size = 0;
    // As the application knows it, for messages.
    struct Object {
        VkObjectType type = VK_OBJECT_TYPE_MICROMAP_EXT;
        uint64_t handle = 0;
    } object;
};

// What a handle stands for; null for null.
inline Micromap *micromapOf(VkMicromapEXT handle)
{
    return reinterpret_cast<Micromap *>(handle);
}

// Device address of a micromap's memory; 0 for null.
inline VkDeviceAddress micromapAddress(const Driver &driver, const Micromap &micromap)
{
    return driver.bufferAddress(micromap.buffer) + micromap.offset;
}
inline VkDeviceAddress micromapAddress(const Driver &driver, VkMicromapEXT handle)
{
    const Micromap *micromap = micromapOf(handle);
    return micromap ? micromapAddress(driver, *micromap) : 0;
}

} // namespace vellum::layer
