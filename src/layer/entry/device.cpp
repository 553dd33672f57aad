#include "layer/entry/device.h"
#include "layer/khr_over_ext/ext_backend.h"
#include "layer/structures/emulated_backend.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

#include <vulkan/vk_layer.h>

#include "layer/base/pnext.h"
#include "layer/base/undo.h"
#include "layer/entry/hidden_extensions.h"
#include "layer/entry/registry.h"

namespace vellum::layer
{
namespace
{

constinit Registry<Device> devices;
// At the end of the process nothing is destroyed.
static_assert(std::is_trivially_destructible_v<Registry<Device>>);

bool asksFor(const VkDeviceCreateInfo &info, const char *extension)
{
    for (uint32_t i = 0; i < info.enabledExtensionCount; ++i) {
        if (std::strcmp(info.ppEnabledExtensionNames[i], extension) == 0)
            return true;
    }
    return false;
}

template <typename T>
const T *featuresIn(const VkDeviceCreateInfo &info, VkStructureType type)
{
    return findInChain<T>(info.pNext, type);
}

const VkPhysicalDeviceOpacityMicromapFeaturesEXT *extFeatures(const VkDeviceCreateInfo &info)
{
    return featuresIn<VkPhysicalDeviceOpacityMicromapFeaturesEXT>(
        info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT);
}

const VkPhysicalDeviceOpacityMicromapFeaturesKHR *khrFeatures(const VkDeviceCreateInfo &info)
{
    return featuresIn<VkPhysicalDeviceOpacityMicromapFeaturesKHR>(
        info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_KHR);
}

// What the application asks for, of what the layer may provide.
EnabledFeatures enabledFeaturesOf(const VkDeviceCreateInfo &info)
{
    EnabledFeatures enabled;
    enabled.ext = asksFor(info, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME);
    enabled.khr = asksFor(info, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME);
    enabled.addressCommands = asksFor(info, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME);
    enabled.pipelineMicromaps = asksFor(info, newer::kPipelineOpacityMicromapExtension);
    if (const auto *features = extFeatures(info)) {
        enabled.extFeature = features->micromap;
        enabled.captureReplay = features->micromapCaptureReplay;
        enabled.hostCommands = features->micromapHostCommands;
    }
    if (const auto *features = khrFeatures(info))
        enabled.khrFeature = features->micromap;
    if (const auto *features = featuresIn<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
            info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR))
        enabled.structures = features->accelerationStructure;
    if (const auto *features = featuresIn<VkPhysicalDeviceRayQueryFeaturesKHR>(
            info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR))
        enabled.rayQueries = features->rayQuery;
    if (const auto *features = featuresIn<VkPhysicalDeviceRayTracingPipelineFeaturesKHR>(
            info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_FEATURES_KHR))
        enabled.rayTracingPipelines = features->rayTracingPipeline;
    return enabled;
}

// What a device that is being made may need of the layer.
struct Provided {
    // There is something that the layer provides, by emulation, or by the driver's VK_EXT_opacity_micromap.
    Mode mode = Mode::PassThrough;
    Implementations have;
    std::vector<VkExtensionProperties> extensions; // the driver's; empty where nothing was asked for
};

// VK_ERROR_EXTENSION_NOT_PRESENT where nobody can provide what is asked for.
VkResult findProvided(Instance &instance, VkPhysicalDevice physicalDevice, const VkDeviceCreateInfo &info,
                      Provided &provided)
{
    const EnabledFeatures enabled = enabledFeaturesOf(info);
    const HiddenExtension *hidden = nullptr;
    for (uint32_t i = 0; i < info.enabledExtensionCount && !hidden; ++i)
        hidden = hiddenByEmulation(info.ppEnabledExtensionNames[i]);
    if (!enabled.ext && !enabled.khr && !enabled.addressCommands && !hidden)
        return VK_SUCCESS;
    provided.extensions = driverExtensions(instance, physicalDevice);
    const Implementations have = provided.have = implementationsOf(instance, physicalDevice, provided.extensions);
    bool provides = false;
    for (uint32_t i = 0; i < info.enabledExtensionCount; ++i) {
        const Implementation implementation = have.of(info.ppEnabledExtensionNames[i]);
        provides |= implementation == Implementation::Emulation || implementation == Implementation::Translation;
    }
    // A device of a driver with one of the two micromap extensions has the driver's micromaps, whichever it enables.
    const bool translated = provides && have.khr == Implementation::Translation;
    if (provides)
        provided.mode = translated ? Mode::KhrOverExt : Mode::Emulated;
    for (uint32_t i = 0; i < info.enabledExtensionCount; ++i) {
        const char *name = info.ppEnabledExtensionNames[i];
        hidden = nullptr;
        if (provided.mode == Mode::Emulated || have.ext == Implementation::Emulation)
            hidden = hiddenByEmulation(name);
        else if (translated)
            hidden = hiddenByTranslation(name);
        // Without KHR the micromaps of a translated device are as the driver knows them.
        if (!hidden || (translated && !enabled.khr && hidden->translated != HiddenExtension::Translated::NotBesideWork))
            continue;
        instance.report.error("VELLUM-hidden-extension",
                              std::string(name) + " is not there beside " + (translated ? "translated" : "emulated") +
                                  " micromaps: " + hidden->reason,
                              VK_OBJECT_TYPE_PHYSICAL_DEVICE, reinterpret_cast<uint64_t>(physicalDevice));
        return VK_ERROR_EXTENSION_NOT_PRESENT;
    }
    const char *missing = enabled.ext && have.ext == Implementation::None   ? VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME
                          : enabled.khr && have.khr == Implementation::None ? VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME
                                                                            : nullptr;
    if (!missing)
        return VK_SUCCESS;
    instance.report.error("VELLUM-device-without-ray-tracing",
                          std::string(missing) + " cannot be provided on this device: it has no acceleration "
                                                 "structures or no buffer device addresses",
                          VK_OBJECT_TYPE_PHYSICAL_DEVICE, reinterpret_cast<uint64_t>(physicalDevice));
    return VK_ERROR_EXTENSION_NOT_PRESENT;
}

// Whether the application wants addresses to be captured and replayed.
bool asksForReplay(const VkDeviceCreateInfo &info)
{
    const auto *core =
        featuresIn<VkPhysicalDeviceVulkan12Features>(info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
    const auto *own = featuresIn<VkPhysicalDeviceBufferDeviceAddressFeatures>(
        info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES);
    const auto *old = featuresIn<VkPhysicalDeviceBufferDeviceAddressFeaturesEXT>(
        info, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES_EXT);
    return (core && core->bufferDeviceAddressCaptureReplay) || (own && own->bufferDeviceAddressCaptureReplay) ||
           (old && old->bufferDeviceAddressCaptureReplay);
}

// The begin of the path of files about where tables of this device and driver lay (memory/kept_addresses.h).
std::string keptAddresses(const Instance &instance, VkPhysicalDevice physicalDevice)
{
    if (instance.settings.cacheFolder.empty())
        return {};
    VkPhysicalDeviceIDProperties id{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ID_PROPERTIES};
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &id, {}};
    instance.next.GetPhysicalDeviceProperties2(physicalDevice, &properties);
    std::string path = instance.settings.cacheFolder + "/";
    for (const auto *uuid : {&id.deviceUUID, &properties.properties.pipelineCacheUUID}) {
        for (const uint8_t byte : *uuid) {
            constexpr const char *kDigits = "0123456789abcdef";
            path += {kDigits[byte >> 4], kDigits[byte & 15]};
        }
    }
    return path;
}

// The device as the driver is asked for it: without what the layer provides, with what the layer needs. Where the
// driver cannot be asked for replayed addresses, `gpu` has none.
struct DriverDeviceInfo {
    DriverDeviceInfo(const VkDeviceCreateInfo &application, const Driver &driver, const Implementations &have,
                     GpuContext &gpu)
        : info(application), chain(application.pNext)
    {
        const bool ownAddressCommands = driver.ownAddressCommands;
        const bool keepsExt = driver.translated();
        const bool keepsPipelines = driver.translated() && have.pipelines == Implementation::PassThrough;
        const auto provided = [=](const char *name) {
            if (std::strcmp(name, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME) == 0)
                return ownAddressCommands;
            return (std::strcmp(name, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME) == 0 && !keepsExt) ||
                   std::strcmp(name, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME) == 0 ||
                   (std::strcmp(name, newer::kPipelineOpacityMicromapExtension) == 0 && !keepsPipelines);
        };
        for (uint32_t i = 0; i < application.enabledExtensionCount; ++i) {
            if (!provided(application.ppEnabledExtensionNames[i]))
                extensions.push_back(application.ppEnabledExtensionNames[i]);
        }
        if (gpu.importsHostMemory && !asksFor(application, VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME))
            extensions.push_back(VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME);
        if (driver.translated() && driver.enabled.khr && !driver.enabled.ext)
            extensions.push_back(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME);
        info.enabledExtensionCount = static_cast<uint32_t>(extensions.size());
        info.ppEnabledExtensionNames = extensions.data();
        chain.remove(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_KHR);
        if (driver.translated() && !setExtFeature(driver.enabled.khr))
            impossible = "VkPhysicalDeviceOpacityMicromapFeaturesEXT, in which the layer has to enable micromap";
        if (!driver.translated())
            chain.remove(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT);
        if (ownAddressCommands)
            chain.remove(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR);
        if (!keepsPipelines)
            chain.remove(newer::kPipelineOpacityMicromapFeatures);
        if (!keepsExt)
            chain.remove(newer::kDisplacementMicromapFeatures);
        if (!enableAddresses(gpu))
            impossible = "the structure in which the layer has to enable bufferDeviceAddress";
        info.pNext = chain.head();
    }
    // The tables are reached by address from every rewritten shader.
    bool enableAddresses(GpuContext &gpu)
    {
        const auto enable = [&gpu](auto *features) {
            if (features) {
                features->bufferDeviceAddress = VK_TRUE;
                features->bufferDeviceAddressCaptureReplay |= VkBool32{gpu.replaysAddresses};
            }
            return features != nullptr;
        };
        constexpr VkStructureType kCore = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES;
        constexpr VkStructureType kOwn = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES;
        if (enable(chain.edit<VkPhysicalDeviceVulkan12Features>(kCore)) ||
            enable(chain.edit<VkPhysicalDeviceBufferDeviceAddressFeatures>(kOwn)))
            return true;
        const auto *core = findInChain<VkPhysicalDeviceVulkan12Features>(chain.head(), kCore);
        const auto *own = findInChain<VkPhysicalDeviceBufferDeviceAddressFeatures>(chain.head(), kOwn);
        if (!core && !own) {
            chain.prepend(reinterpret_cast<VkBaseInStructure *>(&addresses));
            return enable(&addresses);
        }
        // It lies behind a structure of unknown size, and is what the application made it.
        gpu.replaysAddresses = false;
        return core ? core->bufferDeviceAddress : own->bufferDeviceAddress;
    }
    // The driver's micromaps, for those of VK_KHR_opacity_micromap. Whether the driver can be asked for them.
    bool setExtFeature(bool needed)
    {
        if (!needed)
            return true;
        if (auto *own = chain.edit<VkPhysicalDeviceOpacityMicromapFeaturesEXT>(
                VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT)) {
            own->micromap = VK_TRUE;
        } else if (const auto *applications = findInChain<VkPhysicalDeviceOpacityMicromapFeaturesEXT>(
                       chain.head(), VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT)) {
            return applications->micromap; // it lies behind a structure of unknown size
        } else {
            micromaps.micromap = VK_TRUE;
            chain.prepend(reinterpret_cast<VkBaseInStructure *>(&micromaps));
        }
        return true;
    }
    const char *impossible = nullptr; // what lies behind a structure of unknown size, and must be changed
    VkDeviceCreateInfo info;
    Chain chain;
    std::vector<const char *> extensions;
    VkPhysicalDeviceOpacityMicromapFeaturesEXT micromaps{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT};
    VkPhysicalDeviceBufferDeviceAddressFeatures addresses{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES};
};

std::vector<VkQueueFamilyProperties> queueFamiliesOf(const Instance &instance, VkPhysicalDevice physicalDevice)
{
    uint32_t count = 0;
    instance.next.GetPhysicalDeviceQueueFamilyProperties(physicalDevice, &count, nullptr);
    std::vector<VkQueueFamilyProperties> families(count);
    instance.next.GetPhysicalDeviceQueueFamilyProperties(physicalDevice, &count, families.data());
    return families;
}

const VkLayerDeviceCreateInfo *loaderInfo(const VkDeviceCreateInfo &info, VkLayerFunction function)
{
    const auto *link = static_cast<const VkLayerDeviceCreateInfo *>(info.pNext);
    while (link && !(link->sType == VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO && link->function == function))
        link = static_cast<const VkLayerDeviceCreateInfo *>(link->pNext);
    return link;
}

PFN_vkSetDeviceLoaderData loaderDataCallback(const VkDeviceCreateInfo &info)
{
    const VkLayerDeviceCreateInfo *link = loaderInfo(info, VK_LOADER_DATA_CALLBACK);
    return link ? link->u.pfnSetDeviceLoaderData : nullptr;
}

VkLayerDeviceCreateInfo *linkInfo(const VkDeviceCreateInfo &info)
{
    auto *link = const_cast<VkLayerDeviceCreateInfo *>(loaderInfo(info, VK_LAYER_LINK_INFO));
    return link && link->u.pLayerInfo ? link : nullptr;
}

// A family may be named twice, for protected queues.
std::shared_ptr<const std::vector<uint32_t>> queueFamiliesIn(const VkDeviceCreateInfo &info)
{
    std::vector<uint32_t> families;
    for (uint32_t i = 0; i < info.queueCreateInfoCount; ++i) {
        const uint32_t family = info.pQueueCreateInfos[i].queueFamilyIndex;
        if (std::ranges::find(families, family) == families.end())
            families.push_back(family);
    }
    return std::make_shared<const std::vector<uint32_t>>(std::move(families));
}

VkResult createInjected(const DriverFacts &facts, Device &device)
{
    return device.commands.injected.create(device.buffers.gpu,
                                           facts.isLavapipeBefore26 ? facts.maxPushConstantsSize : kPushBytes);
}

VkResult startEmulation(Instance &instance, VkPhysicalDevice physicalDevice, const VkDeviceCreateInfo &info,
                        const DriverFacts &facts, Device &device)
{
    device.pipelines.anyHitModules.create(device.buffers.gpu);
    device.buffers.onAddress = [&objects = device.objects](VkBuffer buffer) { bufferHasAddress(objects, buffer); };
    VkResult result = device.objects.root.create(device.buffers.gpu, keptAddresses(instance, physicalDevice));
    if (result == VK_SUCCESS)
        result = createInjected(facts, device);
    if (result == VK_SUCCESS && instance.settings.validate)
        result = device.commands.validationLog.create(device.buffers.gpu);
    if (result != VK_SUCCESS)
        return result;
    device.driver.threads = facts.isCpu ? std::max(std::thread::hardware_concurrency(), 1u) : 0;
    device.driver.queriesStructureSize = asksFor(info, VK_KHR_RAY_TRACING_MAINTENANCE_1_EXTENSION_NAME);
    device.commands.probes.choose(device.buffers.gpu, instance.report, device.driver.threads != 0,
                                  queueFamiliesOf(instance, physicalDevice), info, loaderDataCallback(info));
    return VK_SUCCESS;
}

VkResult startTranslation(const DriverFacts &facts, Device &device)
{
    device.buffers.onAddress = [](VkBuffer) {};
    return createInjected(facts, device);
}

} // namespace

