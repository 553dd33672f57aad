#include "layer/entry/instance.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <memory>
#include <mutex>
#include <string>
#include <type_traits>
#include <vector>

#include <vulkan/vk_layer.h>

#include "core/curve.h"
#include "core/records.h"
#include "layer/base/pnext.h"
#include "layer/base/undo.h"
#include "layer/entry/device.h"
#include "layer/entry/hidden_extensions.h"
#include "layer/memory/buffers.h"
#include "layer/memory/fixed_memory.h"
#include "layer/pipelines/module_identifiers.h"
#include "layer/pipelines/shader_binary.h"

namespace vellum::layer
{
namespace
{

constinit Registry<Instance> instances;
static_assert(std::is_trivially_destructible_v<Registry<Instance>>);

constexpr const char *kDescription = "Opacity micromaps for every device that traces rays";

struct OwnExtension {
    const char *name;
    uint32_t version;
    Implementation Implementations::*implementation;
};
constexpr OwnExtension kOwnExtensions[] = {
    {VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME, VK_EXT_OPACITY_MICROMAP_SPEC_VERSION, &Implementations::ext},
    {VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME, VK_KHR_OPACITY_MICROMAP_SPEC_VERSION, &Implementations::khr},
    {VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME, VK_KHR_DEVICE_ADDRESS_COMMANDS_SPEC_VERSION,
     &Implementations::addressCommands},
    {newer::kPipelineOpacityMicromapExtension, 1, &Implementations::pipelines},
};

VkExtensionProperties propertiesOf(const OwnExtension &extension)
{
    VkExtensionProperties properties{};
    std::strcpy(properties.extensionName, extension.name);
    properties.specVersion = extension.version;
    return properties;
}

// The two-call idiom of Vulkan's enumerations.
template <typename T>
VkResult giveList(const std::vector<T> &list, uint32_t *count, T *out)
{
    if (!out) {
        *count = static_cast<uint32_t>(list.size());
        return VK_SUCCESS;
    }
    const size_t n = std::min<size_t>(*count, list.size());
    std::copy_n(list.begin(), n, out);
    *count = static_cast<uint32_t>(n);
    return n < list.size() ? VK_INCOMPLETE : VK_SUCCESS;
}

bool isProvided(Implementation implementation)
{
    return implementation == Implementation::Emulation || implementation == Implementation::Translation;
}

bool contains(const std::vector<VkExtensionProperties> &list, const char *name)
{
    return std::any_of(list.begin(), list.end(),
                       [name](const auto &e) { return std::strcmp(e.extensionName, name) == 0; });
}

bool isVulkan13(Instance &instance, VkPhysicalDevice device)
{
    VkPhysicalDeviceProperties properties{};
    instance.next.GetPhysicalDeviceProperties(device, &properties);
    return properties.apiVersion >= VK_API_VERSION_1_3;
}

// What the layer's way of having micromaps takes.
bool canEmulate(Instance &instance, VkPhysicalDevice device, const std::vector<VkExtensionProperties> &list)
{
    // VK_KHR_acceleration_structure depends on Vulkan 1.1, of which not all commands are there on an instance of 1.0.
    if (!contains(list, VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME) || !instance.isVulkan11 ||
        !instance.next.GetPhysicalDeviceFeatures2)
        return false;
    // VK_EXT_opacity_micromap depends on VK_KHR_synchronization2 or Vulkan 1.3.
    if (!contains(list, VK_KHR_SYNCHRONIZATION_2_EXTENSION_NAME) && !isVulkan13(instance, device))
        return false;
    VkPhysicalDeviceAccelerationStructureFeaturesKHR structures{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR};
    VkPhysicalDeviceBufferDeviceAddressFeatures addresses{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES, &structures};
    VkPhysicalDeviceFeatures2 features{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &addresses, {}};
    instance.next.GetPhysicalDeviceFeatures2(device, &features);
    return structures.accelerationStructure && addresses.bufferDeviceAddress;
}

// Of the driver's VK_EXT_opacity_micromap.
VkPhysicalDeviceOpacityMicromapFeaturesEXT driverFeatures(Instance &instance, VkPhysicalDevice device)
{
    VkPhysicalDeviceOpacityMicromapFeaturesEXT micromaps{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT};
    VkPhysicalDeviceFeatures2 features{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &micromaps, {}};
    instance.next.GetPhysicalDeviceFeatures2(device, &features);
    return micromaps;
}

// What tells the extensions that are hidden; null where none are.
const HiddenExtension *(*hiddenOn(const Implementations &have))(const char *)
{
    if (have.ext == Implementation::Emulation)
        return hiddenByEmulation;
    return have.khr == Implementation::Translation ? hiddenByTranslation : nullptr;
}

bool isVulkan11(const VkInstanceCreateInfo &info)
{
    return info.pApplicationInfo && info.pApplicationInfo->apiVersion >= VK_API_VERSION_1_1;
}

bool canImportHostMemory(Instance &instance, VkPhysicalDevice device)
{
    if (!instance.next.GetPhysicalDeviceExternalBufferProperties)
        return false;
    const VkPhysicalDeviceExternalBufferInfo info{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_BUFFER_INFO, nullptr, 0,
                                                  VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                                                      VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
                                                  VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_ALLOCATION_BIT_EXT};
    VkExternalBufferProperties buffers{VK_STRUCTURE_TYPE_EXTERNAL_BUFFER_PROPERTIES, nullptr, {}};
    instance.next.GetPhysicalDeviceExternalBufferProperties(device, &info, &buffers);
    const VkExternalMemoryFeatureFlags features = buffers.externalMemoryProperties.externalMemoryFeatures;
    return (features & VK_EXTERNAL_MEMORY_FEATURE_IMPORTABLE_BIT) != 0 &&
           (features & VK_EXTERNAL_MEMORY_FEATURE_DEDICATED_ONLY_BIT) == 0;
}

// Driver::keepsOldPushConstants. Only its text tells the version: driverVersion is always 0.0.1.
bool isLavapipeBefore26(const VkPhysicalDeviceDriverProperties &driver)
{
    unsigned major = 0;
    return driver.driverID == VK_DRIVER_ID_MESA_LLVMPIPE && std::sscanf(driver.driverInfo, "Mesa %u", &major) == 1 &&
           major < 26;
}

} // namespace

std::vector<VkExtensionProperties> driverExtensions(Instance &instance, VkPhysicalDevice device)
{
    std::vector<VkExtensionProperties> list;
    VkResult result = VK_INCOMPLETE;
    while (result == VK_INCOMPLETE) {
        uint32_t count = 0;
        if (instance.next.EnumerateDeviceExtensionProperties(device, nullptr, &count, nullptr) != VK_SUCCESS)
            return {};
        list.resize(count);
        result = instance.next.EnumerateDeviceExtensionProperties(device, nullptr, &count, list.data());
        list.resize(count);
    }
    return list;
}

Implementations implementationsOf(Instance &instance, VkPhysicalDevice device,
                                  const std::vector<VkExtensionProperties> &list)
{
    const Implementation otherwise =
        canEmulate(instance, device, list) ? Implementation::Emulation : Implementation::None;
    Implementations result;
    for (const OwnExtension &own : kOwnExtensions) {
        const bool passes = contains(list, own.name) && !instance.settings.forceEmulation;
        result.*own.implementation = passes ? Implementation::PassThrough : otherwise;
    }
    if (result.ext == Implementation::PassThrough && result.khr == Implementation::Emulation &&
        driverFeatures(instance, device).micromap) {
        result.khr = Implementation::Translation;
        // The driver's micromaps know nothing of it.
        if (result.pipelines == Implementation::Emulation)
            result.pipelines = Implementation::None;
    }
    return result;
}

DriverFacts driverFactsOf(Instance &instance, VkPhysicalDevice physicalDevice,
                          const std::vector<VkExtensionProperties> &extensions)
{
    VkPhysicalDeviceExternalMemoryHostPropertiesEXT host{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_MEMORY_HOST_PROPERTIES_EXT};
    const bool knowsHost = contains(extensions, VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME);
    VkPhysicalDeviceDriverProperties driver{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES,
                                            knowsHost ? &host : nullptr};
    VkPhysicalDeviceIDProperties id{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ID_PROPERTIES, &driver};
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &id, {}};
    instance.next.GetPhysicalDeviceProperties2(physicalDevice, &properties);
    DriverFacts facts;
    facts.isCpu = properties.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
    facts.isLavapipeBefore26 = isLavapipeBefore26(driver);
    facts.maxPushConstantsSize = properties.properties.limits.maxPushConstantsSize;
    std::memcpy(facts.driverUuid.data(), id.driverUUID, VK_UUID_SIZE);
    facts.importsHostMemory = knowsHost && facts.isCpu &&
                              host.minImportedHostPointerAlignment <= FixedMemory::kAlignment &&
                              canImportHostMemory(instance, physicalDevice);
    return facts;
}

