// SPDX-License-Identifier: Apache-2.0
// Vulkan instances, their physical devices, and which of these is used.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
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
    // With Vellum's layer where `wantLayer` and the loader finds it.
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

struct DeviceInfo {
    const Instance *instance = nullptr;
    VkPhysicalDevice handle = VK_NULL_HANDLE;
    uint32_t number = 0; // in Vulkan's list
    std::string name;
    std::set<std::string> extensions;
    VkPhysicalDeviceType type = VK_PHYSICAL_DEVICE_TYPE_OTHER;
    bool rayQuery = false; // with Vulkan 1.3 and acceleration structures
    bool rayTracingPipelines = false;
    bool khrMicromaps = false; // of the driver or a layer
    bool extMicromaps = false;
    std::string implementation; // of micromaps, in words

    [[nodiscard]] bool has(Api api) const { return api == Api::Khr ? khrMicromaps : extMicromaps; }
};

// `instance` must outlive what is made of them.
std::vector<DeviceInfo> listDevices(const Instance &instance);

// Selects a device, as --device does: a text of digits is a number in Vulkan's list and nothing else, any other text a
// part of a name. Of several, and without a text of all, the most powerful kind that has ray queries, and the first of
// these.
class DeviceSelection
{
public:
    DeviceSelection() = default;
    explicit DeviceSelection(std::optional<std::string> text) : text_(std::move(text)) {}

    // Throws std::runtime_error where there is none.
    [[nodiscard]] DeviceInfo from(std::span<const DeviceInfo> devices) const;
    [[nodiscard]] DeviceInfo from(const Instance &instance) const { return from(listDevices(instance)); }
    // Nothing where it does not select by number.
    [[nodiscard]] std::optional<uint32_t> number() const;
    // For the command line of another process.
    [[nodiscard]] const std::optional<std::string> &text() const { return text_; }

private:
    std::optional<std::string> text_;
};

// Throws std::runtime_error where the device lacks the extension. `layer`: the layer was enabled.
void requireMicromaps(const DeviceInfo &device, Api api, bool layer);

} // namespace vellum::gpu
