// SPDX-License-Identifier: Apache-2.0
// The entry of the forcing layer: instances and devices.
#include "forcing/forcing.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <unordered_map>

#include "layer/base/pnext.h"

namespace forcing
{

Counts counts;

Counts::~Counts()
{
    std::fprintf(stderr, "forcing: %llu devices, %llu geometries, %llu ray tracing pipelines, %llu shader modules\n",
                 static_cast<unsigned long long>(devices.load()), static_cast<unsigned long long>(geometries.load()),
                 static_cast<unsigned long long>(pipelines.load()), static_cast<unsigned long long>(shaders.load()));
}

namespace
{

using vellum::layer::findInChain;

struct Instance {
    VkInstance handle = VK_NULL_HANDLE;
    InstanceTable next;
    PFN_vkGetInstanceProcAddr get = nullptr;
    Settings settings;
};

std::mutex mutex;
// Never destroyed: the layers below are gone when destructors of a process run.
auto &instances = *new std::unordered_map<void *, std::unique_ptr<Instance>>;
auto &devices = *new std::unordered_map<void *, std::unique_ptr<Device>>;

template <class Handle>
void *keyOf(Handle handle)
{
    return *reinterpret_cast<void **>(handle);
}

template <class Handle>
Instance &instanceOf(Handle handle)
{
    std::lock_guard lock(mutex);
    return *instances.at(keyOf(handle));
}

template <class Info>
Info *loaderInfo(const void *chain, VkStructureType type, VkLayerFunction function)
{
    auto *info = static_cast<Info *>(const_cast<void *>(chain));
    while (info != nullptr && !(info->sType == type && info->function == function))
        info = static_cast<Info *>(const_cast<void *>(info->pNext));
    return info;
}

template <class Value>
bool choose(const char *variable, std::initializer_list<std::pair<std::string_view, Value>> values, Value &chosen)
{
    const char *text = std::getenv(variable);
    if (text == nullptr)
        return true;
    for (const auto &[name, value] : values) {
        if (name != text)
            continue;
        chosen = value;
        return true;
    }
    std::fprintf(stderr, "forcing: %s is '%s'\n", variable, text);
    return false;
}

bool asksFor(const VkDeviceCreateInfo &info, const char *extension)
{
    return std::any_of(info.ppEnabledExtensionNames, info.ppEnabledExtensionNames + info.enabledExtensionCount,
                       [=](const char *name) { return std::strcmp(name, extension) == 0; });
}

template <class Features>
const Features *features(const VkDeviceCreateInfo &info, VkStructureType type)
{
    return findInChain<Features>(info.pNext, type);
}

// The device that is created in the place of the one that the application requests.
class ForcedDevice
{
public:
    ForcedDevice(Instance &instance, VkPhysicalDevice physical, const VkDeviceCreateInfo &application)
        : info(application), instance_(instance), physical_(physical)
    {
        const auto *structures = features<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
            info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR);
        if (structures == nullptr || !structures->accelerationStructure ||
            !asksFor(info, VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME) || !findFamily())
            return;
        if (asksFor(info, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME) ||
            asksFor(info, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME))
            useExtensions();
        else
            addExtensions();
    }

    VkDeviceCreateInfo info;
    std::optional<Api> api; // nothing: the device is left alone
    uint32_t family = 0;    // of the queue that the micromap is built on

private:
    bool findFamily()
    {
        uint32_t count = 0;
        instance_.next.GetPhysicalDeviceQueueFamilyProperties(physical_, &count, nullptr);
        std::vector<VkQueueFamilyProperties> families(count);
        instance_.next.GetPhysicalDeviceQueueFamilyProperties(physical_, &count, families.data());
        for (uint32_t i = 0; i < info.queueCreateInfoCount; ++i) {
            const VkDeviceQueueCreateInfo &queue = info.pQueueCreateInfos[i];
            family = queue.queueFamilyIndex;
            if (queue.flags == 0 && (families[family].queueFlags & VK_QUEUE_COMPUTE_BIT) != 0)
                return true;
        }
        return false;
    }

    // The application enables one of the extensions, or all that the device has, with their features or without.
    void useExtensions()
    {
        const Api chosen = instance_.settings.api;
        if (canUse(chosen))
            api = chosen;
        else if (const Api other = chosen == Api::Ext ? Api::Khr : Api::Ext; canUse(other))
            api = other;
    }

    // Enables what the extension needs and the application did not.
    bool canUse(Api wanted)
    {
        if (wanted == Api::Ext)
            return asksFor(info, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME) && hasMicromap(ext_);
        return asksFor(info, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME) && hasMicromap(khr_) && addAddressCommands();
    }

    // Adds the features if the application has none of that type.
    template <class Features>
    bool hasMicromap(Features &added)
    {
        const auto *own = features<Features>(info, added.sType);
        if (own == nullptr)
            prepend(added);
        return own == nullptr || own->micromap;
    }

