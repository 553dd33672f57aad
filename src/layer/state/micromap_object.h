// SPDX-License-Identifier: Apache-2.0
// A micromap as an object, whichever extension created it.
#pragma once

#include <cstdint>

#include <vulkan/vulkan.h>

#include "layer/base/driver.h"

namespace vellum::layer
{

// The memory of a micromap, built or not. VkMicromapEXT handles are pointers to these.
struct Micromap {
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceSize offset = 0;
    VkDeviceSize size = 0;
    // The application's handle, for messages.
    struct Object {
        VkObjectType type = VK_OBJECT_TYPE_MICROMAP_EXT;
        uint64_t handle = 0;
    } object;

    explicit operator bool() const { return buffer != VK_NULL_HANDLE; }
};

// The object of a handle; null for null.
inline const Micromap *micromapOf(VkMicromapEXT handle)
{
    return reinterpret_cast<const Micromap *>(handle);
}

// Device address of a micromap's memory; 0 without memory.
inline VkDeviceAddress micromapAddress(const Driver &driver, const Micromap &micromap)
{
    return micromap ? driver.bufferAddress(micromap.buffer) + micromap.offset : 0;
}

} // namespace vellum::layer
