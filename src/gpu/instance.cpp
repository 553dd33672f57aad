// SPDX-License-Identifier: Apache-2.0
#include "gpu/instance.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <utility>

#include "base/process.h"
#include "base/text.h"
#include "core/utf8_path.h"
#include "vellum/vulkan_opacity_micromap.h"
#include "vk/vk_init.h"

namespace vellum::gpu
{
namespace
{

bool hasManifest(const std::filesystem::path &folder)
{
    std::error_code error;
    for (const auto &entry : std::filesystem::directory_iterator(folder, error)) {
        std::error_code unreadable;
        if (entry.path().extension() != ".json" || !entry.is_regular_file(unreadable))
            continue;
        std::ifstream file(entry.path());
        const std::string text(std::istreambuf_iterator<char>(file), {});
        if (text.find(kLayerName) != std::string::npos)
            return true;
    }
    return false;
}

void removeLayerFrom(const char *name, char separator)
{
    std::string rest;
    const std::string list = variable(name).value_or("");
    for (const std::string &layer : partsOf(list, separator))
        if (layer != kLayerName)
            rest += (rest.empty() ? "" : std::string(1, separator)) + layer;
    if (!list.empty())
        setVariable(name, rest);
}

} // namespace

std::optional<std::filesystem::path> findLayerFolder()
{
    const std::filesystem::path program = programPath();
    if (program.empty())
        return std::nullopt;
    const std::filesystem::path own = program.parent_path();
    const std::filesystem::path prefix = own.parent_path();
    for (const std::filesystem::path &folder : {own, prefix / "lib", prefix / "share/vulkan/explicit_layer.d"})
        if (hasManifest(folder))
            return folder;
    return std::nullopt;
}

void addLayerFolder(const std::filesystem::path &folder)
{
    // The loader ignores VK_ADD_LAYER_PATH where the user has set VK_LAYER_PATH.
    const char *name = variable("VK_LAYER_PATH") ? "VK_LAYER_PATH" : "VK_ADD_LAYER_PATH";
    const std::string old = variable(name).value_or("");
    // Behind the others: loader 1.3.239 takes the order of layers from that of their folders.
    setVariable(name, old.empty() ? utf8Text(folder) : old + kListSeparator + utf8Text(folder));
}

void offerLayer(const std::optional<std::filesystem::path> &folder)
{
    if (const auto found = folder ? folder : findLayerFolder())
        addLayerFolder(*found);
}

void withdrawLayer()
{
    removeLayerFrom("VK_INSTANCE_LAYERS", kListSeparator);
    removeLayerFrom("VK_LOADER_LAYERS_ENABLE", ',');
    const std::string disabled = variable("VK_LOADER_LAYERS_DISABLE").value_or("");
    setVariable("VK_LOADER_LAYERS_DISABLE", disabled + (disabled.empty() ? "" : ",") + kLayerName);
}

namespace
{

const char *causeOf(VkResult result)
{
    switch (result) {
    case VK_ERROR_OUT_OF_HOST_MEMORY: return "out of host memory";
    case VK_ERROR_OUT_OF_DEVICE_MEMORY: return "out of device memory";
    case VK_ERROR_DEVICE_LOST: return "the device was lost";
    case VK_ERROR_INITIALIZATION_FAILED: return "initialization failed";
    case VK_ERROR_INCOMPATIBLE_DRIVER: return "no Vulkan driver; vellum info says why";
    case VK_ERROR_LAYER_NOT_PRESENT: return "a layer is missing";
    case VK_ERROR_EXTENSION_NOT_PRESENT: return "an extension is missing";
    case VK_ERROR_FEATURE_NOT_PRESENT: return "a feature is missing";
    default: return nullptr;
    }
}

VKAPI_ATTR VkBool32 VKAPI_CALL onMessage(VkDebugUtilsMessageSeverityFlagBitsEXT severity,
                                         VkDebugUtilsMessageTypeFlagsEXT,
                                         const VkDebugUtilsMessengerCallbackDataEXT *data, void *user)
{
    static_cast<const InstanceOptions *>(user)->onMessage(
        {severity, data->pMessageIdName != nullptr ? data->pMessageIdName : "",
         data->pMessage != nullptr ? data->pMessage : "",
         data->objectCount > 0 && data->pObjects[0].pObjectName != nullptr ? data->pObjects[0].pObjectName : ""});
    return VK_FALSE;
}

} // namespace

bool layerIsAvailable()
{
    uint32_t count = 0;
    vkEnumerateInstanceLayerProperties(&count, nullptr);
    std::vector<VkLayerProperties> layers(count);
    vkEnumerateInstanceLayerProperties(&count, layers.data());
    return std::any_of(layers.begin(), layers.end(),
                       [](const VkLayerProperties &l) { return std::strcmp(l.layerName, kLayerName) == 0; });
}

VulkanError::VulkanError(VkResult result, const char *call)
    : std::runtime_error(
          std::string(call, std::strcspn(call, "(")).append(" failed: ") +
          (causeOf(result) != nullptr ? std::string(causeOf(result)) : "VkResult " + std::to_string(result))),
      result_(result)
{
}

void checkResult(VkResult result, const char *call)
{
    if (result != VK_SUCCESS)
        throw VulkanError(result, call);
}

const char *extensionOf(Api api)
{
    return api == Api::Khr ? VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME : VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME;
}

Instance::Instance(InstanceOptions options) : options_(std::move(options))
{
    const auto application =
        vkInit<VkApplicationInfo>({.pApplicationName = "vellum", .apiVersion = options_.apiVersion});
    std::vector<const char *> layers;
    for (const std::string &layer : options_.layers)
        layers.push_back(layer.c_str());
    const std::array extensions{VK_EXT_DEBUG_UTILS_EXTENSION_NAME, VK_EXT_DEBUG_REPORT_EXTENSION_NAME};
    const auto info = vkInit<VkInstanceCreateInfo>(
        {.pApplicationInfo = &application,
         .enabledLayerCount = static_cast<uint32_t>(layers.size()),
         .ppEnabledLayerNames = layers.data(),
         .enabledExtensionCount = options_.onMessage ? static_cast<uint32_t>(extensions.size()) : 0,
         .ppEnabledExtensionNames = extensions.data()});
    CHECK_VK(vkCreateInstance(&info, nullptr, &instance_));
    if (!options_.onMessage)
        return;
    const auto create = reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(
        vkGetInstanceProcAddr(instance_, "vkCreateDebugUtilsMessengerEXT"));
    const auto messenger = vkInit<VkDebugUtilsMessengerCreateInfoEXT>(
        {.messageSeverity =
             VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT,
         .messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_TYPE_GENERAL_BIT_EXT,
         .pfnUserCallback = onMessage,
         .pUserData = &options_});
    CHECK_VK(create(instance_, &messenger, nullptr, &messenger_));
}

Instance::Instance(bool wantLayer)
try : Instance(InstanceOptions{.layers = wantLayer && layerIsAvailable() ? std::vector<std::string>{kLayerName}
                                                                         : std::vector<std::string>{}}) {
} catch (const VulkanError &error) {
    if (error.result() == VK_ERROR_LAYER_NOT_PRESENT) // its manifest is there, its library is not
        throw std::runtime_error(std::string("the layer ") + kLayerName +
                                 " cannot be loaded; --no-layer does without it");
    throw;
}

Instance::~Instance()
{
    if (messenger_ != VK_NULL_HANDLE)
        reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(
            vkGetInstanceProcAddr(instance_, "vkDestroyDebugUtilsMessengerEXT"))(instance_, messenger_, nullptr);
    vkDestroyInstance(instance_, nullptr);
}

} // namespace vellum::gpu
