// SPDX-License-Identifier: Apache-2.0
#include "layer/entry/physical_device.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <iterator>

#include "layer/entry/instance.h"
#include "layer/memory/kept_addresses.h"

namespace vellum::layer
{
namespace
{

bool contains(const std::vector<VkExtensionProperties> &list, const char *name)
{
    return std::ranges::any_of(list, [name](const auto &e) { return std::strcmp(e.extensionName, name) == 0; });
}

VkResult listExtensions(const Instance &instance, VkPhysicalDevice handle, std::vector<VkExtensionProperties> &list)
{
    VkResult result = VK_INCOMPLETE;
    while (result == VK_INCOMPLETE) {
        uint32_t count = 0;
        result = instance.next.EnumerateDeviceExtensionProperties(handle, nullptr, &count, nullptr);
        if (result != VK_SUCCESS)
            return result;
        list.resize(count);
        result = instance.next.EnumerateDeviceExtensionProperties(handle, nullptr, &count, list.data());
        list.resize(count);
    }
    return result;
}

// The loader adds the extensions in the manifests of implicit layers to the driver's list
// (terminator_EnumerateDeviceExtensionProperties), and so the layer's own where it is one. Every driver that has such
// an extension supports its first feature. An instance of version 1.0, which cannot ask for it, cannot use them either.
void eraseOwn(const Instance &instance, VkPhysicalDevice handle, std::vector<VkExtensionProperties> &list)
{
    struct Features { // large enough for each of the structures
        VkStructureType type;
        void *next;
        VkBool32 first;
        VkBool32 others[3];
    };
    std::array<Features, std::size(kProvidedExtensions)> all{};
    VkPhysicalDeviceFeatures2 query{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, nullptr, {}};
    for (size_t i = 0; i < all.size(); ++i) {
        if (!contains(list, kProvidedExtensions[i].name))
            continue;
        all[i] = {kProvidedExtensions[i].features, query.pNext, VK_FALSE, {}};
        query.pNext = &all[i];
    }
    if (query.pNext && instance.isVulkan11 && instance.next.GetPhysicalDeviceFeatures2)
        instance.next.GetPhysicalDeviceFeatures2(handle, &query);
    for (size_t i = 0; i < all.size(); ++i) {
        if (!all[i].first)
            std::erase_if(list, [name = kProvidedExtensions[i].name](const auto &e) {
                return std::strcmp(e.extensionName, name) == 0;
            });
    }
}

bool isVulkan13(const Instance &instance, VkPhysicalDevice handle)
{
    VkPhysicalDeviceProperties properties{};
    instance.next.GetPhysicalDeviceProperties(handle, &properties);
    return properties.apiVersion >= VK_API_VERSION_1_3;
}

bool canAskForFeatures(const Instance &instance, VkPhysicalDevice handle,
                       const std::vector<VkExtensionProperties> &extensions)
{
    // VK_KHR_acceleration_structure depends on Vulkan 1.1. An instance of version 1.0 lacks some commands of 1.1.
    if (!contains(extensions, VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME) || !instance.isVulkan11 ||
        !instance.next.GetPhysicalDeviceFeatures2)
        return false;
    // VK_EXT_opacity_micromap depends on VK_KHR_synchronization2 or Vulkan 1.3.
    return contains(extensions, VK_KHR_SYNCHRONIZATION_2_EXTENSION_NAME) || isVulkan13(instance, handle);
}

// The features that decide what the layer can provide; all false where it provides nothing.
struct DriverFeatures {
    bool structures = false;
    bool addresses = false;
    bool replaysAddresses = false;

