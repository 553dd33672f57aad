// SPDX-License-Identifier: Apache-2.0
// The quirk "vendors": extensions for ray tracing that lavapipe lacks, and one that does not exist yet. The driver only
// lists them and their features, which may be enabled.
#include "layers/driver.h"

#include <algorithm>
#include <cstring>
#include <iterator>
#include <vector>

namespace
{

using namespace driver;
constexpr Level kLevel = Level::Vendors;

struct Vendors {
    const char *extension;
    int features; // the sType of the structure; 0: none
    uint32_t count;
};
constexpr Vendors kVendors[]{
    {"VK_NV_ray_tracing", 0, 0},
    {"VK_NV_ray_tracing_motion_blur", VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_MOTION_BLUR_FEATURES_NV, 2},
    {"VK_NV_cluster_acceleration_structure", 1000569000, 1},
    {"VK_NV_partitioned_acceleration_structure", 1000570000, 1},
    {"VK_AMDX_dense_geometry_format", 1000478000, 1},
    {"VK_NV_command_buffer_inheritance", 1000559000, 1},
    {"VK_NV_push_constant_bank", 1000580001, 1},
    {"VK_TEST_ray_tracing_to_come", 0, 0},
};

const Vendors *vendorsOf(const char *extension)
{
    const auto *found =
        std::ranges::find_if(kVendors, [=](const Vendors &v) { return std::strcmp(v.extension, extension) == 0; });
    return found == std::end(kVendors) ? nullptr : found;
}

VKAPI_ATTR VkResult VKAPI_CALL enumerateExtensions(VkPhysicalDevice handle, const char *layer, uint32_t *count,
                                                   VkExtensionProperties *properties)
{
    return listExtensions(kLevel, handle, layer, count, properties, [](std::vector<VkExtensionProperties> &all) {
        for (const Vendors &one : kVendors) {
            std::strcpy(all.emplace_back().extensionName, one.extension);
            all.back().specVersion = 1;
        }
    });
}

VKAPI_ATTR void VKAPI_CALL getFeatures(VkPhysicalDevice handle, VkPhysicalDeviceFeatures2 *features)
{
    DRIVER_NEXT(vkGetPhysicalDeviceFeatures2)(handle, features);
    for (auto *s = static_cast<VkBaseOutStructure *>(features->pNext); s != nullptr; s = s->pNext) {
        for (const Vendors &one : kVendors) {
            if (one.count != 0 && s->sType == static_cast<VkStructureType>(one.features))
                std::fill_n(reinterpret_cast<VkBool32 *>(s + 1), one.count, VK_TRUE);
        }
    }
}

// Lavapipe ignores the structures, and rejects the names.
VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice handle, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    std::vector<const char *> names(info->ppEnabledExtensionNames,
                                    info->ppEnabledExtensionNames + info->enabledExtensionCount);
    std::erase_if(names, [](const char *name) { return vendorsOf(name) != nullptr; });
    VkDeviceCreateInfo below = *info;
    below.enabledExtensionCount = static_cast<uint32_t>(names.size());
    below.ppEnabledExtensionNames = names.data();
    return DRIVER_NEXT(vkCreateDevice)(handle, &below, allocator, device);
}

} // namespace

driver::LevelRows driver::vendorRows()
{
    static const Row instance[]{
        {"vkCreateDevice", DRIVER_FUNCTION(createDevice)},
        {"vkEnumerateDeviceExtensionProperties", DRIVER_FUNCTION(enumerateExtensions)},
        {"vkGetPhysicalDeviceFeatures2", DRIVER_FUNCTION(getFeatures)},
    };
    return {{}, instance};
}