MicromapLimits driverLimits(Instance &instance, VkPhysicalDevice device)
{
    VkPhysicalDeviceOpacityMicromapPropertiesEXT micromaps{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_EXT};
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &micromaps, {}};
    instance.next.GetPhysicalDeviceProperties2(device, &properties);
    // What is built is never lossy.
    return {micromaps.maxOpacity2StateSubdivisionLevel, micromaps.maxOpacity4StateSubdivisionLevel,
            micromaps.maxOpacity4StateSubdivisionLevel};
}

bool replaysAddresses(Instance &instance, VkPhysicalDevice device)
{
    VkPhysicalDeviceBufferDeviceAddressFeatures addresses{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES};
    VkPhysicalDeviceFeatures2 features{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &addresses, {}};
    instance.next.GetPhysicalDeviceFeatures2(device, &features);
    return addresses.bufferDeviceAddressCaptureReplay;
}

Instance *instanceOfKey(void *key)
{
    return instances.find(key);
}

Implementation Implementations::of(const char *extension) const
{
    for (const OwnExtension &own : kOwnExtensions) {
        if (std::strcmp(own.name, extension) == 0)
            return this->*own.implementation;
    }
    return Implementation::None;
}

bool Implementations::anyEmulated() const
{
    return std::any_of(std::begin(kOwnExtensions), std::end(kOwnExtensions), [this](const OwnExtension &own) {
        return this->*own.implementation == Implementation::Emulation;
    });
}

