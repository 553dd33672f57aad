// SPDX-License-Identifier: Apache-2.0
// The layer's entry points, as other layers and old applications use them.
#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <string>
#include <vector>

#include "harness/mock_driver.h"
#include "harness/program/labels.h"
#include <gtest/gtest.h>
#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

namespace
{

const vt::Labels kInstanceLabels{{"Extension/OldInstance.*", "one_api"}, {"Instance.*", "one_api"}};

std::string library()
{
    const std::string path = std::getenv("VK_ADD_LAYER_PATH");
    const std::string file = std::string(vt::kLibrarySuffix) == ".dll" ? "/VkLayer_vellum_opacity_micromap"
                                                                       : "/libVkLayer_vellum_opacity_micromap";
    return path.substr(0, path.find(vt::kListSeparator)) + file + vt::kLibrarySuffix;
}

// MangoHud 0.6.8 and vkBasalt 0.3.2 look for vkCreateDevice without an instance, and call it with one.
TEST(Instance, CommandsAreFoundWithoutOne)
{
    void *layer = dlopen(library().c_str(), RTLD_NOW | RTLD_LOCAL);
    ASSERT_NE(layer, nullptr) << dlerror();
    const auto negotiate = reinterpret_cast<PFN_vkNegotiateLoaderLayerInterfaceVersion>(
        dlsym(layer, "vkNegotiateLoaderLayerInterfaceVersion"));
    ASSERT_NE(negotiate, nullptr);
    VkNegotiateLayerInterface interface {
        LAYER_NEGOTIATE_INTERFACE_STRUCT, nullptr, 2, nullptr, nullptr, nullptr
    };
    ASSERT_EQ(negotiate(&interface), VK_SUCCESS);
    for (const char *name : {"vkCreateInstance", "vkDestroyInstance", "vkCreateDevice", "vkGetPhysicalDeviceFeatures2",
                             "vkGetDeviceProcAddr", "vkDestroyDevice"})
        EXPECT_NE(interface.pfnGetInstanceProcAddr(VK_NULL_HANDLE, name), nullptr) << name;
    for (const char *name : {"vkCreateBuffer", "vkEnumeratePhysicalDevices", "vkNoSuchCommand"})
        EXPECT_EQ(interface.pfnGetInstanceProcAddr(VK_NULL_HANDLE, name), nullptr) << name;
    dlclose(layer);
}

VKAPI_ATTR VkBool32 VKAPI_CALL remember(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                        const VkDebugUtilsMessengerCallbackDataEXT *data, void *messages)
{
    static_cast<std::vector<std::string> *>(messages)->push_back(data->pMessage);
    return VK_FALSE;
}

// An application of Vulkan 1.0, with and without the extension whose commands 1.1 took over. Validation is below the
// layer, and sees what it calls.
class OldInstance : public testing::TestWithParam<bool>
{
};

TEST_P(OldInstance, NoNewerCommandIsCalled)
{
    std::vector<std::string> messages;
    auto messenger =
        vkInit<VkDebugUtilsMessengerCreateInfoEXT>({.messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT,
                                                    .messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT,
                                                    .pfnUserCallback = remember,
                                                    .pUserData = &messages});
    const auto application = vkInit<VkApplicationInfo>({.pApplicationName = "old", .apiVersion = VK_API_VERSION_1_0});
    const char *layers[] = {"VK_LAYER_VELLUM_opacity_micromap", "VK_LAYER_KHRONOS_validation"};
    const char *extensions[] = {VK_EXT_DEBUG_UTILS_EXTENSION_NAME,
                                VK_KHR_GET_PHYSICAL_DEVICE_PROPERTIES_2_EXTENSION_NAME};
    auto info = vkInit<VkInstanceCreateInfo>({.pNext = &messenger,
                                              .pApplicationInfo = &application,
                                              .enabledLayerCount = 2,
                                              .ppEnabledLayerNames = layers,
                                              .enabledExtensionCount = GetParam() ? 2u : 1u,
                                              .ppEnabledExtensionNames = extensions});
    VkInstance instance = VK_NULL_HANDLE;
    ASSERT_EQ(vkCreateInstance(&info, nullptr, &instance), VK_SUCCESS);
    uint32_t count = 1;
    VkPhysicalDevice physical = VK_NULL_HANDLE;
    ASSERT_GE(vkEnumeratePhysicalDevices(instance, &count, &physical), VK_SUCCESS);
    ASSERT_EQ(count, 1u);
    ASSERT_EQ(vkEnumerateDeviceExtensionProperties(physical, nullptr, &count, nullptr), VK_SUCCESS);
    std::vector<VkExtensionProperties> offered(count);
    ASSERT_EQ(vkEnumerateDeviceExtensionProperties(physical, nullptr, &count, offered.data()), VK_SUCCESS);
    const bool micromaps = std::any_of(offered.begin(), offered.end(), [](const VkExtensionProperties &e) {
        return std::strcmp(e.extensionName, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME) == 0;
    });
    EXPECT_FALSE(micromaps); // acceleration structures take Vulkan 1.1
    const float priority = 1;
    auto queue = vkInit<VkDeviceQueueCreateInfo>({.queueCount = 1, .pQueuePriorities = &priority});
    auto deviceInfo = vkInit<VkDeviceCreateInfo>({.queueCreateInfoCount = 1, .pQueueCreateInfos = &queue});
    VkDevice device = VK_NULL_HANDLE;
    ASSERT_EQ(vkCreateDevice(physical, &deviceInfo, nullptr, &device), VK_SUCCESS);
    vkDestroyDevice(device, nullptr);
    vkDestroyInstance(instance, nullptr);
    for (const std::string &message : messages)
        ADD_FAILURE() << message;
}

INSTANTIATE_TEST_SUITE_P(Extension, OldInstance, testing::Bool());

// Loaders return their own function of VK_EXT_debug_utils for a device whose instance does not have the extension, but
// not while the device is created. NVIDIA's nvpro_core names objects whenever it gets the function.
TEST(InstanceWithoutDebugUtils, ObjectsCanBeNamed)
{
    const auto application = vkInit<VkApplicationInfo>({.apiVersion = VK_API_VERSION_1_2});
    const char *layer = "VK_LAYER_VELLUM_opacity_micromap";
    auto info = vkInit<VkInstanceCreateInfo>(
        {.pApplicationInfo = &application, .enabledLayerCount = 1, .ppEnabledLayerNames = &layer});
    VkInstance instance = VK_NULL_HANDLE;
    ASSERT_EQ(vkCreateInstance(&info, nullptr, &instance), VK_SUCCESS);
    uint32_t count = 1;
    VkPhysicalDevice physical = VK_NULL_HANDLE;
    ASSERT_GE(vkEnumeratePhysicalDevices(instance, &count, &physical), VK_SUCCESS);
    const float priority = 1;
    auto queueInfo = vkInit<VkDeviceQueueCreateInfo>({.queueCount = 1, .pQueuePriorities = &priority});
    auto deviceInfo = vkInit<VkDeviceCreateInfo>({.queueCreateInfoCount = 1, .pQueueCreateInfos = &queueInfo});
    VkDevice device = VK_NULL_HANDLE;
    ASSERT_EQ(vkCreateDevice(physical, &deviceInfo, nullptr, &device), VK_SUCCESS);
    VkQueue queue = VK_NULL_HANDLE;
    vkGetDeviceQueue(device, 0, 0, &queue);
    const auto load = [&]<class Function>(Function, const char *name) {
        return reinterpret_cast<Function>(vkGetDeviceProcAddr(device, name));
    };
    auto name = vkInit<VkDebugUtilsObjectNameInfoEXT>({.objectType = VK_OBJECT_TYPE_QUEUE,
                                                       .objectHandle = reinterpret_cast<uint64_t>(queue),
                                                       .pObjectName = "queue"});
    if (const auto set = load(PFN_vkSetDebugUtilsObjectNameEXT{}, "vkSetDebugUtilsObjectNameEXT")) {
        EXPECT_EQ(set(device, &name), VK_SUCCESS);
    }
    auto tag = vkInit<VkDebugUtilsObjectTagInfoEXT>({.objectType = VK_OBJECT_TYPE_QUEUE,
                                                     .objectHandle = reinterpret_cast<uint64_t>(queue),
                                                     .tagSize = 1,
                                                     .pTag = "x"});
    if (const auto set = load(PFN_vkSetDebugUtilsObjectTagEXT{}, "vkSetDebugUtilsObjectTagEXT")) {
        EXPECT_EQ(set(device, &tag), VK_SUCCESS);
    }
    auto label = vkInit<VkDebugUtilsLabelEXT>({.pLabelName = "label"});
    if (const auto begin = load(PFN_vkQueueBeginDebugUtilsLabelEXT{}, "vkQueueBeginDebugUtilsLabelEXT"))
        begin(queue, &label);
    if (const auto insert = load(PFN_vkQueueInsertDebugUtilsLabelEXT{}, "vkQueueInsertDebugUtilsLabelEXT"))
        insert(queue, &label);
    if (const auto end = load(PFN_vkQueueEndDebugUtilsLabelEXT{}, "vkQueueEndDebugUtilsLabelEXT"))
        end(queue);
    vkDestroyDevice(device, nullptr);
    vkDestroyInstance(instance, nullptr);
}

} // namespace
