// SPDX-License-Identifier: Apache-2.0
#include "cli/info/device_details.h"

#include <cstring>
#include <set>
#include <utility>

namespace vellum::cli
{
namespace
{

std::set<std::string> extensionsOf(VkPhysicalDevice device)
{
    uint32_t count = 0;
    check(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, nullptr), "listing device extensions");
    std::vector<VkExtensionProperties> extensions(count);
    check(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, extensions.data()),
          "listing device extensions");
    std::set<std::string> names;
    for (const VkExtensionProperties &e : extensions)
        names.insert(e.extensionName);
    return names;
}

const char *nameOf(VkPhysicalDeviceType type)
{
    switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU: return "discrete GPU";
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU: return "integrated GPU";
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU: return "virtual GPU";
    case VK_PHYSICAL_DEVICE_TYPE_CPU: return "CPU";
    default: return "other device";
    }
}

std::string versionText(uint32_t version)
{
    return std::to_string(VK_API_VERSION_MAJOR(version)) + "." + std::to_string(VK_API_VERSION_MINOR(version)) + "." +
           std::to_string(VK_API_VERSION_PATCH(version));
}

struct Features {
    bool structures = false;
    bool addresses = false;
    bool synchronization2 = false;
};

// What the layer asks of a device (docs/limitations.md). The device must be one of Vulkan 1.2.
Features featuresOf(VkPhysicalDevice device, uint32_t version, const std::set<std::string> &extensions)
{
    VkPhysicalDeviceVulkan13Features features13{};
    features13.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES;
    VkPhysicalDeviceSynchronization2Features synchronization2{};
    synchronization2.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SYNCHRONIZATION_2_FEATURES;
    VkPhysicalDeviceAccelerationStructureFeaturesKHR structures{};
    structures.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR;
    VkPhysicalDeviceVulkan12Features features12{};
    features12.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
    const auto ask = [&](auto &feature) { feature.pNext = std::exchange(features12.pNext, &feature); };
    if (extensions.contains(VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME))
        ask(structures);
    if (version >= VK_API_VERSION_1_3)
        ask(features13);
    else if (extensions.contains(VK_KHR_SYNCHRONIZATION_2_EXTENSION_NAME))
        ask(synchronization2);
    VkPhysicalDeviceFeatures2 features{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &features12, {}};
    vkGetPhysicalDeviceFeatures2(device, &features);
    return {structures.accelerationStructure == VK_TRUE, features12.bufferDeviceAddress == VK_TRUE,
            features13.synchronization2 == VK_TRUE || synchronization2.synchronization2 == VK_TRUE};
}

void findMissing(DeviceDetails &details, VkPhysicalDevice device, uint32_t version,
                 const std::set<std::string> &extensions)
{
    if (version < VK_API_VERSION_1_2) {
        details.missing.push_back("Vulkan 1.2 (it has " + versionText(version) + ")");
        return;
    }
    const Features features = featuresOf(device, version, extensions);
    details.accelerationStructures = features.structures;
    if (!features.structures)
        details.missing.push_back("acceleration structures (VK_KHR_acceleration_structure)");
    if (!features.addresses)
        details.missing.push_back("buffer device addresses (bufferDeviceAddress)");
    if (!features.synchronization2)
        details.missing.push_back("Vulkan 1.3 or VK_KHR_synchronization2");
}

void readProperties(DeviceDetails &details, VkPhysicalDevice device, const std::set<std::string> &extensions)
{
    VkPhysicalDeviceDriverProperties driver{};
    driver.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES;
    VkPhysicalDeviceOpacityMicromapPropertiesEXT ext{};
    ext.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_EXT;
    VkPhysicalDeviceOpacityMicromapPropertiesKHR khr{};
    khr.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_KHR;
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, nullptr, {}};
    const auto ask = [&](auto &part) { part.pNext = std::exchange(properties.pNext, &part); };
    ask(driver);
    if (extensions.contains(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME))
        ask(ext);
    if (extensions.contains(VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME))
        ask(khr);
    vkGetPhysicalDeviceProperties2(device, &properties);
    details.driver = std::string(driver.driverName) + " " + driver.driverInfo;
    details.most2StateLevel = std::max(ext.maxOpacity2StateSubdivisionLevel, khr.maxOpacity2StateSubdivisionLevel);
    details.most4StateLevel = std::max(ext.maxOpacity4StateSubdivisionLevel, khr.maxOpacity4StateSubdivisionLevel);
}

} // namespace

std::vector<DeviceDetails> describeDevices(const Instance &instance)
{
    std::vector<DeviceDetails> all;
    for (const DeviceInfo &info : listDevices(instance)) {
        VkPhysicalDeviceProperties properties;
        vkGetPhysicalDeviceProperties(info.handle, &properties);
        const std::set<std::string> extensions = extensionsOf(info.handle);
        DeviceDetails &details = all.emplace_back();
        details.name = info.name;
        details.kind = nameOf(info.type);
        details.version = versionText(properties.apiVersion);
        details.rayQueries = extensions.contains(VK_KHR_RAY_QUERY_EXTENSION_NAME);
        details.rayTracingPipelines = extensions.contains(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME);
        findMissing(details, info.handle, properties.apiVersion, extensions);
        if (properties.apiVersion >= VK_API_VERSION_1_2)
            readProperties(details, info.handle, extensions);
        // The layer reports what it does for the device.
        const Provider provider = info.implementation.starts_with("emulated") ? Provider::Layer : Provider::Driver;
        if (extensions.contains(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME))
            details.ext = provider;
        if (extensions.contains(VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME))
            details.khr = info.implementation.find("translates") != std::string::npos ? Provider::Translated : provider;
    }
    return all;
}

} // namespace vellum::cli
