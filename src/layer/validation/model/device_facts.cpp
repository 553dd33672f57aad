// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/model/device_model.h"

#include <algorithm>

#include "layer/base/driver.h"
#include "layer/base/pnext.h"
#include "vk/newer.h"

namespace vellum::layer
{
namespace
{

// Returns whether the chain enables a feature by either of two structures.
template <typename First, typename Second>
bool enables(const VkDeviceCreateInfo &info, VkStructureType first, VkBool32 First::*firstFeature,
             VkStructureType second, VkBool32 Second::*secondFeature)
{
    const auto *a = findInChain<First>(info.pNext, first);
    const auto *b = findInChain<Second>(info.pNext, second);
    return (a && a->*firstFeature) || (b && b->*secondFeature);
}

void readLimits(const Driver &driver, DeviceFacts &facts)
{
    VkPhysicalDeviceTransformFeedbackPropertiesEXT feedback{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_TRANSFORM_FEEDBACK_PROPERTIES_EXT};
    VkPhysicalDeviceProtectedMemoryProperties memory{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROTECTED_MEMORY_PROPERTIES,
                                                     &feedback};
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &memory};
    driver.instance->GetPhysicalDeviceProperties2(driver.physicalDevice, &properties);
    facts.protectedNoFault = memory.protectedNoFault;
    facts.maxVertexInputBindings = properties.properties.limits.maxVertexInputBindings;
    facts.maxVertexInputBindingStride = properties.properties.limits.maxVertexInputBindingStride;
    if (feedback.maxTransformFeedbackBufferSize != 0)
        facts.maxTransformFeedbackBufferSize = feedback.maxTransformFeedbackBufferSize;
}

// The stages whose shaders may write to memory, by the features that a device was created with.
VkShaderStageFlags storingStages(const VkDeviceCreateInfo &info)
{
    const auto *features2 =
        findInChain<VkPhysicalDeviceFeatures2>(info.pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2);
    const VkPhysicalDeviceFeatures *features = features2 ? &features2->features : info.pEnabledFeatures;
    const VkShaderStageFlags vertexStages = VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_TESSELLATION_CONTROL_BIT |
                                            VK_SHADER_STAGE_TESSELLATION_EVALUATION_BIT | VK_SHADER_STAGE_GEOMETRY_BIT;
    VkShaderStageFlags stages = ~VkShaderStageFlags{0};
    if (!features || !features->vertexPipelineStoresAndAtomics)
        stages &= ~vertexStages;
    if (!features || !features->fragmentStoresAndAtomics)
        stages &= ~VkShaderStageFlags{VK_SHADER_STAGE_FRAGMENT_BIT};
    return stages;
}

} // namespace

DeviceFacts factsOf(const Driver &driver, const VkDeviceCreateInfo &info)
{
    DeviceFacts facts;
    const auto *robustness = findInChain<VkPhysicalDeviceRobustness2FeaturesEXT>(
        info.pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ROBUSTNESS_2_FEATURES_EXT);
    const auto *core12 = findInChain<VkPhysicalDeviceVulkan12Features>(
        info.pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
    facts.nullDescriptor = robustness && robustness->nullDescriptor;
    facts.indexTypeUint8 = enables(info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_INDEX_TYPE_UINT8_FEATURES_EXT,
                                   &VkPhysicalDeviceIndexTypeUint8FeaturesEXT::indexTypeUint8,
                                   VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_4_FEATURES,
                                   &VkPhysicalDeviceVulkan14Features::indexTypeUint8);
    facts.drawIndirectCount =
        (core12 && core12->drawIndirectCount) || enablesExtension(info, VK_KHR_DRAW_INDIRECT_COUNT_EXTENSION_NAME);
    facts.synchronization2 = enables(info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SYNCHRONIZATION_2_FEATURES,
                                     &VkPhysicalDeviceSynchronization2Features::synchronization2,
                                     VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES,
                                     &VkPhysicalDeviceVulkan13Features::synchronization2);
    facts.maintenance9 = enablesExtension(info, "VK_KHR_maintenance9");
    facts.maintenance11 = enablesExtension(info, "VK_KHR_maintenance11");
    const auto *addresses = findInChain<VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR>(
        info.pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR);
    facts.addressCommands = addresses && addresses->deviceAddressCommands;
    const auto *structures = findInChain<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
        info.pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR);
    facts.structureCaptureReplay = structures && structures->accelerationStructureCaptureReplay;
    facts.addressMultiDevice = enables(info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES,
                                       &VkPhysicalDeviceBufferDeviceAddressFeatures::bufferDeviceAddressMultiDevice,
                                       VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES,
                                       &VkPhysicalDeviceVulkan12Features::bufferDeviceAddressMultiDevice);
    constexpr const char *kWaits[] = {
        "VK_KHR_present_wait",           "VK_KHR_present_wait2",         "VK_KHR_external_fence_fd",
        "VK_KHR_external_fence_win32",   "VK_KHR_external_semaphore_fd", "VK_KHR_external_semaphore_win32",
        "VK_FUCHSIA_external_semaphore", "VK_EXT_metal_objects",         "VK_KHR_win32_keyed_mutex",
        "VK_NV_win32_keyed_mutex",       "VK_NV_external_sci_sync",      "VK_NV_external_sci_sync2",
        "VK_GOOGLE_display_timing",      "VK_EXT_present_timing"};
    facts.waitsElsewhere =
        std::ranges::any_of(kWaits, [&info](const char *extension) { return enablesExtension(info, extension); });
    facts.isGroup = isGroup(info);
    facts.storingStages = storingStages(info);
    if (driver.instance->GetPhysicalDeviceProperties2)
        readLimits(driver, facts);
    uint32_t count = 0;
    driver.instance->GetPhysicalDeviceQueueFamilyProperties(driver.physicalDevice, &count, nullptr);
    std::vector<VkQueueFamilyProperties> families(count);
    driver.instance->GetPhysicalDeviceQueueFamilyProperties(driver.physicalDevice, &count, families.data());
    for (const VkQueueFamilyProperties &family : families)
        facts.queueFamilies.push_back(family.queueFlags);
    return facts;
}

} // namespace vellum::layer