    void addExtensions()
    {
        add(VK_KHR_SYNCHRONIZATION_2_EXTENSION_NAME);
        const bool isExt = instance_.settings.api == Api::Ext;
        if (!add(isExt ? VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME : VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME) ||
            (!isExt && !addAddressCommands())) {
            std::fprintf(stderr, "forcing: a device without the extension is left alone\n");
            return;
        }
        api = instance_.settings.api;
        if (isExt)
            prepend(ext_);
        else
            prepend(khr_);
    }

    bool addAddressCommands()
    {
        if (features<VkBaseInStructure>(info, addressCommands_.sType) == nullptr)
            prepend(addressCommands_);
        return add(VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME);
    }

    // Returns false if the device does not have it.
    bool add(const char *name)
    {
        if (asksFor(info, name))
            return true;
        uint32_t count = 0;
        instance_.next.EnumerateDeviceExtensionProperties(physical_, nullptr, &count, nullptr);
        std::vector<VkExtensionProperties> have(count);
        instance_.next.EnumerateDeviceExtensionProperties(physical_, nullptr, &count, have.data());
        if (std::none_of(have.begin(), have.end(),
                         [=](const VkExtensionProperties &e) { return std::strcmp(e.extensionName, name) == 0; }))
            return false;
        std::vector<const char *> names(info.ppEnabledExtensionNames,
                                        info.ppEnabledExtensionNames + info.enabledExtensionCount);
        names.push_back(name);
        names_ = std::move(names);
        info.enabledExtensionCount = static_cast<uint32_t>(names_.size());
        info.ppEnabledExtensionNames = names_.data();
        return true;
    }

    template <class Features>
    void prepend(Features &structure)
    {
        structure.pNext = const_cast<void *>(info.pNext);
        info.pNext = &structure;
    }