Implementations implementationsOn(Instance &instance, VkPhysicalDevice device)
{
    return implementationsOf(instance, device, driverExtensions(instance, device));
}

VKAPI_ATTR VkResult VKAPI_CALL createInstance(const VkInstanceCreateInfo *info, const VkAllocationCallbacks *allocator,
                                              VkInstance *handle)
{
    auto *link = const_cast<VkLayerInstanceCreateInfo *>(static_cast<const VkLayerInstanceCreateInfo *>(info->pNext));
    while (link &&
           !(link->sType == VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO && link->function == VK_LAYER_LINK_INFO))
        link = const_cast<VkLayerInstanceCreateInfo *>(static_cast<const VkLayerInstanceCreateInfo *>(link->pNext));
    if (!link || !link->u.pLayerInfo)
        return VK_ERROR_INITIALIZATION_FAILED;
    const PFN_vkGetInstanceProcAddr nextGet = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    // The loader's protocol: each layer moves the link on for the next one.
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const auto nextCreate = reinterpret_cast<PFN_vkCreateInstance>(nextGet(VK_NULL_HANDLE, "vkCreateInstance"));
    if (!nextCreate)
        return VK_ERROR_INITIALIZATION_FAILED;

    auto instance = std::make_unique<Instance>();
    instance->settings = readSettings(info->pNext);
    instance->report.apply(instance->settings);
    const VkResult result = nextCreate(info, allocator, handle);
    if (result != VK_SUCCESS)
        return result;
    instance->handle = *handle;
    instance->isVulkan11 = isVulkan11(*info);
    instance->next.load(*handle, nextGet, instance->isVulkan11);
    instances.add(*instance.release(), dispatchKey(*handle));
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL destroyInstance(VkInstance handle, const VkAllocationCallbacks *allocator)
{
    if (!handle)
        return;
    std::unique_ptr<Instance> instance(instances.take(dispatchKey(handle)));
    if (!instance)
        return;
    const PFN_vkDestroyInstance destroy = instance->next.DestroyInstance;
    if (forgetDevices(*instance))
        static_cast<void>(instance.release()); // they use it
    destroy(handle, allocator);
}

VKAPI_ATTR VkResult VKAPI_CALL enumerateInstanceLayerProperties(uint32_t *count, VkLayerProperties *properties)
{
    VkLayerProperties own{};
    std::strcpy(own.layerName, kLayerName);
    std::strcpy(own.description, kDescription);
    own.specVersion = VK_MAKE_API_VERSION(0, 1, 4, 359); // as in the manifest
    own.implementationVersion = 1;
    return giveList<VkLayerProperties>({own}, count, properties);
}

VKAPI_ATTR VkResult VKAPI_CALL enumerateInstanceExtensionProperties(const char *layer, uint32_t *count,
                                                                    VkExtensionProperties *properties)
{
    if (!layer || std::strcmp(layer, kLayerName) != 0)
        return VK_ERROR_LAYER_NOT_PRESENT;
    VkExtensionProperties settings{};
    std::strcpy(settings.extensionName, newer::kLayerSettingsExtension);
    settings.specVersion = 2;
    return giveList<VkExtensionProperties>({settings}, count, properties);
}

VKAPI_ATTR VkResult VKAPI_CALL enumerateDeviceExtensionProperties(VkPhysicalDevice device, const char *layer,
                                                                  uint32_t *count, VkExtensionProperties *properties)
{
    if (layer && std::strcmp(layer, kLayerName) == 0) {
        std::vector<VkExtensionProperties> own;
        for (const OwnExtension &extension : kOwnExtensions)
            own.push_back(propertiesOf(extension));
        return giveList(own, count, properties);
    }
    Instance &instance = instanceOf(device);
    if (layer)
        return instance.next.EnumerateDeviceExtensionProperties(device, layer, count, properties);
    std::vector<VkExtensionProperties> list = driverExtensions(instance, device);
    const Implementations implementations = implementationsOf(instance, device, list);
    for (const OwnExtension &own : kOwnExtensions) {
        if (isProvided(implementations.*own.implementation) && !contains(list, own.name))
            list.push_back(propertiesOf(own));
    }
    if (const auto hidden = hiddenOn(implementations))
        std::erase_if(list, [hidden](const auto &e) { return hidden(e.extensionName) != nullptr; });
    return giveList(list, count, properties);
}

VKAPI_ATTR void VKAPI_CALL getPhysicalDeviceFeatures2(VkPhysicalDevice device, VkPhysicalDeviceFeatures2 *features)
{
    Instance &instance = instanceOf(device);
    const Implementations have = implementationsOn(instance, device);
    const auto take = [features](Implementation implementation, VkStructureType type) {
        return Unlinked(isProvided(implementation) ? features : nullptr, type);
    };
    const Unlinked ext = take(have.ext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT);
    const Unlinked khr = take(have.khr, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_KHR);
    const Unlinked addresses =
        take(have.addressCommands, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR);
    const Unlinked pipelines = take(have.pipelines, newer::kPipelineOpacityMicromapFeatures);
    instance.next.GetPhysicalDeviceFeatures2(device, features);
    if (auto *own = ext.get<VkPhysicalDeviceOpacityMicromapFeaturesEXT>()) {
        own->micromap = VK_TRUE;
        own->micromapCaptureReplay = replaysAddresses(instance, device);
        own->micromapHostCommands = VK_TRUE;
    }
    if (auto *own = khr.get<VkPhysicalDeviceOpacityMicromapFeaturesKHR>())
        own->micromap = VK_TRUE; // so has the driver, where it is translated
    if (auto *own = addresses.get<VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR>())
        own->deviceAddressCommands = VK_TRUE;
    if (auto *own = pipelines.get<newer::PipelineOpacityMicromapFeatures>())
        own->pipelineOpacityMicromap = VK_TRUE;
    // Emulation needs the GPU for builds and copies of acceleration structures: their host commands are always
    // rejected.
    auto *structures = const_cast<VkPhysicalDeviceAccelerationStructureFeaturesKHR *>(
        findInChain<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
            features->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR));
    if (structures && have.ext == Implementation::Emulation)
        structures->accelerationStructureHostCommands = VK_FALSE;
    if (const auto hidden = hiddenOn(have))
        clearHiddenFeatures(*features, hidden);
}

