// SPDX-License-Identifier: Apache-2.0
// Vulkan instances, and the layer next to the command, which is found and turned on without an installation.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>
#include <vulkan/vulkan.h>

namespace vellum::gpu
{

// Finds the layer next to the command, and turns it on without an installation.
inline constexpr const char *kLayerName = "VK_LAYER_VELLUM_opacity_micromap";

// The folder with the layer's manifest next to this program: the program's own in the archive for Windows, <build>/lib
// in a build tree, or <prefix>/share/vulkan/explicit_layer.d after installation. Nothing if there is no manifest.
std::optional<std::filesystem::path> findLayerFolder();

// Returns whether the Vulkan loader finds the layer.
bool layerIsAvailable();

// Adds a folder to those in which the Vulkan loader looks for explicit layers. Before the first Vulkan call.
void addLayerFolder(const std::filesystem::path &folder);
// Adds the given folder, or the one next to this program, to the loader's path. Does nothing if there is no manifest;
// the layer may be installed.
void offerLayer(const std::optional<std::filesystem::path> &folder);

// Removes the layer from the variables that turn it on in every program, VK_INSTANCE_LAYERS and
// VK_LOADER_LAYERS_ENABLE, and has loaders of 1.3.234 and newer disable it where something else turns it on. Before the
// first Vulkan call.
void withdrawLayer();

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
