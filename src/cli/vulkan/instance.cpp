// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cctype>
#include <cstring>
#include <set>
#include <utility>

#include "cli/vulkan/context.h"
#include "cli/vulkan/layer_path.h"

namespace vellum::cli
{
namespace
{

const char *nameOf(VkResult result)
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
    check(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, nullptr), "listing device extensions");
    std::vector<VkExtensionProperties> extensions(count);
    check(vkEnumerateDeviceExtensionProperties(device, nullptr, &count, extensions.data()),
          "listing device extensions");
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
    VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR addressCommands{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR, nullptr, VK_FALSE};
    VkPhysicalDeviceOpacityMicromapFeaturesKHR khrMicromap{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_KHR, nullptr, VK_FALSE};
    VkPhysicalDeviceOpacityMicromapFeaturesEXT extMicromap{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT, nullptr, VK_FALSE, VK_FALSE, VK_FALSE};
    VkPhysicalDeviceRayTracingPipelineFeaturesKHR pipelines{};
    pipelines.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_FEATURES_KHR;
    VkPhysicalDeviceRayQueryFeaturesKHR rayQuery{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR, nullptr,
                                                 VK_FALSE};
    const auto ask = [&](auto &feature, const char *extension) {
        if (extensions.contains(extension))
            feature.pNext = std::exchange(rayQuery.pNext, &feature);
    };
    ask(addressCommands, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME);
    ask(khrMicromap, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME);
    ask(extMicromap, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME);
    ask(pipelines, VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME);
    VkPhysicalDeviceFeatures2 features{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &rayQuery, {}};
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

// Digits are a number even where they are a part of a name.
bool isNamed(const DeviceInfo &device, const std::string &wish)
{
    if (wish.find_first_not_of("0123456789") == std::string::npos)
        return wish == std::to_string(device.number);
    return contains(device.name, wish);
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

void check(VkResult result, const char *what)
{
    if (result == VK_SUCCESS)
        return;
    const char *name = nameOf(result);
    throw Error(std::string(what) +
                " failed: " + (name != nullptr ? std::string(name) : "VkResult " + std::to_string(result)));
}

const char *nameOf(MicromapApi api)
{
    return api == MicromapApi::Khr ? VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME : VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME;
}

void requireMicromaps(const DeviceInfo &device, MicromapApi api, bool layer)
{
    if (device.has(api))
        return;
    std::string text = device.name + " has no " + nameOf(api);
    const MicromapApi other = api == MicromapApi::Khr ? MicromapApi::Ext : MicromapApi::Khr;
    if (device.has(other))
        text += std::string(", but ") + nameOf(other) + ": --api " + (other == MicromapApi::Khr ? "khr" : "ext");
    else if (!layer)
        text += ", and the layer that brings it is not turned on";
    throw Error(text);
}

Instance::Instance(bool wantLayer)
{
    layerEnabled_ = wantLayer && layerIsAvailable();
    VkApplicationInfo application{};
    application.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO;
    application.pApplicationName = "vellum";
    application.apiVersion = VK_API_VERSION_1_3;
    VkInstanceCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO;
    info.pApplicationInfo = &application;
    const char *layer = kLayerName;
    info.enabledLayerCount = layerEnabled_ ? 1 : 0;
    info.ppEnabledLayerNames = &layer;
    const VkResult result = vkCreateInstance(&info, nullptr, &instance_);
    if (layerEnabled_ && result == VK_ERROR_LAYER_NOT_PRESENT) // its manifest is there, its library is not
        throw Error(std::string("the layer ") + kLayerName + " cannot be loaded; --no-layer does without it");
    check(result, "creating a Vulkan instance");
}

Instance::~Instance()
{
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
        check(vkEnumeratePhysicalDevices(instance.handle(), &count, handles.data()), "listing Vulkan devices");
    std::vector<DeviceInfo> devices;
    for (const VkPhysicalDevice handle : handles) {
        DeviceInfo &device = devices.emplace_back(describe(handle));
        device.number = static_cast<uint32_t>(devices.size() - 1);
    }
    return devices;
}

DeviceInfo chooseDevice(std::span<const DeviceInfo> devices, const std::optional<std::string> &wish)
{
    if (devices.empty())
        throw Error("there is no Vulkan device");
    const DeviceInfo *named = nullptr;
    const DeviceInfo *best = nullptr;
    for (const DeviceInfo &d : devices) {
        if (wish && !isNamed(d, *wish))
            continue;
        named = named != nullptr ? named : &d;
        if (d.rayQuery && (best == nullptr || rank(d.type) > rank(best->type)))
            best = &d;
    }
    if (best != nullptr)
        return *best;
    if (!wish)
        throw Error("no Vulkan device has ray queries (VK_KHR_ray_query and Vulkan 1.3); there is " + listOf(devices));
    if (named == nullptr)
        throw Error("--device " + *wish + " is neither the number of a Vulkan device nor a part of the name of one; " +
                    "there is " + listOf(devices));
    throw Error("the Vulkan device " + named->name + " has no ray queries");
}

DeviceInfo chooseDevice(const Instance &instance, const std::optional<std::string> &wish)
{
    return chooseDevice(listDevices(instance), wish);
}

} // namespace vellum::cli
