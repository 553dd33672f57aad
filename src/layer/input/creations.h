// SPDX-License-Identifier: Apache-2.0
// Creations of micromaps and acceleration structures, of pipelines and of shader objects, as rules see them.
#pragma once

#include <span>
#include <vector>

#include <vulkan/vulkan.h>

#include "vk/newer.h"

namespace vellum::layer::input
{

// The creation of a micromap or an acceleration structure, in a buffer or in an address range.
struct Creation {
    bool isMicromap = false;
    bool rightType = true; // of a VkMicromapEXT: VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT
    VkBuffer buffer = VK_NULL_HANDLE;
    VkDeviceSize offset = 0;
    VkDeviceAddress address = 0; // of the range
    VkDeviceSize size = 0;
    bool replays = false;         // VK_MICROMAP_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT_EXT
    VkFlags unknownFlags = 0;     // of VkMicromapCreateInfoEXT
    VkDeviceAddress replayed = 0; // VkMicromapCreateInfoEXT::deviceAddress
    bool accepted = true;         // set by the check of the rules
};
inline Creation parse(const VkMicromapCreateInfoEXT &info)
{
    return {.isMicromap = true,
            .rightType = info.type == VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT,
            .buffer = info.buffer,
            .offset = info.offset,
            .size = info.size,
            .replays = (info.createFlags & VK_MICROMAP_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT_EXT) != 0,
            .unknownFlags = info.createFlags & ~VkFlags{VK_MICROMAP_CREATE_DEVICE_ADDRESS_CAPTURE_REPLAY_BIT_EXT},
            .replayed = info.deviceAddress};
}
inline Creation parse(const VkAccelerationStructureCreateInfoKHR &info)
{
    return {.isMicromap = info.type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR,
            .buffer = info.buffer,
            .offset = info.offset,
            .size = info.size};
}
inline Creation parse(const VkAccelerationStructureCreateInfo2KHR &info)
{
    return {.isMicromap = info.type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR,
            .address = info.addressRange.address,
            .size = info.addressRange.size};
}

// The application's code, where validation gives the implementation a copy of it that sets marks.
struct OriginalCode {
    std::span<const uint32_t> words;
};

// The pipelines or shader objects of one command. Set by the check of the rules: those that may be created.
struct Pipelines {
    std::vector<bool> accepted;
};

} // namespace vellum::layer::input
