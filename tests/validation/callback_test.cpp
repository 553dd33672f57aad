// SPDX-License-Identifier: Apache-2.0
// Callbacks for messages of validation may call commands.
#include "recorded.h"

#if defined(__SANITIZE_ADDRESS__)
#include <sanitizer/lsan_interface.h>
#endif

namespace
{

using namespace vt;

// While it exists, allocations need not be freed.
#if defined(__SANITIZE_ADDRESS__)
using MayLeak = __lsan::ScopedDisabler;
#else
struct MayLeak {
    MayLeak() {}
};
#endif

class ValidationCallback : public GpuTest
{
protected:
    ValidationCallback() : GpuTest({.validation = false, .validate = true}) {}
};

struct Called {
    VkDevice device;
    VkSemaphore semaphore;
    bool destroyed = false;
};

// The message is about a command buffer that is submitted.
TEST_F(ValidationCallback, DestroysASemaphore)
{
    Called called{gpu().device(), VK_NULL_HANDLE};
    const auto semaphore = vkInit<VkSemaphoreCreateInfo>();
    VT_CHECK(vkCreateSemaphore(gpu().device(), &semaphore, nullptr, &called.semaphore));
    auto info =
        vkInit<VkDebugUtilsMessengerCreateInfoEXT>({.messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT,
                                                    .messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT});
    info.pUserData = &called;
    info.pfnUserCallback = [](VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                              const VkDebugUtilsMessengerCallbackDataEXT *, void *data) -> VkBool32 {
        auto &call = *static_cast<Called *>(data);
        if (!call.destroyed)
            vkDestroySemaphore(call.device, call.semaphore, nullptr);
        call.destroyed = true;
        return VK_FALSE;
    };
    VkDebugUtilsMessengerEXT messenger = VK_NULL_HANDLE;
    const auto create = reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(
        vkGetInstanceProcAddr(gpu().instance(), "vkCreateDebugUtilsMessengerEXT"));
    const auto destroy = reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(
        vkGetInstanceProcAddr(gpu().instance(), "vkDestroyDebugUtilsMessengerEXT"));
    VT_CHECK(create(gpu().instance(), &info, nullptr, &messenger));
    {
        const Twins twins(gpu());
        const Micromap target(gpu(), twins.source, twins.source.size());
        gpu().submit([&](VkCommandBuffer commands) {
            recordMicromapCopy(gpu(), commands, twins.other, target.handle(), VK_COPY_MICROMAP_MODE_CLONE_EXT);
        });
    }
    EXPECT_TRUE(called.destroyed);
    EXPECT_FALSE(gpu().takeMessages().empty());
    destroy(gpu().instance(), messenger, nullptr);
}

// A micromap that was destroyed is said to be.
TEST_F(ValidationCallback, StatesThatAnObjectWasDestroyed)
{
    Micromap micromap(gpu(), oneTriangle());
    micromap.build();
    SharedMemory memory(gpu());
    const MicromapHandle handle = memory.create(0, micromap.size());
    memory.destroy(handle);
    const char *quirks = std::getenv("VELLUM_TEST_QUIRKS");
    if (gpu().khr() || !quirks || !*quirks) // drivers do not know handles of VK_EXT_opacity_micromap
        recordUnlessWrong(gpu(), true, [&](VkCommandBuffer commands) {
            recordMicromapBuilds(gpu(), commands, std::array{MicromapBuild{micromap.buildInfo(), handle}});
        });
    else
        GTEST_SKIP();
    const std::vector<Message> messages = gpu().takeMessages();
    EXPECT_TRUE(std::ranges::any_of(
        messages, [](const Message &m) { return m.text.find("it was destroyed") != std::string::npos; }));
}

// A device is destroyed before its micromap.
TEST_F(ValidationCallback, MicromapsThatAreNotDestroyed)
{
    const char *extensions[] = {VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                                VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME};
    const float priority = 1;
    const auto queue = vkInit<VkDeviceQueueCreateInfo>({.queueCount = 1, .pQueuePriorities = &priority});
    auto addresses = vkInit<VkPhysicalDeviceBufferDeviceAddressFeatures>({.bufferDeviceAddress = VK_TRUE});
    auto structures = vkInit<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
        {.pNext = &addresses, .accelerationStructure = VK_TRUE});
    auto micromaps = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesEXT>({.pNext = &structures, .micromap = VK_TRUE});
    const auto info = vkInit<VkDeviceCreateInfo>({.pNext = &micromaps,
                                                  .queueCreateInfoCount = 1,
                                                  .pQueueCreateInfos = &queue,
                                                  .enabledExtensionCount = std::size(extensions),
                                                  .ppEnabledExtensionNames = extensions});
    for (const bool leaks : {false, true}) {
        VkDevice device = VK_NULL_HANDLE;
        VT_CHECK(vkCreateDevice(gpu().physical(), &info, nullptr, &device));
        const auto create =
            reinterpret_cast<PFN_vkCreateMicromapEXT>(vkGetDeviceProcAddr(device, "vkCreateMicromapEXT"));
        const auto destroy =
            reinterpret_cast<PFN_vkDestroyMicromapEXT>(vkGetDeviceProcAddr(device, "vkDestroyMicromapEXT"));
        const auto creation =
            vkInit<VkBufferCreateInfo>({.size = 4096, .usage = VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT});
        VkBuffer buffer = VK_NULL_HANDLE;
        VT_CHECK(vkCreateBuffer(device, &creation, nullptr, &buffer));
        const auto of = vkInit<VkMicromapCreateInfoEXT>(
            {.buffer = buffer, .size = 4096, .type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT});
        VkMicromapEXT micromap = VK_NULL_HANDLE;
        {
            const MayLeak mayLeak;
            VT_CHECK(create(device, &of, nullptr, &micromap));
        }
        if (!leaks)
            destroy(device, micromap, nullptr);
        vkDestroyBuffer(device, buffer, nullptr);
        gpu().takeMessages();
        vkDestroyDevice(device, nullptr);
        EXPECT_EQ(std::ranges::count(gpu().takeMessages(), std::string("VELLUM-VUID-vkDestroyDevice-device-05137"),
                                     &Message::id),
                  leaks ? 1 : 0);
    }
}

