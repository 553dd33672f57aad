// SPDX-License-Identifier: Apache-2.0
// Creates a device with VK_EXT_opacity_micromap and one queue; for programs with and without Vulkan's prototypes.
#pragma once

#include <array>

#include "vk/vk_init.h"

class MicromapDeviceInfo
{
public:
    explicit MicromapDeviceInfo(uint32_t family) { queue_.queueFamilyIndex = family; }
    MicromapDeviceInfo(const MicromapDeviceInfo &) = delete;
    MicromapDeviceInfo &operator=(const MicromapDeviceInfo &) = delete;
    [[nodiscard]] const VkDeviceCreateInfo *get() const { return &info_; }

private:
    static constexpr std::array kExtensions{VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                                            VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME,
                                            VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME};
    const float priority_ = 1;
    VkDeviceQueueCreateInfo queue_ = vkInit<VkDeviceQueueCreateInfo>({.queueCount = 1, .pQueuePriorities = &priority_});
    VkPhysicalDeviceOpacityMicromapFeaturesEXT micromaps_ =
        vkInit<VkPhysicalDeviceOpacityMicromapFeaturesEXT>({.micromap = VK_TRUE});
    VkPhysicalDeviceAccelerationStructureFeaturesKHR structures_ =
        vkInit<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
            {.pNext = &micromaps_, .accelerationStructure = VK_TRUE});
    const VkDeviceCreateInfo info_ =
        vkInit<VkDeviceCreateInfo>({.pNext = &structures_,
                                    .queueCreateInfoCount = 1,
                                    .pQueueCreateInfos = &queue_,
                                    .enabledExtensionCount = static_cast<uint32_t>(kExtensions.size()),
                                    .ppEnabledExtensionNames = kExtensions.data()});
};
