// SPDX-License-Identifier: Apache-2.0
// Shared by the levels that choose the location of lavapipe's memory: lavapipe imports host memory, and its device
// addresses are the host's.
#pragma once

#include "layers/driver.h"

#include <cstring>
#include <vector>

namespace driver
{

constexpr const char *kImportExtension = VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME;
constexpr VkDeviceSize kImportAlignment = 65536; // more than minImportedHostPointerAlignment

constexpr VkDeviceSize importedBytes(VkDeviceSize bytes)
{
    return (bytes + kImportAlignment - 1) & ~(kImportAlignment - 1);
}

// Allocates memory with a device address on `data`, of importedBytes(info.allocationSize), by a device that was made
// with kImportExtension.
inline VkResult importMemory(Level level, VkDevice device, const VkMemoryAllocateInfo &info, void *data,
                             const VkAllocationCallbacks *allocator, VkDeviceMemory *memory)
{
    const auto import = vkInit<VkImportMemoryHostPointerInfoEXT>(
        {.handleType = VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_ALLOCATION_BIT_EXT, .pHostPointer = data});
    const auto flags =
        vkInit<VkMemoryAllocateFlagsInfo>({.pNext = &import, .flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT});
    const auto below = vkInit<VkMemoryAllocateInfo>({.pNext = &flags,
                                                     .allocationSize = importedBytes(info.allocationSize),
                                                     .memoryTypeIndex = info.memoryTypeIndex});
    return next<PFN_vkAllocateMemory>(level, keyOf(device), "vkAllocateMemory")(device, &below, allocator, memory);
}

// The next level's vkCreateDevice, with the extension.
inline VkResult createDeviceWithImport(Level level, VkPhysicalDevice physical, const VkDeviceCreateInfo &info,
                                       const VkAllocationCallbacks *allocator, VkDevice *device)
{
    VkDeviceCreateInfo below = info;
    std::vector<const char *> names(info.ppEnabledExtensionNames,
                                    info.ppEnabledExtensionNames + info.enabledExtensionCount);
    const auto isImport = [](const char *name) { return std::strcmp(name, kImportExtension) == 0; };
    if (std::none_of(names.begin(), names.end(), isImport))
        names.push_back(kImportExtension);
    below.enabledExtensionCount = static_cast<uint32_t>(names.size());
    below.ppEnabledExtensionNames = names.data();
    return next<PFN_vkCreateDevice>(level, keyOf(physical), "vkCreateDevice")(physical, &below, allocator, device);
}

} // namespace driver
