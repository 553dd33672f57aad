// SPDX-License-Identifier: Apache-2.0
#include "check/groups/session.h"

#include "check/case/case.h"

namespace vellum::check
{
namespace
{

constexpr const char *kLayer = "VK_LAYER_VELLUM_opacity_micromap";

// The number of the device that the wish names, by its number or a part of its name.
uint32_t deviceNumber(const SessionOptions &options)
{
    if (!options.device)
        return 0;
    if (options.device->find_first_not_of("0123456789") == std::string::npos)
        return static_cast<uint32_t>(std::stoul(*options.device));
    const auto info = vkInit<VkInstanceCreateInfo>();
    VkInstance instance = VK_NULL_HANDLE;
    CHECK_VK(vkCreateInstance(&info, nullptr, &instance));
    uint32_t count = 0;
    vkEnumeratePhysicalDevices(instance, &count, nullptr);
    std::vector<VkPhysicalDevice> all(count);
    vkEnumeratePhysicalDevices(instance, &count, all.data());
    uint32_t found = count;
    for (uint32_t i = 0; i < count && found == count; ++i) {
        VkPhysicalDeviceProperties properties;
        vkGetPhysicalDeviceProperties(all[i], &properties);
        if (std::string_view(properties.deviceName).find(*options.device) != std::string_view::npos)
            found = i;
    }
    vkDestroyInstance(instance, nullptr);
    if (found == count)
        throw std::runtime_error("no device has \"" + *options.device + "\" in its name");
    return found;
}

} // namespace

Session::Session(const SessionOptions &options) : options_(options)
{
    limits_ = limitsOf(device(Memory::Apart));
}

Device &Session::device(Memory memory)
{
    std::unique_ptr<Device> &device = devices_[memory];
    if (!device) {
        DeviceOptions options{.physicalDevice = deviceNumber(options_),
                              .api = options_.api,
                              .extensions = {VK_KHR_RAY_TRACING_MAINTENANCE_1_EXTENSION_NAME,
                                             VK_EXT_MESH_SHADER_EXTENSION_NAME, "VK_KHR_maintenance5"},
                              .memory = memory};
        if (options_.layer)
            options.layers.emplace_back(kLayer);
        options.onMessage = [this](const Message &message) {
            if (message.severity < VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT)
                return;
            const std::lock_guard lock(mutex_);
            errors_.push_back(message.id + ": " + message.text);
        };
        device = std::make_unique<Device>(options);
    }
    return *device;
}

std::vector<std::string> Session::takeErrors()
{
    const std::lock_guard lock(mutex_);
    return std::exchange(errors_, {});
}

std::shared_ptr<Session> openSession(const SessionOptions &options)
{
    return std::make_shared<Session>(options);
}

} // namespace vellum::check
