// SPDX-License-Identifier: Apache-2.0
#include "layer/entry/device_info.h"

#include <cstring>

#include "layer/entry/ray_tracing_extensions.h"
#include "vk/newer.h"

namespace vellum::layer
{
namespace
{

template <typename T>
const T *featuresIn(const VkDeviceCreateInfo &info, VkStructureType type)
{
    return findInChain<T>(info.pNext, type);
}

} // namespace

EnabledFeatures enabledFeatures(const VkDeviceCreateInfo &info)
{
    EnabledFeatures enabled;
    enabled.ext = enablesExtension(info, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME);
    enabled.khr = enablesExtension(info, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME);
    enabled.addressCommands = enablesExtension(info, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME);
    enabled.pipelineMicromaps = enablesExtension(info, VK_ARM_PIPELINE_OPACITY_MICROMAP_EXTENSION_NAME);
    enabled.otherStructures = mayBuildOtherStructures(info);
    if (const auto *features = featuresIn<VkPhysicalDeviceOpacityMicromapFeaturesEXT>(
            info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT)) {
        enabled.extFeature = features->micromap;
        enabled.captureReplay = features->micromapCaptureReplay;
        enabled.hostCommands = features->micromapHostCommands;
    }
    if (const auto *features = featuresIn<VkPhysicalDeviceOpacityMicromapFeaturesKHR>(
            info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_KHR))
        enabled.khrFeature = features->micromap;
    if (const auto *features = featuresIn<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
            info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR))
        enabled.structures = features->accelerationStructure;
    if (const auto *features =
            featuresIn<VkPhysicalDeviceVulkan12Features>(info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES))
        enabled.bufferAddresses = features->bufferDeviceAddress;
    if (const auto *features = featuresIn<VkPhysicalDeviceBufferDeviceAddressFeatures>(
            info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES))
        enabled.bufferAddresses |= features->bufferDeviceAddress != VK_FALSE;
    if (const auto *features = featuresIn<VkPhysicalDeviceRayQueryFeaturesKHR>(
            info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR))
        enabled.rayQueries = features->rayQuery;
    if (const auto *features = featuresIn<VkPhysicalDeviceRayTracingPipelineFeaturesKHR>(
            info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_FEATURES_KHR))
        enabled.rayTracingPipelines = features->rayTracingPipeline;
    if (const auto *features = featuresIn<VkPhysicalDeviceDescriptorHeapFeaturesEXT>(
            info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DESCRIPTOR_HEAP_FEATURES_EXT))
        enabled.descriptorHeaps =
            features->descriptorHeap && enablesExtension(info, VK_EXT_DESCRIPTOR_HEAP_EXTENSION_NAME);
    return enabled;
}

bool enablesAddressReplay(const VkDeviceCreateInfo &info)
{
    const auto *core =
        featuresIn<VkPhysicalDeviceVulkan12Features>(info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
    const auto *own = featuresIn<VkPhysicalDeviceBufferDeviceAddressFeatures>(
        info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES);
    const auto *old = featuresIn<VkPhysicalDeviceBufferDeviceAddressFeaturesEXT>(
        info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES_EXT);
    return (core && core->bufferDeviceAddressCaptureReplay) || (own && own->bufferDeviceAddressCaptureReplay) ||
           (old && old->bufferDeviceAddressCaptureReplay);
}

DriverDeviceInfo::DriverDeviceInfo(const VkDeviceCreateInfo &application, const Driver &driver,
                                   const Implementations &have, GpuContext &gpu)
    : info(application), chain_(application.pNext)
{
    listExtensions(application, driver, have, gpu);
    chain_.remove(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_KHR);
    if (driver.ownAddressCommands)
        chain_.remove(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR);
    if (!driver.translated() || have.pipelines != Implementation::PassThrough)
        chain_.remove(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_OPACITY_MICROMAP_FEATURES_ARM);
    if (!driver.translated()) {
        chain_.remove(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT);
        chain_.remove(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DISPLACEMENT_MICROMAP_FEATURES_NV);
    } else if (driver.enabled.khr && !enableExtMicromaps()) {
        unreachable = "VkPhysicalDeviceOpacityMicromapFeaturesEXT, in which the layer has to enable micromap";
    }
    if (!enableAddresses(gpu))
        unreachable = "the structure in which the layer has to enable bufferDeviceAddress";
    info.pNext = chain_.head();
}

void DriverDeviceInfo::listExtensions(const VkDeviceCreateInfo &application, const Driver &driver,
                                      const Implementations &have, const GpuContext &gpu)
{
    const auto isHidden = [&](const char *name) {
        if (std::strcmp(name, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME) == 0)
            return driver.ownAddressCommands;
        if (!driver.translated())
            return have.of(name) != Implementation::None;
        return std::strcmp(name, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME) == 0 ||
               (std::strcmp(name, VK_ARM_PIPELINE_OPACITY_MICROMAP_EXTENSION_NAME) == 0 &&
                have.pipelines != Implementation::PassThrough);
    };
    for (uint32_t i = 0; i < application.enabledExtensionCount; ++i) {
        if (!isHidden(application.ppEnabledExtensionNames[i]))
            extensions_.push_back(application.ppEnabledExtensionNames[i]);
    }
    if (gpu.importsHostMemory && !enablesExtension(application, VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME))
        extensions_.push_back(VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME);
    if (driver.translated() && driver.enabled.khr && !driver.enabled.ext)
        extensions_.push_back(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME);
    info.enabledExtensionCount = static_cast<uint32_t>(extensions_.size());
    info.ppEnabledExtensionNames = extensions_.data();
}

// Every rewritten shader reaches the tables by address.
bool DriverDeviceInfo::enableAddresses(GpuContext &gpu)
{
    const auto enable = [&gpu](auto *features) {
        if (features) {
            features->bufferDeviceAddress = VK_TRUE;
            features->bufferDeviceAddressCaptureReplay |= VkBool32{gpu.replaysAddresses};
        }
        return features != nullptr;
    };
    constexpr VkStructureType kCore = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
    constexpr VkStructureType kOwn = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES;
    if (enable(chain_.edit<VkPhysicalDeviceVulkan12Features>(kCore)) ||
        enable(chain_.edit<VkPhysicalDeviceBufferDeviceAddressFeatures>(kOwn)))
        return true;
    const auto *core = findInChain<VkPhysicalDeviceVulkan12Features>(chain_.head(), kCore);
    const auto *own = findInChain<VkPhysicalDeviceBufferDeviceAddressFeatures>(chain_.head(), kOwn);
    if (!core && !own) {
        chain_.prepend(reinterpret_cast<VkBaseInStructure *>(&addresses_));
        return enable(&addresses_);
    }
    // The structure is behind one of unknown size, and stays as the application filled it in.
    gpu.replaysAddresses = false;
    return core ? core->bufferDeviceAddress : own->bufferDeviceAddress;
}

// VK_KHR_opacity_micromap is translated to the driver's micromaps.
bool DriverDeviceInfo::enableExtMicromaps()
{
    constexpr VkStructureType kType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT;
    if (auto *own = chain_.edit<VkPhysicalDeviceOpacityMicromapFeaturesEXT>(kType)) {
        own->micromap = VK_TRUE;
        return true;
    }
    if (const auto *application = findInChain<VkPhysicalDeviceOpacityMicromapFeaturesEXT>(chain_.head(), kType))
        return application->micromap;
    micromaps_.micromap = VK_TRUE;
    chain_.prepend(reinterpret_cast<VkBaseInStructure *>(&micromaps_));
    return true;
}

} // namespace vellum::layer
