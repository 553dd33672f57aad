// SPDX-License-Identifier: Apache-2.0
// Names of commands, and what the layer keeps of a physical device.
#include "layer/entry/physical_device.h"

#include <cstring>

#include <gtest/gtest.h>

#include "layer/entry/instance.h"

namespace vellum::layer
{
namespace
{

TEST(CommandOf, AliasesOfTheRegistryAndNewerOnes)
{
    EXPECT_STREQ(commandOf("vkWaitSemaphoresKHR"), "vkWaitSemaphores");
    EXPECT_STREQ(commandOf("vkGetBufferDeviceAddressEXT"), "vkGetBufferDeviceAddress");
    EXPECT_STREQ(commandOf("vkMapMemory2KHR"), "vkMapMemory2");
    EXPECT_STREQ(commandOf("vkQueueSubmit"), "vkQueueSubmit");
    EXPECT_STREQ(commandOf("vkNothing"), "vkNothing");
    // The layer does not handle the pipelines of VK_NV_ray_tracing.
    EXPECT_STREQ(commandOf("vkGetRayTracingShaderGroupHandlesNV"), "vkGetRayTracingShaderGroupHandlesNV");
}

// A driver with one extension, which counts and can fail.
uint32_t enumerations = 0;
VkResult enumerationResult = VK_SUCCESS;

VKAPI_ATTR VkResult VKAPI_CALL enumerateExtensions(VkPhysicalDevice, const char *, uint32_t *count,
                                                   VkExtensionProperties *properties)
{
    ++enumerations;
    *count = 1;
    if (properties)
        std::strcpy(properties->extensionName, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME);
    return enumerationResult;
}

VKAPI_ATTR void VKAPI_CALL getFeatures(VkPhysicalDevice, VkPhysicalDeviceFeatures2 *features)
{
    auto *micromaps = static_cast<VkPhysicalDeviceOpacityMicromapFeaturesEXT *>(features->pNext);
    EXPECT_EQ(micromaps->sType, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT);
    micromaps->micromap = VK_TRUE;
}

class PhysicalDeviceTest : public testing::Test
{
protected:
    PhysicalDeviceTest()
    {
        enumerations = 0;
        enumerationResult = VK_SUCCESS;
        instance_.next.EnumerateDeviceExtensionProperties = enumerateExtensions;
        instance_.next.GetPhysicalDeviceFeatures2 = getFeatures;
        instance_.isVulkan11 = true;
    }
    VkPhysicalDevice handle_ = reinterpret_cast<VkPhysicalDevice>(&instance_);
    Instance instance_;
};

TEST_F(PhysicalDeviceTest, FoundOnce)
{
    const auto first = describe(instance_, handle_);
    const uint32_t before = enumerations;
    EXPECT_EQ(describe(instance_, handle_), first);
    EXPECT_EQ(enumerations, before);
    EXPECT_EQ(first->have.ext, Implementation::PassThrough);
    EXPECT_EQ(first->have.khr, Implementation::None);
}

// Such an instance may have the pointer, and may not call it.
TEST_F(PhysicalDeviceTest, AnInstanceOfVersion10IsNotAskedForFeatures)
{
    instance_.isVulkan11 = false;
    instance_.next.GetPhysicalDeviceFeatures2 = [](VkPhysicalDevice, VkPhysicalDeviceFeatures2 *) { ADD_FAILURE(); };
    EXPECT_EQ(describe(instance_, handle_)->have.ext, Implementation::None);
}

TEST_F(PhysicalDeviceTest, FailuresAreNotKept)
{
    enumerationResult = VK_ERROR_OUT_OF_HOST_MEMORY;
    EXPECT_TRUE(describe(instance_, handle_)->extensions.empty());
    enumerationResult = VK_SUCCESS;
    EXPECT_EQ(describe(instance_, handle_)->extensions.size(), 1u);
}

} // namespace
} // namespace vellum::layer
