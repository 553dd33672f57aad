// SPDX-License-Identifier: Apache-2.0
// The quirk "spy": devices, and all of its commands together. With the quirk "displacement" the driver says that it has
// micromaps, and displacement micromaps; with the quirk "implicit" the loader lists what Vellum's layer provides.
// It also checks that stack sizes which the application sets have space for all shaders of the driver's pipeline. Where
// VELLUM_TEST_SPY_MARKER is in the environment, it is a driver with VK_AMD_buffer_marker; where
// VELLUM_TEST_SPY_BARRIERS is, it reports every memory and buffer barrier.
#include "layers/spy.h"

#include <algorithm>
#include <cstring>
#include <set>
#include <vector>

namespace spy
{

std::mutex mutex;

namespace
{

// --- VK_NV_displacement_micromap ---

constexpr const char *kDisplacement = "VK_NV_displacement_micromap";

// What Vellum's layer provides.
constexpr const char *kProvided[]{VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME,
                                  VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME, "VK_ARM_pipeline_opacity_micromap"};

struct OneMember { // VkPhysicalDeviceDisplacementMicromapFeaturesNV and ...PropertiesNV
    VkStructureType sType;
    void *pNext;
    uint32_t value;
};

void answer(void *key, void *chain, VkStructureType type, uint32_t value)
{
    auto *structure = driver::inChainOut<OneMember>(chain, type);
    if (structure != nullptr && driver::has(key, "displacement"))
        structure->value = value;
}

VKAPI_ATTR VkResult VKAPI_CALL enumerateExtensions(VkPhysicalDevice handle, const char *layer, uint32_t *count,
                                                   VkExtensionProperties *properties)
{
    return listExtensions(driver::Level::Spy, handle, layer, count, properties, [handle](auto &all) {
        const auto add = [&all](const char *name) {
            std::strcpy(all.emplace_back().extensionName, name);
            all.back().specVersion = 1;
        };
        if (driver::has(keyOf(handle), "displacement")) {
            add(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME);
            add(kDisplacement);
        }
        if (driver::has(keyOf(handle), "implicit")) {
            for (const char *name : kProvided)
                add(name);
        }
    });
}

VKAPI_ATTR void VKAPI_CALL getFeatures(VkPhysicalDevice handle, VkPhysicalDeviceFeatures2 *features)
{
    SPY_NEXT(vkGetPhysicalDeviceFeatures2)(handle, features);
    answer(keyOf(handle), features->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DISPLACEMENT_MICROMAP_FEATURES_NV,
           VK_TRUE);
}

VKAPI_ATTR void VKAPI_CALL getProperties(VkPhysicalDevice handle, VkPhysicalDeviceProperties2 *properties)
{
    SPY_NEXT(vkGetPhysicalDeviceProperties2)(handle, properties);
    answer(keyOf(handle), properties->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DISPLACEMENT_MICROMAP_PROPERTIES_NV, 5);
}

// Keys of devices with the driver's own VK_EXT_opacity_micromap.
std::set<void *> withMicromaps;

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice handle, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    const bool ext = driver::has(keyOf(handle), "ext");
    const std::span names(info->ppEnabledExtensionNames, info->enabledExtensionCount);
    const auto isEnabled = [&names](const char *extension) {
        return std::any_of(names.begin(), names.end(),
                           [extension](const char *name) { return std::strcmp(name, extension) == 0; });
    };
    for (const char *provided : kProvided) {
        if (isEnabled(provided) && !(ext && std::strcmp(provided, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME) == 0))
            report(std::string("vkCreateDevice: ") + provided);
    }
    if (isEnabled(kDisplacement))
        report(std::string("vkCreateDevice: ") + kDisplacement);
    const auto *features = inChain<VkPhysicalDeviceOpacityMicromapFeaturesEXT>(
        info->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT);
    if (features != nullptr && !ext)
        report("vkCreateDevice: VkPhysicalDeviceOpacityMicromapFeaturesEXT");
    if (inChain(info->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_KHR) != nullptr)
        report("vkCreateDevice: VkPhysicalDeviceOpacityMicromapFeaturesKHR");
    if (inChain(info->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR) != nullptr)
        report("vkCreateDevice: VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR");
    // VkPhysicalDevicePipelineOpacityMicromapFeaturesARM
    if (inChain(info->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_OPACITY_MICROMAP_FEATURES_ARM) != nullptr)
        report("vkCreateDevice: features of pipelines with micromaps");
    const VkResult result = SPY_NEXT(vkCreateDevice)(handle, info, allocator, device);
    if (result == VK_SUCCESS) {
        std::lock_guard lock(mutex);
        withMicromaps.erase(keyOf(*device)); // one that is gone
        if (ext && isEnabled(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME) && features != nullptr &&
            features->micromap == VK_TRUE)
            withMicromaps.insert(keyOf(*device));
    }
    return result;
}

} // namespace

bool knowsMicromaps(void *key)
{
    std::lock_guard lock(mutex);
    return withMicromaps.contains(key);
}

} // namespace spy

driver::LevelRows driver::spyRows()
{
    using namespace spy;
    static const std::vector<Row> device = [] {
        std::vector<Row> all;
        for (const std::span<const Row> rows :
             {synchronization(), structures(), memory(), pipelines(), pipelineCaches()})
            all.insert(all.end(), rows.begin(), rows.end());
        return all;
    }();
    static const Row instance[]{
        {"vkCreateDevice", SPY_FUNCTION(createDevice)},
        {"vkEnumerateDeviceExtensionProperties", SPY_FUNCTION(enumerateExtensions)},
        {"vkGetPhysicalDeviceFeatures2", SPY_FUNCTION(getFeatures)},
        {"vkGetPhysicalDeviceProperties2", SPY_FUNCTION(getProperties)},
        {"vkGetPhysicalDeviceExternalBufferProperties", SPY_FUNCTION(getExternalBuffers)},
        {"vkGetPhysicalDeviceMemoryProperties", SPY_FUNCTION(getMemoryProperties)},
    };
    return {device, instance};
}
