// SPDX-License-Identifier: Apache-2.0
// Callbacks for messages of validation may call commands.
#include "recorded.h"

namespace
{

using namespace vt;

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

} // namespace