Device *deviceOfKey(void *key)
{
    return devices.find(key);
}

bool isLayerObject(const Instance &instance, VkObjectType type, uint64_t handle)
{
    return devices.any(
        [&](const Device &device) { return device.instance == &instance && device.objects.own(type, handle); });
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice physicalDevice, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *handle)
{
    Instance &instance = instanceOf(physicalDevice);
    VkLayerDeviceCreateInfo *link = linkInfo(*info);
    if (!link)
        return VK_ERROR_INITIALIZATION_FAILED;
    const PFN_vkGetInstanceProcAddr nextInstanceGet = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    const PFN_vkGetDeviceProcAddr nextDeviceGet = link->u.pLayerInfo->pfnNextGetDeviceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext; // the loader's protocol
    const auto nextCreate = reinterpret_cast<PFN_vkCreateDevice>(nextInstanceGet(instance.handle, "vkCreateDevice"));
    if (!nextCreate)
        return VK_ERROR_INITIALIZATION_FAILED;

    Provided provided;
    VkResult result = findProvided(instance, physicalDevice, *info, provided);
    if (result != VK_SUCCESS)
        return result;
    auto device = std::make_unique<Device>();
    device->driver.mode = provided.mode;
    DriverFacts facts;
    const bool provides = provided.mode != Mode::PassThrough;
    if (!provides && asksFor(*info, VK_EXT_SHADER_MODULE_IDENTIFIER_EXTENSION_NAME)) {
        if (implementationsOn(instance, physicalDevice).mixesIdentifiers())
            device->driver.mode = Mode::Identifiers;
        device->driver.enabled = enabledFeaturesOf(*info);
    }
    if (provides) {
        facts = driverFactsOf(instance, physicalDevice, provided.extensions);
        device->driver.enabled = enabledFeaturesOf(*info);
        device->driver.ownAddressCommands =
            device->driver.enabled.addressCommands && provided.have.addressCommands == Implementation::Emulation;
    }
    if (device->driver.translated()) {
        device->buffers.gpu.driversMicromaps = device->driver.enabled.ext || device->driver.enabled.khr;
        device->structures.backend =
            std::make_unique<ExtBackend>(device->translation, driverLimits(instance, physicalDevice));
    } else if (device->driver.emulated()) {
        device->structures.backend = std::make_unique<EmulatedBackend>(device->structures);
        if (device->driver.enabled.captureReplay && !replaysAddresses(instance, physicalDevice)) {
            instance.report.error("VELLUM-device-features", "micromapCaptureReplay is not supported");
            return VK_ERROR_FEATURE_NOT_PRESENT;
        }
        device->buffers.gpu.importsHostMemory = facts.importsHostMemory;
        // An application that replays addresses has all of them to itself.
        device->buffers.gpu.replaysAddresses = !device->buffers.gpu.importsHostMemory && !asksForReplay(*info) &&
                                               replaysAddresses(instance, physicalDevice);
    }
    if (provides) {
        const DriverDeviceInfo driverInfo(*info, device->driver, provided.have, device->buffers.gpu);
        if (driverInfo.impossible) {
            instance.report.error("VELLUM-device-features",
                                  std::string(driverInfo.impossible) + " lies behind a structure of unknown size");
            return VK_ERROR_FEATURE_NOT_PRESENT;
        }
        result = nextCreate(physicalDevice, &driverInfo.info, allocator, handle);
    } else {
        result = nextCreate(physicalDevice, info, allocator, handle);
    }
    if (result != VK_SUCCESS)
        return result;

    static std::atomic<uint64_t> numbers{0};
    device->driver.next.load(*handle, nextDeviceGet);
    const PFN_vkDestroyDevice destroy = device->driver.next.DestroyDevice;
    Undo undo([&] {
        device.reset();
        destroy(*handle, allocator);
        *handle = VK_NULL_HANDLE;
    });
    device->driver.handle = *handle;
    device->driver.number = ++numbers;
    device->driver.physicalDevice = physicalDevice;
    device->instance = &instance;
    device->driver.instance = &instance.next;
    device->driver.settings = &instance.settings;
    device->driver.reporter = &instance.report;
    if (provides) {
        instance.next.GetPhysicalDeviceMemoryProperties(physicalDevice, &device->buffers.gpu.memory);
        device->buffers.gpu.device = *handle;
        device->buffers.gpu.next = &device->driver.next;
        device->buffers.gpu.queueFamilies = queueFamiliesIn(*info);
        device->driver.nullIndexBuffer = enablesNullIndexBuffer(*info);
        device->driver.clearsWholeHandles = device->driver.keepsOldPushConstants = facts.isLavapipeBefore26;
        device->driver.driverUuid = facts.driverUuid;
        result = device->driver.emulated() ? startEmulation(instance, physicalDevice, *info, facts, *device)
                                           : startTranslation(facts, *device);
        if (result != VK_SUCCESS) {
            instance.report.error("VELLUM-device-tables", "no memory for the layer's tables");
            return result;
        }
        instance.report.info("VELLUM-device",
                             device->driver.emulated()
                                 ? "opacity micromaps are emulated on this device"
                                 : "VK_KHR_opacity_micromap is translated to the driver's VK_EXT_opacity_micromap on "
                                   "this device");
    }
    devices.add(*device.release(), dispatchKey(*handle));
    undo.keep();
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL destroyDevice(VkDevice handle, const VkAllocationCallbacks *allocator)
{
    if (!handle)
        return;
    std::unique_ptr<Device> device(devices.take(dispatchKey(handle)));
    if (!device)
        return;
    const Undo undo([&] {
        const PFN_vkDestroyDevice destroy = device->driver.next.DestroyDevice;
        device.reset();
        destroy(handle, allocator);
    });
    reportGpuErrors(device->objects);
    device->commands.validationLog.drain(device->driver.report());
}

bool forgetDevices(const Instance &instance)
{
    bool any = false;
    while (devices.take([&](const Device &device) { return device.instance == &instance; }))
        any = true;
    return any;
}

} // namespace vellum::layer