VKAPI_ATTR void VKAPI_CALL getPhysicalDeviceProperties2(VkPhysicalDevice device,
                                                        VkPhysicalDeviceProperties2 *properties)
{
    Instance &instance = instanceOf(device);
    const Implementations have = implementationsOn(instance, device);
    const auto take = [properties](Implementation implementation, VkStructureType type) {
        return Unlinked(isProvided(implementation) ? properties : nullptr, type);
    };
    const Unlinked ext = take(have.ext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_EXT);
    const Unlinked khr = take(have.khr, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_KHR);
    const Unlinked displacement = take(have.ext, newer::kDisplacementMicromapProperties);
    instance.next.GetPhysicalDeviceProperties2(device, properties);
    // Shader binaries of other versions of the layer are refused, and where tables do not lie at the same addresses in
    // the next run, those of other processes, too (shader_binary.h). The UUID that tells whether they fit is another.
    auto *shaderObjects = const_cast<newer::ShaderObjectProperties *>(
        findInChain<newer::ShaderObjectProperties>(properties->pNext, newer::kShaderObjectProperties));
    if (shaderObjects && have.mixesIdentifiers()) {
        const bool stable = driverFactsOf(instance, device, driverExtensions(instance, device)).importsHostMemory ||
                            replaysAddresses(instance, device);
        for (size_t i = 0; i < VK_UUID_SIZE; ++i)
            shaderObjects->shaderBinaryUUID[i] ^= stable ? rewriterUuid()[i] : processUuid()[i];
    }
    auto *identifiers = const_cast<VkPhysicalDeviceShaderModuleIdentifierPropertiesEXT *>(
        findInChain<VkPhysicalDeviceShaderModuleIdentifierPropertiesEXT>(
            properties->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_MODULE_IDENTIFIER_PROPERTIES_EXT));
    for (size_t i = 0; identifiers && have.mixesIdentifiers() && i < VK_UUID_SIZE; ++i)
        identifiers->shaderModuleIdentifierAlgorithmUUID[i] ^= kIdentifierUuid[i];
    if (auto *own = ext.get<VkPhysicalDeviceOpacityMicromapPropertiesEXT>()) {
        own->maxOpacity2StateSubdivisionLevel = shared::kMaxSubdivisionLevel;
        own->maxOpacity4StateSubdivisionLevel = shared::kMaxSubdivisionLevel;
    }
    if (auto *own = khr.get<VkPhysicalDeviceOpacityMicromapPropertiesKHR>()) {
        own->maxOpacity2StateSubdivisionLevel = shared::kMaxSubdivisionLevel;
        own->maxOpacity4StateSubdivisionLevel = shared::kMaxSubdivisionLevel;
        own->maxOpacityLossy4StateSubdivisionLevel = shared::kMaxSubdivisionLevel;
        own->maxMicromapTriangles = shared::kMaxMicromapTriangles;
        if (have.khr == Implementation::Translation) {
            const MicromapLimits limits = driverLimits(instance, device);
            own->maxOpacity2StateSubdivisionLevel = limits.twoStateLevel;
            own->maxOpacity4StateSubdivisionLevel = limits.fourStateLevel;
            own->maxOpacityLossy4StateSubdivisionLevel = limits.lossyLevel;
        }
    }
    if (auto *none = displacement.get<newer::DisplacementMicromapProperties>())
        none->maxDisplacementMicromapSubdivisionLevel = 0;
}

