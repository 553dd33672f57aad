// SPDX-License-Identifier: Apache-2.0
#include "gpu/instance.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstring>
#include <utility>

#include "vellum/vulkan_opacity_micromap.h"
#include "vk/vk_init.h"

namespace vellum::gpu
{
namespace
{

const char *causeOf(VkResult result)
{
    switch (result) {
    case VK_ERROR_OUT_OF_HOST_MEMORY: return "out of host memory";
    case VK_ERROR_OUT_OF_DEVICE_MEMORY: return "out of device memory";
    case VK_ERROR_DEVICE_LOST: return "the device was lost";
    case VK_ERROR_INITIALIZATION_FAILED: return "initialization failed";
    case VK_ERROR_INCOMPATIBLE_DRIVER: return "no Vulkan driver";
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

bool layerIsAvailable()
{
    uint32_t count = 0;
    vkEnumerateInstanceLayerProperties(&count, nullptr);
    std::vector<VkLayerProperties> layers(count);
    vkEnumerateInstanceLayerProperties(&count, layers.data());
    return std::any_of(layers.begin(), layers.end(),
                       [](const VkLayerProperties &l) { return std::strcmp(l.layerName, kLayerName) == 0; });
}

std::set<std::string> extensionsOf(VkPhysicalDevice device)
{
    uint32_t count = 0;
    CHECK_VK(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, nullptr));
    std::vector<VkExtensionProperties> extensions(count);
    CHECK_VK(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, extensions.data()));
    std::set<std::string> names;
    for (const VkExtensionProperties &e : extensions)
        names.insert(e.extensionName);
    return names;
}

// Who implements the extensions: the layer reports itself as a tool, with what it does for the device.
std::string describeImplementation(VkPhysicalDevice device, uint32_t version)
{
    uint32_t count = 0;
    std::vector<VkPhysicalDeviceToolProperties> tools;
    if (version >= VK_API_VERSION_1_3 && vkGetPhysicalDeviceToolProperties(device, &count, nullptr) == VK_SUCCESS) {
        tools.resize(count, {VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_TOOL_PROPERTIES, nullptr, {}, {}, 0, {}, {}});
        vkGetPhysicalDeviceToolProperties(device, &count, tools.data());
    }
    for (const VkPhysicalDeviceToolProperties &tool : tools) {
        if (std::strcmp(tool.layer, kLayerName) != 0)
            continue;
        if (std::strcmp(tool.description, "emulated") == 0)
            return std::string("emulated by the layer ") + kLayerName;
        if (std::strcmp(tool.description, "translated") == 0)
            return std::string("the driver's VK_EXT_opacity_micromap, to which the layer ") + kLayerName +
                   " translates VK_KHR_opacity_micromap";
        return std::string("the driver's (the layer ") + kLayerName + " passes it through)";
    }
    return "the driver's";
}

DeviceInfo describe(VkPhysicalDevice device)
{
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(device, &properties);
    DeviceInfo info;
    info.handle = device;
    info.name = properties.deviceName;
    info.type = properties.deviceType;
    info.extensions = extensionsOf(device);
    const std::set<std::string> &extensions = info.extensions;
    if (properties.apiVersion < VK_API_VERSION_1_3 || !extensions.contains(VK_KHR_RAY_QUERY_EXTENSION_NAME) ||
        !extensions.contains(VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME))
        return info;
    auto addressCommands = vkInit<VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR>();
    auto khrMicromap = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesKHR>();
    auto extMicromap = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesEXT>();
    auto pipelines = vkInit<VkPhysicalDeviceRayTracingPipelineFeaturesKHR>();
    auto rayQuery = vkInit<VkPhysicalDeviceRayQueryFeaturesKHR>();
    const auto ask = [&](auto &feature, const char *extension) {
        if (extensions.contains(extension))
            feature.pNext = std::exchange(rayQuery.pNext, &feature);
    };
    ask(addressCommands, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME);
    ask(khrMicromap, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME);
    ask(extMicromap, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME);
    ask(pipelines, VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME);
    auto features = vkInit<VkPhysicalDeviceFeatures2>({.pNext = &rayQuery});
    vkGetPhysicalDeviceFeatures2(device, &features);
    info.rayQuery = rayQuery.rayQuery == VK_TRUE;
    info.rayTracingPipelines = pipelines.rayTracingPipeline == VK_TRUE;
    info.khrMicromaps = khrMicromap.micromap == VK_TRUE && addressCommands.deviceAddressCommands == VK_TRUE;
    info.extMicromaps = extMicromap.micromap == VK_TRUE;
    info.implementation =
        info.khrMicromaps || info.extMicromaps ? describeImplementation(device, properties.apiVersion) : "none";
    return info;
}

bool contains(std::string text, std::string part)
{
    const auto lower = [](std::string &s) {
        std::transform(s.begin(), s.end(), s.begin(),
                       [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    };
    lower(text);
    lower(part);
    return text.find(part) != std::string::npos;
}

// "0 (llvmpipe), 1 (Radeon)"
std::string listOf(std::span<const DeviceInfo> devices)
{
    std::string list;
    for (const DeviceInfo &device : devices)
        list += (list.empty() ? "" : ", ") + std::to_string(device.number) + " (" + device.name + ")";
    return list;
}

int rank(VkPhysicalDeviceType type)
{
    switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU: return 4;
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU: return 3;
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU: return 2;
    case VK_PHYSICAL_DEVICE_TYPE_CPU: return 1;
    default: return 0;
    }
}

} // namespace

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

void requireMicromaps(const DeviceInfo &device, Api api, bool layer)
{
    if (device.has(api))
        return;
    std::string text = device.name + " has no " + extensionOf(api);
    const Api other = api == Api::Khr ? Api::Ext : Api::Khr;
    if (device.has(other))
        text += std::string(", but ") + extensionOf(other) + ": --api " + (other == Api::Khr ? "khr" : "ext");
    else if (!layer)
        text += ", and the layer that brings it is not turned on";
    throw std::runtime_error(text);
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

std::vector<DeviceInfo> listDevices(const Instance &instance)
{
    uint32_t count = 0;
    // Without any driver some loaders fail here instead of at the instance's creation.
    if (vkEnumeratePhysicalDevices(instance.handle(), &count, nullptr) != VK_SUCCESS)
        count = 0;
    std::vector<VkPhysicalDevice> handles(count);
    if (count != 0)
        CHECK_VK(vkEnumeratePhysicalDevices(instance.handle(), &count, handles.data()));
    std::vector<DeviceInfo> devices;
    for (const VkPhysicalDevice handle : handles) {
        DeviceInfo &device = devices.emplace_back(describe(handle));
        device.instance = &instance;
        device.number = static_cast<uint32_t>(devices.size() - 1);
    }
    return devices;
}

std::optional<uint32_t> DeviceSelection::number() const
{
    uint32_t number = 0;
    if (!text_ || std::from_chars(text_->data(), text_->data() + text_->size(), number).ec != std::errc() ||
        std::to_string(number) != *text_)
        return std::nullopt;
    return number;
}

DeviceInfo DeviceSelection::from(std::span<const DeviceInfo> devices) const
{
    if (devices.empty())
        throw std::runtime_error("there is no Vulkan device");
    const DeviceInfo *named = nullptr;
    const DeviceInfo *best = nullptr;
    // Digits are a number even where they are a part of a name.
    const bool byNumber = text_ && text_->find_first_not_of("0123456789") == std::string::npos;
    for (const DeviceInfo &d : devices) {
        if (text_ && !(byNumber ? number() == d.number : contains(d.name, *text_)))
            continue;
        named = named != nullptr ? named : &d;
        if (d.rayQuery && (best == nullptr || rank(d.type) > rank(best->type)))
            best = &d;
    }
    if (best != nullptr)
        return *best;
    if (!text_)
        throw std::runtime_error("no Vulkan device has ray queries (VK_KHR_ray_query and Vulkan 1.3); there is " +
                                 listOf(devices));
    if (named == nullptr)
        throw std::runtime_error("--device " + *text_ +
                                 " is neither the number of a Vulkan device nor a part of the name of one; " +
                                 "there is " + listOf(devices));
    throw std::runtime_error("the Vulkan device " + named->name + " has no ray queries");
}

} // namespace vellum::gpu