    [[nodiscard]] bool canEmulate() const { return structures && addresses; }
};

DriverFeatures featuresOf(const Instance &instance, VkPhysicalDevice handle,
                          const std::vector<VkExtensionProperties> &extensions)
{
    if (!canAskForFeatures(instance, handle, extensions))
        return {};
    VkPhysicalDeviceAccelerationStructureFeaturesKHR structures{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR};
    VkPhysicalDeviceBufferDeviceAddressFeatures addresses{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES, &structures};
    VkPhysicalDeviceFeatures2 features{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &addresses, {}};
    instance.next.GetPhysicalDeviceFeatures2(handle, &features);
    return {structures.accelerationStructure != VK_FALSE, addresses.bufferDeviceAddress != VK_FALSE,
            addresses.bufferDeviceAddressCaptureReplay != VK_FALSE};
}

Implementations implementationsBy(const DriverFeatures &features, const std::vector<VkExtensionProperties> &extensions,
                                  Preferred preferred)
{
    const bool provides = features.canEmulate() && preferred != Preferred::Driver;
    const Implementation otherwise = provides ? Implementation::Emulation : Implementation::None;
    Implementations result;
    for (const ProvidedExtension &own : kProvidedExtensions) {
        const bool passes = contains(extensions, own.name) && preferred != Preferred::Emulated;
        result.*own.implementation = passes ? Implementation::PassThrough : otherwise;
    }
    const bool prefersExt = provides && preferred == Preferred::Ext;
    if (result.ext == Implementation::PassThrough && (result.khr == Implementation::Emulation || prefersExt)) {
        result.khr = Implementation::Translation;
        // Nothing in the driver's micromaps corresponds to VK_ARM_pipeline_opacity_micromap.
        if (result.pipelines == Implementation::Emulation)
            result.pipelines = Implementation::None;
    }
    return result;
}

bool canImportHostMemory(const Instance &instance, VkPhysicalDevice handle)
{
    if (!instance.next.GetPhysicalDeviceExternalBufferProperties)
        return false;
    const VkPhysicalDeviceExternalBufferInfo info{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_BUFFER_INFO, nullptr, 0,
                                                  VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                                                      VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
                                                  VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_ALLOCATION_BIT_EXT};
    VkExternalBufferProperties buffers{VK_STRUCTURE_TYPE_EXTERNAL_BUFFER_PROPERTIES, nullptr, {}};
    instance.next.GetPhysicalDeviceExternalBufferProperties(handle, &info, &buffers);
    const VkExternalMemoryFeatureFlags features = buffers.externalMemoryProperties.externalMemoryFeatures;
    return (features & VK_EXTERNAL_MEMORY_FEATURE_IMPORTABLE_BIT) != 0 &&
           (features & VK_EXTERNAL_MEMORY_FEATURE_DEDICATED_ONLY_BIT) == 0;
}

// Only driverInfo has the version of Mesa: driverVersion is always 0.0.1.
bool isLavapipeBefore26(const VkPhysicalDeviceDriverProperties &driver)
{
    unsigned major = 0;
    return driver.driverID == VK_DRIVER_ID_MESA_LLVMPIPE && std::sscanf(driver.driverInfo, "Mesa %u", &major) == 1 &&
           major < 26;
}

void findProperties(const Instance &instance, VkPhysicalDevice handle, PhysicalDevice &device)
{
    VkPhysicalDeviceDriverProperties driver{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES};
    VkPhysicalDeviceIDProperties id{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ID_PROPERTIES, &driver};
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &id, {}};
    VkPhysicalDeviceExternalMemoryHostPropertiesEXT host{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_MEMORY_HOST_PROPERTIES_EXT};
    const bool hasHostMemory = contains(device.extensions, VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME);
    if (hasHostMemory) {
        host.pNext = properties.pNext;
        properties.pNext = &host;
    }
    VkPhysicalDeviceOpacityMicromapPropertiesEXT micromaps{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_EXT};
    if (device.have.khr == Implementation::Translation) {
        micromaps.pNext = properties.pNext;
        properties.pNext = &micromaps;
    }
    instance.next.GetPhysicalDeviceProperties2(handle, &properties);

    device.isCpu = properties.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
    device.isLavapipeBefore26 = isLavapipeBefore26(driver);
    device.maxPushConstantsSize = properties.properties.limits.maxPushConstantsSize;
    std::ranges::copy(id.driverUUID, device.driverUuid.begin());
    std::ranges::copy(id.deviceUUID, device.deviceUuid.begin());
    std::ranges::copy(properties.properties.pipelineCacheUUID, device.pipelineCacheUuid.begin());
    device.importsHostMemory = hasHostMemory && device.isCpu &&
                               host.minImportedHostPointerAlignment <= FixedMemory::kAlignment &&
                               canImportHostMemory(instance, handle);
    // A translated build is never lossy.
    device.extLimits = {micromaps.maxOpacity2StateSubdivisionLevel, micromaps.maxOpacity4StateSubdivisionLevel,
                        micromaps.maxOpacity4StateSubdivisionLevel, shared::kMaxMicromapTriangles};
}

void findQueueFamilies(const Instance &instance, VkPhysicalDevice handle, PhysicalDevice &device)
{
    uint32_t count = 0;
    instance.next.GetPhysicalDeviceQueueFamilyProperties(handle, &count, nullptr);
    device.queueFamilies.resize(count);
    instance.next.GetPhysicalDeviceQueueFamilyProperties(handle, &count, device.queueFamilies.data());
}

} // namespace

Implementation Implementations::of(const char *extension) const
{
    for (const ProvidedExtension &own : kProvidedExtensions) {
        if (std::strcmp(own.name, extension) == 0)
            return this->*own.implementation;
    }
    return Implementation::None;
}

bool Implementations::anyEmulated() const
{
    return std::ranges::any_of(kProvidedExtensions, [this](const ProvidedExtension &own) {
        return this->*own.implementation == Implementation::Emulation;
    });
}

std::shared_ptr<const PhysicalDevice> describe(Instance &instance, VkPhysicalDevice handle)
{
    {
        std::lock_guard lock(instance.physicalDevicesMutex);
        if (const auto known = instance.physicalDevices.find(handle); known != instance.physicalDevices.end())
            return known->second;
    }
    auto device = std::make_shared<PhysicalDevice>();
    device->listed = listExtensions(instance, handle, device->extensions);
    if (device->listed != VK_SUCCESS) {
        device->extensions.clear();
        return device; // not kept: the driver may have been out of memory
    }
    eraseOwn(instance, handle, device->extensions);
    const DriverFeatures features = featuresOf(instance, handle, device->extensions);
    device->have = implementationsBy(features, device->extensions, instance.settings.implementation);
    if (features.canEmulate()) {
        device->replaysAddresses = features.replaysAddresses;
        findProperties(instance, handle, *device);
        instance.next.GetPhysicalDeviceMemoryProperties(handle, &device->memory);
        findQueueFamilies(instance, handle, *device);
    }
    std::lock_guard lock(instance.physicalDevicesMutex);
    return instance.physicalDevices.try_emplace(handle, std::move(device)).first->second;
}

} // namespace vellum::layer