VKAPI_ATTR void VKAPI_CALL getPhysicalDeviceExternalBufferProperties(VkPhysicalDevice physicalDevice,
                                                                     const VkPhysicalDeviceExternalBufferInfo *info,
                                                                     VkExternalBufferProperties *properties)
{
    Instance &instance = instanceOf(physicalDevice);
    VkPhysicalDeviceExternalBufferInfo driverInfo = *info;
    Chain chain(info->pNext);
    const Implementations have = implementationsOn(instance, physicalDevice);
    if (have.khr == Implementation::Translation)
        editUsage(instance.report, chain, driverInfo.usage, info->flags, translatedUsage);
    else if (have.anyEmulated())
        editUsage(instance.report, chain, driverInfo.usage, info->flags, emulatedUsage);
    driverInfo.pNext = chain.head();
    instance.next.GetPhysicalDeviceExternalBufferProperties(physicalDevice, &driverInfo, properties);
}

VKAPI_ATTR VkResult VKAPI_CALL getPhysicalDeviceToolProperties(VkPhysicalDevice device, uint32_t *count,
                                                               VkPhysicalDeviceToolProperties *properties)
{
    Instance &instance = instanceOf(device);
    std::vector<VkPhysicalDeviceToolProperties> tools;
    if (instance.next.GetPhysicalDeviceToolProperties) {
        uint32_t below = 0;
        instance.next.GetPhysicalDeviceToolProperties(device, &below, nullptr);
        tools.resize(below, {VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_TOOL_PROPERTIES});
        instance.next.GetPhysicalDeviceToolProperties(device, &below, tools.data());
        tools.resize(below);
    }
    VkPhysicalDeviceToolProperties own{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_TOOL_PROPERTIES};
    const Implementations have = implementationsOn(instance, device);
    std::strcpy(own.name, "Vellum opacity micromap layer");
    std::strcpy(own.version, VELLUM_VERSION);
    own.purposes = VK_TOOL_PURPOSE_ADDITIONAL_FEATURES_BIT;
    std::strcpy(own.description, have.ext == Implementation::None          ? "not available on this device"
                                 : have.khr == Implementation::Translation ? "translated"
                                 : have.anyEmulated()                      ? "emulated"
                                                                           : "passthrough");
    std::strcpy(own.layer, kLayerName);
    tools.push_back(own);
    // pNext of the application's elements stays as it is.
    std::vector<void *> chains;
    for (uint32_t i = 0; properties && i < *count; ++i)
        chains.push_back(properties[i].pNext);
    const VkResult result = giveList(tools, count, properties);
    for (uint32_t i = 0; properties && i < *count; ++i)
        properties[i].pNext = chains[i];
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createDebugUtilsMessenger(VkInstance handle,
                                                         const VkDebugUtilsMessengerCreateInfoEXT *info,
                                                         const VkAllocationCallbacks *allocator,
                                                         VkDebugUtilsMessengerEXT *messenger)
{
    Instance &instance = instanceOf(handle);
    const VkResult result = instance.next.CreateDebugUtilsMessengerEXT(handle, info, allocator, messenger);
    if (result != VK_SUCCESS)
        return result;
    Undo undo([&] { instance.next.DestroyDebugUtilsMessengerEXT(handle, *messenger, allocator); });
    instance.report.addMessenger(*messenger, *info);
    undo.keep();
    return result;
}

VKAPI_ATTR void VKAPI_CALL destroyDebugUtilsMessenger(VkInstance handle, VkDebugUtilsMessengerEXT messenger,
                                                      const VkAllocationCallbacks *allocator)
{
    Instance &instance = instanceOf(handle);
    instance.report.removeMessenger(messenger);
    instance.next.DestroyDebugUtilsMessengerEXT(handle, messenger, allocator);
}

} // namespace vellum::layer
