// SPDX-License-Identifier: Apache-2.0
#include "layer/entry/instance.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <type_traits>
#include <vector>

#include <vulkan/vk_layer.h>

#include "core/curve.h"
#include "core/records.h"
#include "layer/base/commands.h"
#include "layer/base/pnext.h"
#include "layer/base/setting_names.h"
#include "layer/base/system.h"
#include "layer/base/undo.h"
#include "layer/entry/device.h"
#include "layer/entry/ray_tracing_extensions.h"
#include "layer/memory/device_buffers.h"
#include "layer/micromaps/micromap_input.h"
#include "layer/pipelines/binaries.h"
#include "layer/pipelines/module_identifiers.h"

namespace vellum::layer
{
namespace
{

PermanentRegistry<Instance> instances;
static_assert(std::is_trivially_destructible_v<PermanentRegistry<Instance>>);

constexpr const char *kDescription = "Opacity micromaps for every device that traces rays";

VkExtensionProperties propertiesOf(const ProvidedExtension &extension)
{
    VkExtensionProperties properties{};
    std::strcpy(properties.extensionName, extension.name);
    properties.specVersion = extension.version;
    return properties;
}

// Returns a list by the two-call idiom of Vulkan's enumerations.
template <typename T>
VkResult returnList(const std::vector<T> &list, uint32_t *count, T *out)
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

template <typename T>
T *findStructure(void *chain, VkStructureType type)
{
    return const_cast<T *>(findInChain<T>(chain, type));
}

// Changes the UUIDs by which an application recognizes shader binaries and shader module identifiers. The layer rejects
// binaries of another version of itself, and unless tables have the same addresses in every run, those of another
// process (binaries.h).
void mixUuids(const PhysicalDevice &physical, VkPhysicalDeviceProperties2 &properties)
{
    const auto mix = [](uint8_t *target, const auto &uuid) {
        for (size_t i = 0; i < VK_UUID_SIZE; ++i)
            target[i] ^= uuid[i];
    };
    const bool stable = physical.importsHostMemory || physical.replaysAddresses;
    if (auto *binaries = findStructure<VkPhysicalDeviceShaderObjectPropertiesEXT>(
            properties.pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_OBJECT_PROPERTIES_EXT))
        mix(binaries->shaderBinaryUUID, stable ? rewriterUuid() : processUuid());
    if (auto *identifiers = findStructure<VkPhysicalDeviceShaderModuleIdentifierPropertiesEXT>(
            properties.pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_MODULE_IDENTIFIER_PROPERTIES_EXT))
        mix(identifiers->shaderModuleIdentifierAlgorithmUUID, kIdentifierUuid);
}

bool isVulkan11(const VkInstanceCreateInfo &info)
{
    return info.pApplicationInfo && info.pApplicationInfo->apiVersion >= VK_API_VERSION_1_1;
}

} // namespace

Instance *instanceOfKey(void *key)
{
    return instances->find(key);
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

    stayLoaded();
    auto instance = std::make_unique<Instance>();
    instance->settings = readSettings(info->pNext);
    instance->report.apply(instance->settings, info->pNext);
    const std::string created =
        "an instance with the layer was created; validation: " + namesOf(instance->settings.validate);
    const VkResult result = nextCreate(info, allocator, handle);
    if (result != VK_SUCCESS)
        return result;
    instance->handle = *handle;
    instance->isVulkan11 = isVulkan11(*info);
    instance->next.load(*handle, nextGet, instance->isVulkan11);
    instance->report.info("VELLUM-instance", created);
    instances->add(*instance.release(), dispatchKey(*handle));
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL destroyInstance(VkInstance handle, const VkAllocationCallbacks *allocator)
{
    if (!handle)
        return;
    std::unique_ptr<Instance> instance(instances->take(dispatchKey(handle)));
    if (!instance)
        return;
    const PFN_vkDestroyInstance destroy = instance->next.DestroyInstance;
    if (forgetDevices(*instance))
        static_cast<void>(instance.release()); // the devices use it
    destroy(handle, allocator);
}

VKAPI_ATTR VkResult VKAPI_CALL enumerateInstanceLayerProperties(uint32_t *count, VkLayerProperties *properties)
{
    VkLayerProperties own{};
    std::strcpy(own.layerName, kLayerName);
    std::strcpy(own.description, kDescription);
    own.specVersion = VK_MAKE_API_VERSION(0, 1, 4, 359); // same as in the manifest
    own.implementationVersion = 1;
    return returnList<VkLayerProperties>({own}, count, properties);
}

VKAPI_ATTR VkResult VKAPI_CALL enumerateInstanceExtensionProperties(const char *layer, uint32_t *count,
                                                                    VkExtensionProperties *properties)
{
    if (!layer || std::strcmp(layer, kLayerName) != 0)
        return VK_ERROR_LAYER_NOT_PRESENT;
    VkExtensionProperties settings{};
    std::strcpy(settings.extensionName, VK_EXT_LAYER_SETTINGS_EXTENSION_NAME);
    settings.specVersion = 2;
    return returnList<VkExtensionProperties>({settings}, count, properties);
}

VKAPI_ATTR VkResult VKAPI_CALL enumerateDeviceExtensionProperties(VkPhysicalDevice device, const char *layer,
                                                                  uint32_t *count, VkExtensionProperties *properties)
{
    if (layer && std::strcmp(layer, kLayerName) == 0) {
        std::vector<VkExtensionProperties> own;
        for (const ProvidedExtension &extension : kProvidedExtensions)
            own.push_back(propertiesOf(extension));
        return returnList(own, count, properties);
    }
    Instance &instance = instanceOf(device);
    if (layer)
        return instance.next.EnumerateDeviceExtensionProperties(device, layer, count, properties);
    const auto physical = describe(instance, device);
    if (physical->listed != VK_SUCCESS)
        return physical->listed;
    std::vector<VkExtensionProperties> list = physical->extensions;
    for (const ProvidedExtension &own : kProvidedExtensions) {
        const auto isListed = [&own](const auto &e) { return std::strcmp(e.extensionName, own.name) == 0; };
        if (isProvided(physical->have.*own.implementation) && std::ranges::none_of(list, isListed))
            list.push_back(propertiesOf(own));
    }
    std::erase_if(list, [&](const auto &e) { return impossibleExtension(e.extensionName, physical->have) != nullptr; });
    return returnList(list, count, properties);
}

VKAPI_ATTR void VKAPI_CALL getPhysicalDeviceFeatures2(VkPhysicalDevice device, VkPhysicalDeviceFeatures2 *features)
{
    Instance &instance = instanceOf(device);
    const auto physical = describe(instance, device);
    const Implementations &have = physical->have;
    const auto take = [features](Implementation implementation, VkStructureType type) {
        return Unlinked(isProvided(implementation) ? features : nullptr, type);
    };
    const Unlinked ext = take(have.ext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT);
    const Unlinked khr = take(have.khr, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_KHR);
    const Unlinked addresses =
        take(have.addressCommands, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR);
    const Unlinked pipelines =
        take(have.pipelines, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_OPACITY_MICROMAP_FEATURES_ARM);
    instance.next.GetPhysicalDeviceFeatures2(device, features);
    if (auto *own = ext.get<VkPhysicalDeviceOpacityMicromapFeaturesEXT>()) {
        own->micromap = VK_TRUE;
        own->micromapCaptureReplay = physical->replaysAddresses;
        own->micromapHostCommands = VK_TRUE;
    }
    if (auto *own = khr.get<VkPhysicalDeviceOpacityMicromapFeaturesKHR>())
        own->micromap = VK_TRUE; // translated, the driver has VK_EXT_opacity_micromap's feature
    if (auto *own = addresses.get<VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR>())
        own->deviceAddressCommands = VK_TRUE;
    if (auto *own = pipelines.get<VkPhysicalDevicePipelineOpacityMicromapFeaturesARM>())
        own->pipelineOpacityMicromap = VK_TRUE;
    const auto isNamed = [](const Unlinked &structure) { return structure.get<void>() != nullptr; };
    const EnabledFeatures named{.ext = isNamed(ext),
                                .khr = isNamed(khr),
                                .addressCommands = isNamed(addresses),
                                .pipelineMicromaps = isNamed(pipelines)};
    // Emulation needs the GPU for builds and copies of acceleration structures: their host commands are always
    // rejected.
    auto *structures = findStructure<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
        features->pNext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR);
    const bool emulates = have.ext == Implementation::Emulation || named.any();
    if (structures && emulates && have.khr != Implementation::Translation)
        structures->accelerationStructureHostCommands = VK_FALSE;
    clearConflictingFeatures(*features, have, named);
}

// Lowers limits to those that settings simulate: the layer's in `own`, or the driver's in the chain of `properties`.
template <class Properties>
void simulateLimits(const Settings &settings, const Unlinked &own, VkPhysicalDeviceProperties2 &properties,
                    VkStructureType type)
{
    auto *limits = own.get<Properties>();
    if (!limits)
        limits = findStructure<Properties>(properties.pNext, type);
    if (!limits)
        return;
    const auto lower = [](uint32_t &limit, uint32_t setting) { limit = simulatedLimit(limit, setting); };
    lower(limits->maxOpacity2StateSubdivisionLevel, settings.most2StateLevel);
    lower(limits->maxOpacity4StateSubdivisionLevel, settings.most4StateLevel);
    if constexpr (std::is_same_v<Properties, VkPhysicalDeviceOpacityMicromapPropertiesKHR>)
        lower(limits->maxOpacityLossy4StateSubdivisionLevel, settings.mostLossyLevel);
}

VKAPI_ATTR void VKAPI_CALL getPhysicalDeviceProperties2(VkPhysicalDevice device,
                                                        VkPhysicalDeviceProperties2 *properties)
{
    Instance &instance = instanceOf(device);
    const auto physical = describe(instance, device);
    const Implementations &have = physical->have;
    const auto take = [properties](Implementation implementation, VkStructureType type) {
        return Unlinked(isProvided(implementation) ? properties : nullptr, type);
    };
    const Unlinked ext = take(have.ext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_EXT);
    const Unlinked khr = take(have.khr, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_KHR);
    const Unlinked displacement = take(have.ext, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DISPLACEMENT_MICROMAP_PROPERTIES_NV);
    instance.next.GetPhysicalDeviceProperties2(device, properties);
    if (have.mixesIdentifiers())
        mixUuids(*physical, *properties);
    if (auto *own = ext.get<VkPhysicalDeviceOpacityMicromapPropertiesEXT>()) {
        own->maxOpacity2StateSubdivisionLevel = kEmulatedSupport.limits.twoStateLevel;
        own->maxOpacity4StateSubdivisionLevel = kEmulatedSupport.limits.fourStateLevel;
    }
    if (auto *own = khr.get<VkPhysicalDeviceOpacityMicromapPropertiesKHR>()) {
        const bool translated = have.khr == Implementation::Translation;
        const MicromapLimits limits = translated ? physical->extLimits : kEmulatedSupport.limits;
        own->maxOpacity2StateSubdivisionLevel = limits.twoStateLevel;
        own->maxOpacity4StateSubdivisionLevel = limits.fourStateLevel;
        own->maxOpacityLossy4StateSubdivisionLevel = limits.lossyLevel;
        own->maxMicromapTriangles = limits.mostTriangles;
    }
    simulateLimits<VkPhysicalDeviceOpacityMicromapPropertiesEXT>(
        instance.settings, ext, *properties, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_EXT);
    simulateLimits<VkPhysicalDeviceOpacityMicromapPropertiesKHR>(
        instance.settings, khr, *properties, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_KHR);
    if (auto *none = displacement.get<VkPhysicalDeviceDisplacementMicromapPropertiesNV>())
        none->maxDisplacementMicromapSubdivisionLevel = 0;
}

VKAPI_ATTR void VKAPI_CALL getPhysicalDeviceExternalBufferProperties(VkPhysicalDevice physicalDevice,
                                                                     const VkPhysicalDeviceExternalBufferInfo *info,
                                                                     VkExternalBufferProperties *properties)
{
    Instance &instance = instanceOf(physicalDevice);
    VkPhysicalDeviceExternalBufferInfo driverInfo = *info;
    Chain chain(info->pNext);
    const auto physical = describe(instance, physicalDevice);
    const Implementations &have = physical->have;
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
    const auto physical = describe(instance, device);
    const Implementations &have = physical->have;
    std::strcpy(own.name, "Vellum opacity micromap layer");
    std::strcpy(own.version, VELLUM_VERSION);
    own.purposes = VK_TOOL_PURPOSE_ADDITIONAL_FEATURES_BIT;
    std::strcpy(own.description, have.ext == Implementation::None          ? "not available on this device"
                                 : have.khr == Implementation::Translation ? "translated"
                                 : have.anyEmulated()                      ? "emulated"
                                                                           : "passthrough");
    std::strcpy(own.layer, kLayerName);
    tools.push_back(own);
    // The elements keep the pNext pointers of the application.
    std::vector<void *> chains;
    for (uint32_t i = 0; properties && i < *count; ++i)
        chains.push_back(properties[i].pNext);
    const VkResult result = returnList(tools, count, properties);
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

// Messages that the application sends, by VK_EXT_debug_utils and VK_EXT_debug_report. They may name objects of the
// layer, which the driver does not know.
VKAPI_ATTR void VKAPI_CALL submitDebugUtilsMessage(VkInstance handle, VkDebugUtilsMessageSeverityFlagBitsEXT severity,
                                                   VkDebugUtilsMessageTypeFlagsEXT types,
                                                   const VkDebugUtilsMessengerCallbackDataEXT *data)
{
    Instance &instance = instanceOf(handle);
    // Layers below may look objects up by their types. The application's messengers, which are below, still get them.
    std::vector<VkDebugUtilsObjectNameInfoEXT> objects(data->pObjects, data->pObjects + data->objectCount);
    for (VkDebugUtilsObjectNameInfoEXT &object : objects) {
        if (isLayerObject(instance, object.objectType, object.objectHandle))
            object.objectType = VK_OBJECT_TYPE_UNKNOWN;
    }
    VkDebugUtilsMessengerCallbackDataEXT own = *data;
    own.pObjects = objects.data();
    instance.next.SubmitDebugUtilsMessageEXT(handle, severity, types, &own);
}

VKAPI_ATTR void VKAPI_CALL debugReportMessage(VkInstance handle, VkDebugReportFlagsEXT flags,
                                              VkDebugReportObjectTypeEXT type, uint64_t object, size_t location,
                                              int32_t code, const char *prefix, const char *message)
{
    Instance &instance = instanceOf(handle);
    // VkDebugReportObjectTypeEXT has no value for VkMicromapEXT. For acceleration structures it has the number of
    // VkObjectType.
    if (isLayerObject(instance, static_cast<VkObjectType>(type), object))
        type = VK_DEBUG_REPORT_OBJECT_TYPE_UNKNOWN_EXT;
    instance.next.DebugReportMessageEXT(handle, flags, type, object, location, code, prefix, message);
}

} // namespace vellum::layer
