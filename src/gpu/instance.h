// SPDX-License-Identifier: Apache-2.0
// Vulkan instances.
#pragma once

#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include <vulkan/vulkan.h>

#include "gpu/layer_path.h"

namespace vellum::gpu
{

// The extension that micromaps are made and used with.
enum class Api {
    Ext, // VK_EXT_opacity_micromap
    Khr, // VK_KHR_opacity_micromap, with VK_KHR_device_address_commands, which it depends on
};
// The extension's name.
const char *extensionOf(Api api);

// A call that failed.
class VulkanError : public std::runtime_error
{
public:
    // `call`: the source text of the call, of which the message has the command.
    VulkanError(VkResult result, const char *call);
    [[nodiscard]] VkResult result() const { return result_; }

private:
    VkResult result_;
};

// Throws VulkanError for everything but VK_SUCCESS.
void checkResult(VkResult result, const char *call);
#define CHECK_VK(call) ::vellum::gpu::checkResult((call), #call)

struct Message {
    VkDebugUtilsMessageSeverityFlagBitsEXT severity;
    std::string id;
    std::string text;
    std::string object; // name of the first object that it is about

    [[nodiscard]] bool fromVellum() const { return id.starts_with("VELLUM-"); }
};

struct InstanceOptions {
    std::vector<std::string> layers; // the first one is nearest to the application
    uint32_t apiVersion = VK_API_VERSION_1_3;
    // Called with the messages of layers and the driver, on whichever thread they come.
    std::function<void(Message)> onMessage = {};
};

class Instance
{
public:
    explicit Instance(InstanceOptions options);
    // With Vellum's layer if `wantLayer` and the loader finds it.
    explicit Instance(bool wantLayer);
    ~Instance();
    Instance(const Instance &) = delete;
    Instance &operator=(const Instance &) = delete;

    [[nodiscard]] VkInstance handle() const { return instance_; }
    [[nodiscard]] const InstanceOptions &options() const { return options_; }
    [[nodiscard]] bool hasLayers() const { return !options_.layers.empty(); }

private:
    InstanceOptions options_;
    VkInstance instance_ = VK_NULL_HANDLE;
    VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
};

} // namespace vellum::gpu