// Each extension is enabled without an extension that it requires.
TEST_F(ValidationCallback, DeviceWithoutRequiredExtensions)
{
    constexpr const char *kStructures = VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME;
    const struct {
        const char *missing;
        std::vector<const char *> extensions;
    } cases[] = {
        {VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME, {kStructures, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME}},
        {kStructures, {VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME}},
        {kStructures, {VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME}},
        {VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME, {kStructures, VK_ARM_PIPELINE_OPACITY_MICROMAP_EXTENSION_NAME}},
        {"", {kStructures, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME}},
    };
    for (const auto &[missing, required] : cases) {
        std::vector<const char *> extensions = required;
        extensions.push_back(VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME);
        const float priority = 1;
        const auto queue = vkInit<VkDeviceQueueCreateInfo>({.queueCount = 1, .pQueuePriorities = &priority});
        const auto info = vkInit<VkDeviceCreateInfo>({.queueCreateInfoCount = 1,
                                                      .pQueueCreateInfos = &queue,
                                                      .enabledExtensionCount = static_cast<uint32_t>(extensions.size()),
                                                      .ppEnabledExtensionNames = extensions.data()});
        VkDevice device = VK_NULL_HANDLE;
        if (vkCreateDevice(gpu().physical(), &info, nullptr, &device) == VK_SUCCESS)
            vkDestroyDevice(device, nullptr);
        std::vector<std::string> texts;
        for (const Message &m : gpu().takeMessages())
            if (m.id == "VELLUM-VUID-vkCreateDevice-ppEnabledExtensionNames-01387")
                texts.push_back(m.text);
        ASSERT_EQ(texts.size(), *missing == 0 ? 0u : 1u) << required[0] << " without " << missing;
        EXPECT_TRUE(texts.empty() || texts[0].find(missing) != std::string::npos) << missing;
    }
}

} // namespace
