// A layer for the tests, below Vellum's: it stands for a driver that knows nothing of micromaps, and tells the debug
// messengers of every flag, structure and extension name of theirs that reaches it. (The validation layer does not: it
// knows the extension and lets most of its bits pass.)
// It also checks that stack sizes which the application sets have room for all shaders of the driver's pipeline, and,
// where VELLUM_TEST_SPY_DEFER is in the environment, is a driver that defers the creation of ray tracing pipelines.
// Where VELLUM_TEST_SPY_MARKER is there, it is a driver with VK_AMD_buffer_marker; where VELLUM_TEST_SPY_BARRIERS is,
// it tells of every memory and buffer barrier.
// Where VELLUM_TEST_SPY_DISPLACEMENT is there when the instance is made, the driver says that it has micromaps, and
// displacement micromaps. Where VELLUM_TEST_SPY_MEMORY is there when the instance is made, the driver has one more type
// of memory; for as long as it stays there, the others have none left.
#include "layers/spy.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <map>
#include <vector>

namespace spy
{

std::mutex mutex;

namespace
{

struct Messenger {
    VkDebugUtilsMessengerEXT handle;
    PFN_vkDebugUtilsMessengerCallbackEXT callback;
    void *user;
};

// By dispatch key; entries stay, a later handle with the same key replaces them.
std::map<void *, InstanceTable> instances;
std::map<void *, PFN_vkGetDeviceProcAddr> devices;
std::map<void *, VkDevice> deviceHandles;
std::vector<Messenger> messengers;

} // namespace

InstanceTable tableOf(void *key)
{
    std::lock_guard lock(mutex);
    return instances.at(key);
}

PFN_vkVoidFunction nextOfDevice(void *key, const char *name)
{
    std::lock_guard lock(mutex);
    return devices.at(key)(deviceHandles.at(key), name);
}

void tell(const std::string &text)
{
    std::vector<Messenger> all;
    {
        std::lock_guard lock(mutex);
        all = messengers;
    }
    VkDebugUtilsMessengerCallbackDataEXT data{};
    data.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CALLBACK_DATA_EXT;
    data.pMessageIdName = "SPY";
    data.pMessage = text.c_str();
    for (const Messenger &m : all)
        m.callback(VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT, VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT, &data,
                   m.user);
}

namespace
{

// --- VK_NV_displacement_micromap ---

constexpr const char *kDisplacement = "VK_NV_displacement_micromap";
bool displacement = false;

struct OneMember { // VkPhysicalDeviceDisplacementMicromapFeaturesNV and ...PropertiesNV
    VkStructureType sType;
    void *pNext;
    std::uint32_t value;
};

void answer(void *chain, VkStructureType type, std::uint32_t value)
{
    auto *structure = static_cast<VkBaseOutStructure *>(chain);
    while (structure != nullptr && structure->sType != type)
        structure = structure->pNext;
    if (displacement && structure != nullptr)
        reinterpret_cast<OneMember *>(structure)->value = value;
}

VKAPI_ATTR VkResult VKAPI_CALL enumerateExtensions(VkPhysicalDevice handle, const char *layer, std::uint32_t *count,
                                                   VkExtensionProperties *properties)
{
    const auto next = tableOf(keyOf(handle)).enumerateExtensions;
    if (!displacement || layer != nullptr)
        return next(handle, layer, count, properties);
    std::uint32_t below = 0;
    next(handle, nullptr, &below, nullptr);
    std::vector<VkExtensionProperties> all(below);
    next(handle, nullptr, &below, all.data());
    for (const char *name : {VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME, kDisplacement}) {
        std::strcpy(all.emplace_back().extensionName, name);
        all.back().specVersion = 1;
    }
    const auto size = static_cast<std::uint32_t>(all.size());
    if (properties == nullptr) {
        *count = size;
        return VK_SUCCESS;
    }
    *count = std::min(*count, size);
    std::copy_n(all.begin(), *count, properties);
    return *count < size ? VK_INCOMPLETE : VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL getFeatures(VkPhysicalDevice handle, VkPhysicalDeviceFeatures2 *features)
{
    tableOf(keyOf(handle)).getFeatures(handle, features);
    answer(features->pNext, static_cast<VkStructureType>(1000397000), VK_TRUE);
}

VKAPI_ATTR void VKAPI_CALL getProperties(VkPhysicalDevice handle, VkPhysicalDeviceProperties2 *properties)
{
    tableOf(keyOf(handle)).getProperties(handle, properties);
    answer(properties->pNext, static_cast<VkStructureType>(1000397001), 5);
}

PFN_vkVoidFunction deviceFunction(const char *name)
{
    const auto is = [name](const char *other) {
        // With or without the KHR of the extension it came from.
        const std::size_t length = std::strlen(other);
        return std::strncmp(name, other, length) == 0 && (name[length] == 0 || std::strcmp(name + length, "KHR") == 0);
    };
    for (const std::span<const Row> rows : {synchronization(), structures(), memory(), pipelines(), pipelineCaches()}) {
        for (const Row &row : rows) {
            if (is(row.name))
                return row.function;
        }
    }
    return nullptr;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice device, const char *name)
{
    if (std::strcmp(name, "vkGetDeviceProcAddr") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(getDeviceProcAddr);
    for (const PFN_vkVoidFunction ours : {bufferMarkerFunction(name), markerFunction(name)}) {
        if (ours != nullptr)
            return ours;
    }
    PFN_vkGetDeviceProcAddr next = nullptr;
    {
        std::lock_guard lock(mutex);
        next = devices.at(keyOf(device));
    }
    const PFN_vkVoidFunction below = next(device, name);
    const PFN_vkVoidFunction ours = below != nullptr ? deviceFunction(name) : nullptr;
    return ours != nullptr ? ours : below;
}

// The loader's link to the layer below, which is moved on for that layer's own use.
template <class Link>
Link *linkOf(const void *chain, VkStructureType type)
{
    auto *structure = static_cast<Link *>(const_cast<void *>(chain));
    while (structure != nullptr && !(structure->sType == type && structure->function == VK_LAYER_LINK_INFO))
        structure = static_cast<Link *>(const_cast<void *>(structure->pNext));
    return structure;
}

VKAPI_ATTR VkResult VKAPI_CALL createInstance(const VkInstanceCreateInfo *info, const VkAllocationCallbacks *allocator,
                                              VkInstance *instance)
{
    displacement = std::getenv("VELLUM_TEST_SPY_DISPLACEMENT") != nullptr;
    setMoreMemory(std::getenv("VELLUM_TEST_SPY_MEMORY") != nullptr);
    auto *link = linkOf<VkLayerInstanceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO);
    const PFN_vkGetInstanceProcAddr next = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const auto create = reinterpret_cast<PFN_vkCreateInstance>(next(VK_NULL_HANDLE, "vkCreateInstance"));
    const VkResult result = create(info, allocator, instance);
    if (result == VK_SUCCESS) {
        InstanceTable table{*instance, next};
        table.createMessenger =
            reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(next(*instance, "vkCreateDebugUtilsMessengerEXT"));
        table.destroyMessenger =
            reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(next(*instance, "vkDestroyDebugUtilsMessengerEXT"));
        table.enumerateExtensions = reinterpret_cast<PFN_vkEnumerateDeviceExtensionProperties>(
            next(*instance, "vkEnumerateDeviceExtensionProperties"));
        table.getFeatures =
            reinterpret_cast<PFN_vkGetPhysicalDeviceFeatures2>(next(*instance, "vkGetPhysicalDeviceFeatures2"));
        table.getProperties =
            reinterpret_cast<PFN_vkGetPhysicalDeviceProperties2>(next(*instance, "vkGetPhysicalDeviceProperties2"));
        table.getMemoryProperties = reinterpret_cast<PFN_vkGetPhysicalDeviceMemoryProperties>(
            next(*instance, "vkGetPhysicalDeviceMemoryProperties"));
        std::lock_guard lock(mutex);
        instances[keyOf(*instance)] = table;
    }
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice physical, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    for (const char *name : std::span(info->ppEnabledExtensionNames, info->enabledExtensionCount)) {
        if (std::strcmp(name, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME) == 0)
            tell("vkCreateDevice: VK_EXT_opacity_micromap");
        if (std::strcmp(name, "VK_KHR_opacity_micromap") == 0)
            tell("vkCreateDevice: VK_KHR_opacity_micromap");
        if (std::strcmp(name, "VK_ARM_pipeline_opacity_micromap") == 0)
            tell("vkCreateDevice: VK_ARM_pipeline_opacity_micromap");
        if (std::strcmp(name, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME) == 0)
            tell("vkCreateDevice: VK_KHR_device_address_commands");
        if (std::strcmp(name, kDisplacement) == 0)
            tell("vkCreateDevice: VK_NV_displacement_micromap");
    }
    if (inChain(info->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT) != nullptr)
        tell("vkCreateDevice: VkPhysicalDeviceOpacityMicromapFeaturesEXT");
    if (inChain(info->pNext, static_cast<VkStructureType>(1000623000)) != nullptr)
        tell("vkCreateDevice: VkPhysicalDeviceOpacityMicromapFeaturesKHR");
    if (inChain(info->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR) != nullptr)
        tell("vkCreateDevice: VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR");
    // VkPhysicalDevicePipelineOpacityMicromapFeaturesARM
    if (inChain(info->pNext, static_cast<VkStructureType>(1000596000)) != nullptr)
        tell("vkCreateDevice: features of pipelines with micromaps");
    auto *link = linkOf<VkLayerDeviceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
    const PFN_vkGetInstanceProcAddr nextInstance = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    const PFN_vkGetDeviceProcAddr next = link->u.pLayerInfo->pfnNextGetDeviceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const VkInstance instance = tableOf(keyOf(physical)).handle;
    const auto create = reinterpret_cast<PFN_vkCreateDevice>(nextInstance(instance, "vkCreateDevice"));
    const VkResult result = create(physical, info, allocator, device);
    if (result == VK_SUCCESS) {
        std::lock_guard lock(mutex);
        devices[keyOf(*device)] = next;
        deviceHandles[keyOf(*device)] = *device;
    }
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createMessenger(VkInstance instance, const VkDebugUtilsMessengerCreateInfoEXT *info,
                                               const VkAllocationCallbacks *allocator, VkDebugUtilsMessengerEXT *out)
{
    const VkResult result = tableOf(keyOf(instance)).createMessenger(instance, info, allocator, out);
    if (result == VK_SUCCESS) {
        std::lock_guard lock(mutex);
        messengers.push_back({*out, info->pfnUserCallback, info->pUserData});
    }
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroyMessenger(VkInstance instance, VkDebugUtilsMessengerEXT messenger,
                                            const VkAllocationCallbacks *allocator)
{
    {
        std::lock_guard lock(mutex);
        std::erase_if(messengers, [messenger](const Messenger &m) { return m.handle == messenger; });
    }
    tableOf(keyOf(instance)).destroyMessenger(instance, messenger, allocator);
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance instance, const char *name)
{
    if (std::strcmp(name, "vkGetInstanceProcAddr") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(getInstanceProcAddr);
    if (std::strcmp(name, "vkCreateInstance") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(createInstance);
    if (std::strcmp(name, "vkGetDeviceProcAddr") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(getDeviceProcAddr);
    if (std::strcmp(name, "vkCreateDevice") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(createDevice);
    if (std::strcmp(name, "vkEnumerateDeviceExtensionProperties") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(enumerateExtensions);
    if (std::strcmp(name, "vkGetPhysicalDeviceFeatures2") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(getFeatures);
    if (std::strcmp(name, "vkGetPhysicalDeviceProperties2") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(getProperties);
    if (std::strcmp(name, "vkGetPhysicalDeviceMemoryProperties") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(getMemoryProperties);
    if (std::strcmp(name, "vkCreateDebugUtilsMessengerEXT") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(createMessenger);
    if (std::strcmp(name, "vkDestroyDebugUtilsMessengerEXT") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(destroyMessenger);
    if (const PFN_vkVoidFunction ours = deviceFunction(name))
        return ours;
    if (instance == VK_NULL_HANDLE)
        return nullptr;
    return tableOf(keyOf(instance)).getProcAddr(instance, name);
}

} // namespace
} // namespace spy

extern "C" __attribute__((visibility("default"))) VKAPI_ATTR VkResult VKAPI_CALL
vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface *version)
{
    version->loaderLayerInterfaceVersion = 2;
    version->pfnGetInstanceProcAddr = spy::getInstanceProcAddr;
    version->pfnGetDeviceProcAddr = spy::getDeviceProcAddr;
    version->pfnGetPhysicalDeviceProcAddr = nullptr;
    return VK_SUCCESS;
}