    Instance &instance_;
    VkPhysicalDevice physical_;
    std::vector<const char *> names_;
    VkPhysicalDeviceOpacityMicromapFeaturesEXT ext_{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT,
                                                    nullptr, VK_TRUE, VK_FALSE, VK_FALSE};
    VkPhysicalDeviceOpacityMicromapFeaturesKHR khr_{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_KHR,
                                                    nullptr, VK_TRUE};
    VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR addressCommands_{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR, nullptr, VK_TRUE};
};

std::vector<uint32_t> familiesIn(const VkDeviceCreateInfo &info)
{
    std::vector<uint32_t> families;
    for (uint32_t i = 0; i < info.queueCreateInfoCount; ++i)
        families.push_back(info.pQueueCreateInfos[i].queueFamilyIndex);
    std::sort(families.begin(), families.end());
    families.erase(std::unique(families.begin(), families.end()), families.end());
    return families;
}

VkResult startForcing(Instance &instance, VkPhysicalDevice physical, const ForcedDevice &forced, Device &device)
{
    Settings settings = instance.settings;
    settings.api = device.api = *forced.api;
    VkPhysicalDeviceMemoryProperties memory{};
    instance.next.GetPhysicalDeviceMemoryProperties(physical, &memory);
    device.micromap =
        std::make_unique<ForcedMicromap>(device.next, device.handle, memory, familiesIn(forced.info), settings);
    BuildQueue queue{VK_NULL_HANDLE, forced.family, nullptr};
    const auto *loader = loaderInfo<VkLayerDeviceCreateInfo>(
        forced.info.pNext, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO, VK_LOADER_DATA_CALLBACK);
    if (loader == nullptr)
        return VK_ERROR_INITIALIZATION_FAILED;
    queue.setLoaderData = loader->u.pfnSetDeviceLoaderData;
    const auto queueInfo = vkInit<VkDeviceQueueInfo2>({.queueFamilyIndex = forced.family});
    device.next.GetDeviceQueue2(device.handle, &queueInfo, &queue.handle);
    queue.setLoaderData(device.handle, queue.handle);
    ++counts.devices;
    return device.micromap->build(queue);
}

VKAPI_ATTR VkResult VKAPI_CALL createInstance(const VkInstanceCreateInfo *info, const VkAllocationCallbacks *allocator,
                                              VkInstance *handle)
{
    const std::optional<Settings> settings = settingsOfEnvironment();
    auto *link = loaderInfo<VkLayerInstanceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO,
                                                       VK_LAYER_LINK_INFO);
    if (!settings || link == nullptr)
        return VK_ERROR_INITIALIZATION_FAILED;
    const PFN_vkGetInstanceProcAddr get = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const auto create = reinterpret_cast<PFN_vkCreateInstance>(get(VK_NULL_HANDLE, "vkCreateInstance"));
    const VkResult result = create(info, allocator, handle);
    if (result != VK_SUCCESS)
        return result;
    auto instance = std::make_unique<Instance>();
    instance->handle = *handle;
    instance->get = get;
    instance->settings = *settings;
    instance->next.load(*handle, get, true);
    std::lock_guard lock(mutex);
    instances[keyOf(*handle)] = std::move(instance);
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL destroyInstance(VkInstance handle, const VkAllocationCallbacks *allocator)
{
    if (handle == VK_NULL_HANDLE)
        return;
    const PFN_vkDestroyInstance destroy = instanceOf(handle).next.DestroyInstance;
    {
        std::lock_guard lock(mutex);
        instances.erase(keyOf(handle));
    }
    destroy(handle, allocator);
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice physical, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *handle)
{
    Instance &instance = instanceOf(physical);
    auto *link = loaderInfo<VkLayerDeviceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO,
                                                     VK_LAYER_LINK_INFO);
    if (link == nullptr)
        return VK_ERROR_INITIALIZATION_FAILED;
    const PFN_vkGetInstanceProcAddr getInstance = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    const PFN_vkGetDeviceProcAddr get = link->u.pLayerInfo->pfnNextGetDeviceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const auto create = reinterpret_cast<PFN_vkCreateDevice>(getInstance(instance.handle, "vkCreateDevice"));
    const ForcedDevice forced(instance, physical, *info);
    VkResult result = create(physical, forced.api ? &forced.info : info, allocator, handle);
    if (result != VK_SUCCESS)
        return result;
    auto device = std::make_unique<Device>();
    device->handle = *handle;
    device->next.load(*handle, get);
    if (forced.api)
        result = startForcing(instance, physical, forced, *device);
    if (result != VK_SUCCESS) {
        const PFN_vkDestroyDevice destroy = device->next.DestroyDevice;
        device.reset();
        destroy(*handle, allocator);
        return result;
    }
    std::lock_guard lock(mutex);
    devices[keyOf(*handle)] = std::move(device);
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL destroyDevice(VkDevice handle, const VkAllocationCallbacks *allocator)
{
    if (handle == VK_NULL_HANDLE)
        return;
    std::unique_ptr<Device> device;
    {
        std::lock_guard lock(mutex);
        device = std::move(devices.extract(keyOf(handle)).mapped());
    }
    const PFN_vkDestroyDevice destroy = device->next.DestroyDevice;
    device.reset();
    destroy(handle, allocator);
}

PFN_vkVoidFunction forcedCommand(std::string_view name)
{
    static const std::array kOwn{FORCING_ROW("vkDestroyDevice", destroyDevice)};
    for (const std::span<const Row> rows : {std::span<const Row>(kOwn), buildRows(), shaderRows()}) {
        const auto row = std::find_if(rows.begin(), rows.end(), [=](const Row &r) { return r.name == name; });
        if (row != rows.end())
            return row->function;
    }
    return nullptr;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice device, const char *name)
{
    if (std::strcmp(name, "vkGetDeviceProcAddr") == 0)
        return reinterpret_cast<PFN_vkVoidFunction>(getDeviceProcAddr);
    const PFN_vkVoidFunction below = deviceOf(device).next.GetDeviceProcAddr(device, name);
    const PFN_vkVoidFunction forced = below != nullptr ? forcedCommand(name) : nullptr;
    return forced != nullptr ? forced : below;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance instance, const char *name)
{
    static const std::array kOwn{
        FORCING_ROW("vkGetInstanceProcAddr", getInstanceProcAddr), FORCING_ROW("vkCreateInstance", createInstance),
        FORCING_ROW("vkDestroyInstance", destroyInstance), FORCING_ROW("vkGetDeviceProcAddr", getDeviceProcAddr),
        FORCING_ROW("vkCreateDevice", createDevice)};
    for (const Row &row : kOwn) {
        if (std::strcmp(row.name, name) == 0)
            return row.function;
    }
    if (instance == VK_NULL_HANDLE)
        return nullptr;
    const PFN_vkVoidFunction below = instanceOf(instance).get(instance, name);
    const PFN_vkVoidFunction forced = below != nullptr ? forcedCommand(name) : nullptr;
    return forced != nullptr ? forced : below;
}

} // namespace

std::optional<Settings> settingsOfEnvironment()
{
    Settings settings;
    const bool right = choose<Content>("VELLUM_FORCING",
                                       {{"mixed", Content::Mixed},
                                        {"data", Content::Data},
                                        {"special", Content::Special},
                                        {"transparent", Content::Transparent}},
                                       settings.content) &&
                       choose<Api>("VELLUM_FORCING_API", {{"ext", Api::Ext}, {"khr", Api::Khr}}, settings.api);
    return right ? std::optional(settings) : std::nullopt;
}

Device &deviceOfKey(void *key)
{
    std::lock_guard lock(mutex);
    return *devices.at(key);
}

} // namespace forcing

extern "C" __attribute__((visibility("default"))) VKAPI_ATTR VkResult VKAPI_CALL
vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface *version)
{
    version->loaderLayerInterfaceVersion = 2;
    version->pfnGetInstanceProcAddr = forcing::getInstanceProcAddr;
    version->pfnGetDeviceProcAddr = forcing::getDeviceProcAddr;
    version->pfnGetPhysicalDeviceProcAddr = nullptr;
    return VK_SUCCESS;
}
