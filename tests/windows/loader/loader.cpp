// SPDX-License-Identifier: Apache-2.0
// vulkan-1.dll of the tests. It inserts layers above Wine's driver, winevulkan.dll; Wine's own vulkan-1.dll supports no
// layers. It implements what the tests need: explicit layers, named by the application or VK_INSTANCE_LAYERS, and the
// driver's instances and devices unchanged.
//
// Each dispatchable handle begins with a pointer to the commands of its instance or device, which are those of the
// uppermost layer. The commands of trampolines.S jump there; the others are here.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>
#include <windows.h>

#include "manifests.h"

#define EXPORTED extern "C" VKAPI_ATTR
#define VOID_FUNCTION(name) reinterpret_cast<PFN_vkVoidFunction>(name)

// Defined in trampolines.S, by the index of each command.
extern "C" const char *const vellumLoaderNames[];
extern "C" const uint64_t vellumLoaderCount;

namespace vellum::loader
{
namespace
{

struct Layer {
    PFN_vkGetInstanceProcAddr getInstance;
    PFN_vkGetDeviceProcAddr getDevice;
    std::vector<VkExtensionProperties> deviceExtensions; // provided by the layer
};

// The commands that a handle begins with; they must come first.
struct Dispatch {
    std::unique_ptr<PFN_vkVoidFunction[]> commands = std::make_unique<PFN_vkVoidFunction[]>(vellumLoaderCount);
    std::vector<Layer> layers; // from the application to the driver
    VkInstance instance = VK_NULL_HANDLE;
    VkDevice device = VK_NULL_HANDLE;
};

std::mutex mutex;
std::map<void *, std::unique_ptr<Dispatch>> dispatches; // by their commands

void setDispatch(void *handle, const Dispatch &dispatch)
{
    *static_cast<void **>(handle) = dispatch.commands.get();
}

Dispatch &dispatchOf(void *handle)
{
    std::lock_guard lock(mutex);
    return *dispatches.at(*static_cast<void **>(handle));
}

Dispatch &newDispatch()
{
    auto dispatch = std::make_unique<Dispatch>();
    std::lock_guard lock(mutex);
    return *dispatches.emplace(dispatch->commands.get(), std::move(dispatch)).first->second;
}

void forget(const Dispatch &dispatch)
{
    std::lock_guard lock(mutex);
    dispatches.erase(dispatch.commands.get());
}

template <typename Get, typename Handle>
void fill(Dispatch &dispatch, Get get, Handle handle)
{
    for (uint64_t i = 0; i < vellumLoaderCount; ++i)
        dispatch.commands[i] = get(handle, vellumLoaderNames[i]);
}

PFN_vkGetInstanceProcAddr driver()
{
    static const auto get = [] {
        const HMODULE library = LoadLibraryW(L"winevulkan.dll");
        return library ? reinterpret_cast<PFN_vkGetInstanceProcAddr>(
                             reinterpret_cast<void *>(GetProcAddress(library, "vk_icdGetInstanceProcAddr")))
                       : nullptr;
    }();
    return get;
}

template <typename Function>
Function fromDriver(VkInstance instance, const char *name)
{
    return driver() ? reinterpret_cast<Function>(driver()(instance, name)) : nullptr;
}

// The names that are also in `known`: as the loader does, the others are not passed to the driver.
std::vector<const char *> namesIn(const char *const *names, uint32_t count,
                                  const std::vector<VkExtensionProperties> &known)
{
    std::vector<const char *> kept;
    for (uint32_t i = 0; i < count; ++i)
        for (const VkExtensionProperties &extension : known)
            if (std::strcmp(names[i], extension.extensionName) == 0)
                kept.push_back(names[i]);
    return kept;
}

template <typename Structure>
Structure *layerInfo(const void *chain, VkStructureType type, VkLayerFunction function)
{
    auto *structure = static_cast<Structure *>(const_cast<void *>(chain));
    while (structure && !(structure->sType == type && structure->function == function))
        structure = static_cast<Structure *>(const_cast<void *>(structure->pNext));
    return structure;
}

// Queries the driver, or the uppermost layer, through `get`.
std::vector<VkExtensionProperties> deviceExtensions(PFN_vkGetInstanceProcAddr get, VkInstance instance,
                                                    VkPhysicalDevice physical)
{
    const auto enumerate = reinterpret_cast<PFN_vkEnumerateDeviceExtensionProperties>(
        get(instance, "vkEnumerateDeviceExtensionProperties"));
    uint32_t count = 0;
    enumerate(physical, nullptr, &count, nullptr);
    std::vector<VkExtensionProperties> known(count);
    enumerate(physical, nullptr, &count, known.data());
    return known;
}

// Below the layers. The instance's dispatch is in the loader's own structure of the chain, as a link without a
// function.
VKAPI_ATTR VkResult VKAPI_CALL createDriversInstance(const VkInstanceCreateInfo *info,
                                                     const VkAllocationCallbacks *allocator, VkInstance *instance)
{
    uint32_t count = 0;
    const auto enumerate = fromDriver<PFN_vkEnumerateInstanceExtensionProperties>(
        VK_NULL_HANDLE, "vkEnumerateInstanceExtensionProperties");
    enumerate(nullptr, &count, nullptr);
    std::vector<VkExtensionProperties> known(count);
    enumerate(nullptr, &count, known.data());
    const auto names = namesIn(info->ppEnabledExtensionNames, info->enabledExtensionCount, known);
    VkInstanceCreateInfo changed = *info;
    changed.enabledLayerCount = 0;
    changed.enabledExtensionCount = static_cast<uint32_t>(names.size());
    changed.ppEnabledExtensionNames = names.data();
    const auto create = fromDriver<PFN_vkCreateInstance>(VK_NULL_HANDLE, "vkCreateInstance");
    const VkResult result = create(&changed, allocator, instance);
    if (result == VK_SUCCESS) {
        Dispatch &dispatch = newDispatch();
        dispatch.instance = *instance;
        setDispatch(*instance, dispatch);
    }
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL enumerateDriversDevices(VkInstance instance, uint32_t *count, VkPhysicalDevice *devices)
{
    const auto enumerate = fromDriver<PFN_vkEnumeratePhysicalDevices>(instance, "vkEnumeratePhysicalDevices");
    const VkResult result = enumerate(instance, count, devices);
    for (uint32_t i = 0; devices && result >= 0 && i < *count; ++i)
        setDispatch(devices[i], dispatchOf(instance));
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createDriversDevice(VkPhysicalDevice physical, const VkDeviceCreateInfo *info,
                                                   const VkAllocationCallbacks *allocator, VkDevice *device)
{
    const VkInstance instance = dispatchOf(physical).instance;
    const auto names = namesIn(info->ppEnabledExtensionNames, info->enabledExtensionCount,
                               deviceExtensions(driver(), instance, physical));
    VkDeviceCreateInfo changed = *info;
    changed.enabledLayerCount = 0;
    changed.enabledExtensionCount = static_cast<uint32_t>(names.size());
    changed.ppEnabledExtensionNames = names.data();
    const auto create = fromDriver<PFN_vkCreateDevice>(instance, "vkCreateDevice");
    const VkResult result = create(physical, &changed, allocator, device);
    if (result == VK_SUCCESS) {
        Dispatch &dispatch = newDispatch();
        dispatch.instance = instance;
        dispatch.device = *device;
        setDispatch(*device, dispatch);
    }
    return result;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDriversInstanceProcAddr(VkInstance instance, const char *name)
{
    const std::string_view wanted = name;
    if (wanted == "vkCreateInstance")
        return VOID_FUNCTION(createDriversInstance);
    if (wanted == "vkEnumeratePhysicalDevices")
        return VOID_FUNCTION(enumerateDriversDevices);
    if (wanted == "vkCreateDevice")
        return VOID_FUNCTION(createDriversDevice);
    return driver()(instance, name);
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDriversDeviceProcAddr(VkDevice device, const char *name)
{
    static const auto get = fromDriver<PFN_vkGetDeviceProcAddr>(dispatchOf(device).instance, "vkGetDeviceProcAddr");
    return get(device, name);
}

VKAPI_ATTR VkResult VKAPI_CALL setInstanceLoaderData(VkInstance instance, void *object)
{
    *static_cast<void **>(object) = *reinterpret_cast<void **>(instance);
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL setDeviceLoaderData(VkDevice device, void *object)
{
    *static_cast<void **>(object) = *reinterpret_cast<void **>(device);
    return VK_SUCCESS;
}

bool load(const char *name, std::vector<Layer> &layers)
{
    for (const Manifest &manifest : findManifests()) {
        if (std::strcmp(manifest.properties.layerName, name) != 0)
            continue;
        const HMODULE library = LoadLibraryW(manifest.library.c_str());
        const auto negotiate =
            library ? reinterpret_cast<PFN_vkNegotiateLoaderLayerInterfaceVersion>(
                          reinterpret_cast<void *>(GetProcAddress(library, "vkNegotiateLoaderLayerInterfaceVersion")))
                    : nullptr;
        VkNegotiateLayerInterface interface {
        };
        interface.sType = LAYER_NEGOTIATE_INTERFACE_STRUCT;
        interface.loaderLayerInterfaceVersion = 2;
        if (!negotiate || negotiate(&interface) != VK_SUCCESS)
            return false;
        layers.push_back({interface.pfnGetInstanceProcAddr, interface.pfnGetDeviceProcAddr, manifest.deviceExtensions});
        return true;
    }
    return false;
}

// Implements an enumeration of Vulkan: `count` is the capacity of `to`, and then the number written.
template <typename T>
VkResult put(const std::vector<T> &from, uint32_t *count, T *to)
{
    const auto all = static_cast<uint32_t>(from.size());
    const uint32_t copied = to ? std::min(*count, all) : all;
    if (to)
        std::copy_n(from.begin(), copied, to);
    *count = copied;
    return copied < all ? VK_INCOMPLETE : VK_SUCCESS;
}

} // namespace
} // namespace vellum::loader

using namespace vellum::loader;

EXPORTED VkResult VKAPI_CALL vkEnumerateInstanceVersion(uint32_t *version)
{
    *version = VK_MAKE_API_VERSION(0, 1, 3, VK_HEADER_VERSION);
    return VK_SUCCESS;
}

EXPORTED VkResult VKAPI_CALL vkEnumerateInstanceLayerProperties(uint32_t *count, VkLayerProperties *properties)
{
    std::vector<VkLayerProperties> layers;
    for (const Manifest &manifest : findManifests())
        layers.push_back(manifest.properties);
    return put(layers, count, properties);
}

EXPORTED VkResult VKAPI_CALL vkEnumerateInstanceExtensionProperties(const char *layer, uint32_t *count,
                                                                    VkExtensionProperties *properties)
{
    if (!layer) {
        const auto enumerate = fromDriver<PFN_vkEnumerateInstanceExtensionProperties>(
            VK_NULL_HANDLE, "vkEnumerateInstanceExtensionProperties");
        return enumerate ? enumerate(nullptr, count, properties) : VK_ERROR_INITIALIZATION_FAILED;
    }
    for (const Manifest &manifest : findManifests())
        if (std::strcmp(manifest.properties.layerName, layer) == 0)
            return put(manifest.instanceExtensions, count, properties);
    return VK_ERROR_LAYER_NOT_PRESENT;
}

EXPORTED VkResult VKAPI_CALL vkEnumerateDeviceExtensionProperties(VkPhysicalDevice physical, const char *layer,
                                                                  uint32_t *count, VkExtensionProperties *properties)
{
    if (layer) {
        for (const Manifest &manifest : findManifests())
            if (std::strcmp(manifest.properties.layerName, layer) == 0)
                return put(manifest.deviceExtensions, count, properties);
        return VK_ERROR_LAYER_NOT_PRESENT;
    }
    const Dispatch &dispatch = dispatchOf(physical);
    const auto enumerate = reinterpret_cast<PFN_vkEnumerateDeviceExtensionProperties>(
        dispatch.layers[0].getInstance(dispatch.instance, "vkEnumerateDeviceExtensionProperties"));
    return enumerate(physical, nullptr, count, properties);
}

EXPORTED VkResult VKAPI_CALL vkCreateInstance(const VkInstanceCreateInfo *info, const VkAllocationCallbacks *allocator,
                                              VkInstance *instance)
{
    if (!driver())
        return VK_ERROR_INCOMPATIBLE_DRIVER;
    std::vector<std::string> names = layersByVariable();
    for (uint32_t i = 0; i < info->enabledLayerCount; ++i)
        if (std::ranges::find(names, info->ppEnabledLayerNames[i]) == names.end())
            names.emplace_back(info->ppEnabledLayerNames[i]);
    std::vector<Layer> layers;
    for (const std::string &name : names)
        if (!load(name.c_str(), layers)) {
            std::fprintf(stderr, "loader: %s cannot be loaded\n", name.c_str());
            return VK_ERROR_LAYER_NOT_PRESENT;
        }
    layers.push_back({getDriversInstanceProcAddr, getDriversDeviceProcAddr, {}});
    std::deque<VkLayerInstanceLink> links;
    for (size_t i = layers.size() - 1; i > 0; --i)
        links.push_front({links.empty() ? nullptr : &links.front(), layers[i].getInstance, nullptr});
    VkLayerInstanceCreateInfo callback{
        VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO, info->pNext, VK_LOADER_DATA_CALLBACK, {}};
    callback.u.pfnSetInstanceLoaderData = setInstanceLoaderData;
    VkLayerInstanceCreateInfo link{VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO, &callback, VK_LAYER_LINK_INFO, {}};
    link.u.pLayerInfo = links.empty() ? nullptr : &links.front();
    VkInstanceCreateInfo changed = *info;
    changed.pNext = &link;
    const auto create =
        reinterpret_cast<PFN_vkCreateInstance>(layers[0].getInstance(VK_NULL_HANDLE, "vkCreateInstance"));
    const VkResult result = create(&changed, allocator, instance);
    if (result == VK_SUCCESS) {
        Dispatch &dispatch = dispatchOf(*instance);
        dispatch.layers = layers;
        fill(dispatch, layers[0].getInstance, *instance);
    }
    return result;
}

EXPORTED void VKAPI_CALL vkDestroyInstance(VkInstance instance, const VkAllocationCallbacks *allocator)
{
    if (!instance)
        return;
    const Dispatch &dispatch = dispatchOf(instance);
    reinterpret_cast<PFN_vkDestroyInstance>(dispatch.layers[0].getInstance(instance, "vkDestroyInstance"))(instance,
                                                                                                           allocator);
    forget(dispatch);
}

EXPORTED VkResult VKAPI_CALL vkCreateDevice(VkPhysicalDevice physical, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    const Dispatch &ofInstance = dispatchOf(physical);
    const std::vector<Layer> &layers = ofInstance.layers;
    std::vector<VkExtensionProperties> known = deviceExtensions(layers[0].getInstance, ofInstance.instance, physical);
    for (const Layer &layer : layers)
        known.insert(known.end(), layer.deviceExtensions.begin(), layer.deviceExtensions.end());
    for (uint32_t i = 0; i < info->enabledExtensionCount; ++i)
        if (namesIn(&info->ppEnabledExtensionNames[i], 1, known).empty())
            return VK_ERROR_EXTENSION_NOT_PRESENT;
    std::deque<VkLayerDeviceLink> links;
    for (size_t i = layers.size() - 1; i > 0; --i)
        links.push_front({links.empty() ? nullptr : &links.front(), layers[i].getInstance, layers[i].getDevice});
    VkLayerDeviceCreateInfo callback{
        VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO, info->pNext, VK_LOADER_DATA_CALLBACK, {}};
    callback.u.pfnSetDeviceLoaderData = setDeviceLoaderData;
    VkLayerDeviceCreateInfo link{VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO, &callback, VK_LAYER_LINK_INFO, {}};
    link.u.pLayerInfo = links.empty() ? nullptr : &links.front();
    VkDeviceCreateInfo changed = *info;
    changed.pNext = &link;
    const auto create =
        reinterpret_cast<PFN_vkCreateDevice>(layers[0].getInstance(ofInstance.instance, "vkCreateDevice"));
    const VkResult result = create(physical, &changed, allocator, device);
    if (result == VK_SUCCESS) {
        Dispatch &dispatch = dispatchOf(*device);
        dispatch.layers = layers;
        fill(dispatch, layers[0].getDevice, *device);
    }
    return result;
}

EXPORTED void VKAPI_CALL vkDestroyDevice(VkDevice device, const VkAllocationCallbacks *allocator)
{
    if (!device)
        return;
    const Dispatch &dispatch = dispatchOf(device);
    reinterpret_cast<PFN_vkDestroyDevice>(dispatch.layers[0].getDevice(device, "vkDestroyDevice"))(device, allocator);
    forget(dispatch);
}

EXPORTED void VKAPI_CALL vkGetDeviceQueue(VkDevice device, uint32_t family, uint32_t index, VkQueue *queue)
{
    const Dispatch &dispatch = dispatchOf(device);
    reinterpret_cast<PFN_vkGetDeviceQueue>(dispatch.layers[0].getDevice(device, "vkGetDeviceQueue"))(device, family,
                                                                                                     index, queue);
    if (*queue)
        setDispatch(*queue, dispatch);
}

EXPORTED void VKAPI_CALL vkGetDeviceQueue2(VkDevice device, const VkDeviceQueueInfo2 *info, VkQueue *queue)
{
    const Dispatch &dispatch = dispatchOf(device);
    reinterpret_cast<PFN_vkGetDeviceQueue2>(dispatch.layers[0].getDevice(device, "vkGetDeviceQueue2"))(device, info,
                                                                                                       queue);
    if (*queue)
        setDispatch(*queue, dispatch);
}

EXPORTED VkResult VKAPI_CALL vkAllocateCommandBuffers(VkDevice device, const VkCommandBufferAllocateInfo *info,
                                                      VkCommandBuffer *commandBuffers)
{
    const Dispatch &dispatch = dispatchOf(device);
    const auto allocate = reinterpret_cast<PFN_vkAllocateCommandBuffers>(
        dispatch.layers[0].getDevice(device, "vkAllocateCommandBuffers"));
    const VkResult result = allocate(device, info, commandBuffers);
    for (uint32_t i = 0; result == VK_SUCCESS && i < info->commandBufferCount; ++i)
        setDispatch(commandBuffers[i], dispatch);
    return result;
}

EXPORTED PFN_vkVoidFunction VKAPI_CALL vkGetInstanceProcAddr(VkInstance instance, const char *name);
EXPORTED PFN_vkVoidFunction VKAPI_CALL vkGetDeviceProcAddr(VkDevice device, const char *name);

namespace
{

PFN_vkVoidFunction ownCommand(const std::string_view name)
{
    static const std::map<std::string_view, PFN_vkVoidFunction> kOwn{
        {"vkGetInstanceProcAddr", VOID_FUNCTION(vkGetInstanceProcAddr)},
        {"vkGetDeviceProcAddr", VOID_FUNCTION(vkGetDeviceProcAddr)},
        {"vkCreateInstance", VOID_FUNCTION(vkCreateInstance)},
        {"vkDestroyInstance", VOID_FUNCTION(vkDestroyInstance)},
        {"vkEnumerateInstanceVersion", VOID_FUNCTION(vkEnumerateInstanceVersion)},
        {"vkEnumerateInstanceLayerProperties", VOID_FUNCTION(vkEnumerateInstanceLayerProperties)},
        {"vkEnumerateInstanceExtensionProperties", VOID_FUNCTION(vkEnumerateInstanceExtensionProperties)},
        {"vkEnumerateDeviceExtensionProperties", VOID_FUNCTION(vkEnumerateDeviceExtensionProperties)},
        {"vkCreateDevice", VOID_FUNCTION(vkCreateDevice)},
        {"vkDestroyDevice", VOID_FUNCTION(vkDestroyDevice)},
        {"vkGetDeviceQueue", VOID_FUNCTION(vkGetDeviceQueue)},
        {"vkGetDeviceQueue2", VOID_FUNCTION(vkGetDeviceQueue2)},
        {"vkAllocateCommandBuffers", VOID_FUNCTION(vkAllocateCommandBuffers)},
    };
    const auto found = kOwn.find(name);
    return found == kOwn.end() ? nullptr : found->second;
}

} // namespace

EXPORTED PFN_vkVoidFunction VKAPI_CALL vkGetInstanceProcAddr(VkInstance instance, const char *name)
{
    if (const PFN_vkVoidFunction own = ownCommand(name))
        return own;
    return instance ? dispatchOf(instance).layers[0].getInstance(instance, name) : nullptr;
}

EXPORTED PFN_vkVoidFunction VKAPI_CALL vkGetDeviceProcAddr(VkDevice device, const char *name)
{
    const PFN_vkVoidFunction found = dispatchOf(device).layers[0].getDevice(device, name);
    const PFN_vkVoidFunction own = ownCommand(name);
    return found && own ? own : found;
}
