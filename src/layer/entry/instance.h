// Per-instance state: what the layer knows of the instance and its physical devices.
#pragma once

#include <array>
#include <map>
#include <mutex>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/driver.h"
#include "layer/base/report.h"
#include "layer/base/settings.h"
#include "layer/entry/registry.h"
#include "layer/micromaps/micromap_input.h"

namespace vellum::layer
{

// The first word of a dispatchable handle points to the loader's table and is the same for an instance and its physical
// devices, and for a device, its queues and its command buffers.
template <typename DispatchableHandle>
void *dispatchKey(DispatchableHandle handle)
{
    return *reinterpret_cast<void **>(handle);
}

struct Instance : Registered<Instance> {
    VkInstance handle = VK_NULL_HANDLE;
    InstanceTable next;
    bool isVulkan11 = false; // or later, by the application's version
    Settings settings;
    Reporter report;
};

// The state of the instance that a VkInstance or VkPhysicalDevice belongs to.
Instance *instanceOfKey(void *key);
template <typename DispatchableHandle>
Instance &instanceOf(DispatchableHandle handle)
{
    return *instanceOfKey(dispatchKey(handle));
}

enum class Implementation {
    None,        // the device cannot have it
    PassThrough, // the driver has it
    Emulation,   // the layer provides it
    Translation, // the layer provides it by another extension of the driver's: KHR by EXT
};
// What each extension is on a device.
struct Implementations {
    Implementation ext = Implementation::None;             // VK_EXT_opacity_micromap
    Implementation khr = Implementation::None;             // VK_KHR_opacity_micromap
    Implementation addressCommands = Implementation::None; // VK_KHR_device_address_commands
    Implementation pipelines = Implementation::None;       // VK_ARM_pipeline_opacity_micromap

    // Of an extension by its name; None for any other.
    [[nodiscard]] Implementation of(const char *extension) const;
    [[nodiscard]] bool anyEmulated() const;
    // Whether identifiers of shader modules are the layer's on all devices of the physical one: they have one
    // algorithm.
    [[nodiscard]] bool mixesIdentifiers() const { return anyEmulated() && khr != Implementation::Translation; }
};
Implementations implementationsOn(Instance &instance, VkPhysicalDevice physicalDevice);
// The same, of a device whose extensions are known.
std::vector<VkExtensionProperties> driverExtensions(Instance &instance, VkPhysicalDevice physicalDevice);
Implementations implementationsOf(Instance &instance, VkPhysicalDevice physicalDevice,
                                  const std::vector<VkExtensionProperties> &extensions);

// What the layer asks once of a physical device that it emulates on.
struct DriverFacts {
    bool isCpu = false;
    bool isLavapipeBefore26 = false;
    uint32_t maxPushConstantsSize = 0;
    std::array<uint8_t, VK_UUID_SIZE> driverUuid{};
    // Whether buffers can be made on memory of the host's (VK_EXT_external_memory_host) whose device addresses may well
    // be the host's: on a CPU.
    bool importsHostMemory = false;
};
DriverFacts driverFactsOf(Instance &instance, VkPhysicalDevice physicalDevice,
                          const std::vector<VkExtensionProperties> &extensions);

// Of the driver's VK_EXT_opacity_micromap.
MicromapLimits driverLimits(Instance &instance, VkPhysicalDevice physicalDevice);

// Whether the driver gives buffers the addresses that they had before: then micromaps have theirs.
bool replaysAddresses(Instance &instance, VkPhysicalDevice physicalDevice);

VKAPI_ATTR VkResult VKAPI_CALL createInstance(const VkInstanceCreateInfo *info, const VkAllocationCallbacks *allocator,
                                              VkInstance *instance);
VKAPI_ATTR void VKAPI_CALL destroyInstance(VkInstance instance, const VkAllocationCallbacks *allocator);
VKAPI_ATTR VkResult VKAPI_CALL enumerateInstanceLayerProperties(uint32_t *count, VkLayerProperties *properties);
VKAPI_ATTR VkResult VKAPI_CALL enumerateInstanceExtensionProperties(const char *layer, uint32_t *count,
                                                                    VkExtensionProperties *properties);
VKAPI_ATTR VkResult VKAPI_CALL enumerateDeviceExtensionProperties(VkPhysicalDevice device, const char *layer,
                                                                  uint32_t *count, VkExtensionProperties *properties);
VKAPI_ATTR void VKAPI_CALL getPhysicalDeviceFeatures2(VkPhysicalDevice device, VkPhysicalDeviceFeatures2 *features);
VKAPI_ATTR void VKAPI_CALL getPhysicalDeviceProperties2(VkPhysicalDevice device,
                                                        VkPhysicalDeviceProperties2 *properties);
VKAPI_ATTR void VKAPI_CALL getPhysicalDeviceExternalBufferProperties(VkPhysicalDevice device,
                                                                     const VkPhysicalDeviceExternalBufferInfo *info,
                                                                     VkExternalBufferProperties *properties);
VKAPI_ATTR VkResult VKAPI_CALL getPhysicalDeviceToolProperties(VkPhysicalDevice device, uint32_t *count,
                                                               VkPhysicalDeviceToolProperties *properties);
VKAPI_ATTR VkResult VKAPI_CALL createDebugUtilsMessenger(VkInstance instance,
                                                         const VkDebugUtilsMessengerCreateInfoEXT *info,
                                                         const VkAllocationCallbacks *allocator,
                                                         VkDebugUtilsMessengerEXT *messenger);
VKAPI_ATTR void VKAPI_CALL destroyDebugUtilsMessenger(VkInstance instance, VkDebugUtilsMessengerEXT messenger,
                                                      const VkAllocationCallbacks *allocator);

} // namespace vellum::layer
