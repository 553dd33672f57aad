// SPDX-License-Identifier: Apache-2.0
#include "layer/entry/device.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <memory>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

#include <vulkan/vk_layer.h>

#include "layer/base/commands.h"
#include "layer/base/undo.h"
#include "layer/entry/device_info.h"
#include "layer/entry/ray_tracing_extensions.h"
#include "layer/entry/registry.h"
#include "layer/khr_over_ext/device_khr_over_ext.h"
#include "layer/structures/emulated_backend.h"

namespace vellum::layer
{
namespace
{

PermanentRegistry<Device> devices;
// No destructor runs at the end of the process.
static_assert(std::is_trivially_destructible_v<PermanentRegistry<Device>>);

void reportDeviceError(Instance &instance, VkPhysicalDevice handle, const char *id, const std::string &text)
{
    instance.report.error(id, text, VK_OBJECT_TYPE_PHYSICAL_DEVICE, reinterpret_cast<uint64_t>(handle));
}

// The mode of a device, if every extension that the application enables can be had.
Mode modeOf(const VkDeviceCreateInfo &info, const Implementations &have)
{
    for (uint32_t i = 0; i < info.enabledExtensionCount; ++i) {
        // A driver that has one of the two micromap extensions is always used for both.
        if (isProvided(have.of(info.ppEnabledExtensionNames[i])))
            return have.khr == Implementation::Translation ? Mode::KhrOverExt : Mode::Emulated;
    }
    const bool identifiers = enablesExtension(info, VK_EXT_SHADER_MODULE_IDENTIFIER_EXTENSION_NAME);
    return identifiers && have.mixesIdentifiers() ? Mode::Identifiers : Mode::PassThrough;
}

// Returns whether the application enables anything whose implementation depends on the layer.
bool dependsOnLayer(const VkDeviceCreateInfo &info)
{
    for (uint32_t i = 0; i < info.enabledExtensionCount; ++i) {
        const char *name = info.ppEnabledExtensionNames[i];
        const auto isName = [name](const ProvidedExtension &own) { return std::strcmp(own.name, name) == 0; };
        if (std::ranges::any_of(kProvidedExtensions, isName) ||
            std::strcmp(name, VK_NV_DISPLACEMENT_MICROMAP_EXTENSION_NAME) == 0 ||
            std::strcmp(name, VK_EXT_SHADER_MODULE_IDENTIFIER_EXTENSION_NAME) == 0)
            return true;
    }
    return false;
}

std::string conflictText(const ConflictingExtension &conflict, const VkDeviceCreateInfo &info,
                         const Implementations &have)
{
    const std::string name = conflict.name;
    const auto *own = std::ranges::find_if(kProvidedExtensions, [&](const ProvidedExtension &extension) {
        return isProvided(have.*extension.implementation) && enablesExtension(info, extension.name);
    });
    if (own == std::end(kProvidedExtensions))
        return name + " cannot be enabled on this device: " + conflict.reason + ", which the layer emulates";
    const bool translates = have.*own->implementation == Implementation::Translation;
    return name + " and " + own->name + " cannot be enabled together where the layer " +
           (translates ? "translates" : "emulates") + " the latter: " + conflict.reason +
           ". Enable one of them. With the setting implementation=driver the layer provides no extension";
}

// An extension that an enabled one requires.
struct Requirement {
    bool EnabledFeatures::*enabled;
    const char *extension;
    const char *required;
    bool rejects = false; // no device is created without it
};
constexpr Requirement kRequirements[] = {
    // Without it the application has no commands that create micromaps, and may call null pointers.
    {&EnabledFeatures::khr, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME,
     true},
    {&EnabledFeatures::khr, VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME, VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME},
    {&EnabledFeatures::ext, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME, VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME},
    {&EnabledFeatures::pipelineMicromaps, VK_ARM_PIPELINE_OPACITY_MICROMAP_EXTENSION_NAME,
     VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME},
};

// VK_ERROR_EXTENSION_NOT_PRESENT after a message if an enabled extension cannot be had.
VkResult checkExtensions(Instance &instance, VkPhysicalDevice handle, const VkDeviceCreateInfo &info,
                         const Implementations &have, const Driver &driver)
{
    if (const ConflictingExtension *conflict = conflictingExtension(info, driver.mode, have, driver.enabled)) {
        reportDeviceError(instance, handle, "VELLUM-conflicting-extension", conflictText(*conflict, info, have));
        return VK_ERROR_EXTENSION_NOT_PRESENT;
    }
    for (const Requirement &requirement : kRequirements) {
        const bool rejects = requirement.rejects && driver.providesMicromaps();
        if (!(driver.enabled.*requirement.enabled) || enablesExtension(info, requirement.required) ||
            (!rejects && !instance.settings.validate.core))
            continue;
        reportDeviceError(instance, handle, "VUID-vkCreateDevice-ppEnabledExtensionNames-01387",
                          std::string(requirement.extension) + " is enabled without " + requirement.required +
                              ", which it requires");
        if (rejects)
            return VK_ERROR_EXTENSION_NOT_PRESENT;
    }
    for (uint32_t i = 0; driver.emulated() && i < info.enabledExtensionCount; ++i) {
        if (isUnknownRayTracing(info.ppEnabledExtensionNames[i]))
            instance.report.warning("VELLUM-unknown-extension",
                                    std::string(info.ppEnabledExtensionNames[i]) +
                                        " is newer than this version of the layer. If it builds acceleration "
                                        "structures or traces rays in a way of its own, emulated micromaps and custom "
                                        "indices are wrong there",
                                    VK_OBJECT_TYPE_PHYSICAL_DEVICE, reinterpret_cast<uint64_t>(handle));
    }
    const char *missing =
        driver.enabled.ext && have.ext == Implementation::None   ? VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME
        : driver.enabled.khr && have.khr == Implementation::None ? VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME
                                                                 : nullptr;
    if (!missing)
        return VK_SUCCESS;
    reportDeviceError(instance, handle, "VELLUM-device-without-ray-tracing",
                      std::string(missing) + " cannot be provided on this device: it has no acceleration "
                                             "structures or no buffer device addresses");
    return VK_ERROR_EXTENSION_NOT_PRESENT;
}

// The beginning of the paths of the files that keep the addresses of tables for this device and driver
// (memory/kept_addresses.h); empty if they are not kept.
std::string keptAddresses(const Settings &settings, const PhysicalDevice &physical)
{
    if (settings.cacheFolder.empty())
        return {};
    std::string path = settings.cacheFolder + "/";
    for (const auto *uuid : {&physical.deviceUuid, &physical.pipelineCacheUuid}) {
        for (const uint8_t byte : *uuid) {
            constexpr const char *kDigits = "0123456789abcdef";
            path += {kDigits[byte >> 4], kDigits[byte & 15]};
        }
    }
    return path;
}

// The next layer's functions, by the loader's protocol.
struct NextLayer {
    PFN_vkCreateDevice createDevice = nullptr;
    PFN_vkGetDeviceProcAddr getDeviceProcAddr = nullptr;
};

VkLayerDeviceCreateInfo *loaderInfo(const VkDeviceCreateInfo &info, VkLayerFunction function)
{
    const auto *link = static_cast<const VkLayerDeviceCreateInfo *>(info.pNext);
    while (link && !(link->sType == VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO && link->function == function))
        link = static_cast<const VkLayerDeviceCreateInfo *>(link->pNext);
    return const_cast<VkLayerDeviceCreateInfo *>(link);
}

// Moves the loader's link on for the next layer. Without a link, the functions are null.
NextLayer takeLink(const Instance &instance, const VkDeviceCreateInfo &info)
{
    VkLayerDeviceCreateInfo *link = loaderInfo(info, VK_LAYER_LINK_INFO);
    if (!link || !link->u.pLayerInfo)
        return {};
    const VkLayerDeviceLink &next = *link->u.pLayerInfo;
    link->u.pLayerInfo = next.pNext;
    return {reinterpret_cast<PFN_vkCreateDevice>(next.pfnNextGetInstanceProcAddr(instance.handle, "vkCreateDevice")),
            next.pfnNextGetDeviceProcAddr};
}

PFN_vkSetDeviceLoaderData loaderDataCallback(const VkDeviceCreateInfo &info)
{
    const VkLayerDeviceCreateInfo *link = loaderInfo(info, VK_LOADER_DATA_CALLBACK);
    return link ? link->u.pfnSetDeviceLoaderData : nullptr;
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

// Creates a device, by prepare(), create() and start().
class DeviceCreation
{
public:
    DeviceCreation(Instance &instance, VkPhysicalDevice handle, const VkDeviceCreateInfo &info)
        : instance_(instance), physicalHandle_(handle), info_(info)
    {
    }
    // Decides what the layer does on the device, and checks whether it can.
    VkResult prepare();
    // Creates the driver's device.
    VkResult create(const NextLayer &next, const VkAllocationCallbacks *allocator, VkDevice *handle);
    // Creates what the layer needs on it.
    VkResult start();
    // Creates the validation of the device, whose commands can be found by now. Without memory the device has no
    // validation.
    void startValidation(Device &added) const;

    std::unique_ptr<Device> device = std::make_unique<Device>();

private:
    VkResult prepareEmulation();
    VkResult prepareTranslation();
    VkResult startEmulation();
    // The limits as the application sees them.
    [[nodiscard]] RuleLimits ruleLimits(const EnabledFeatures &enabled) const;

    Instance &instance_;
    VkPhysicalDevice physicalHandle_;
    const VkDeviceCreateInfo &info_;
    std::shared_ptr<const PhysicalDevice> physical_; // null if nothing depends on the layer
};

VkResult DeviceCreation::prepare()
{
    Driver &driver = device->driver;
    driver.physicalDevice = physicalHandle_;
    driver.instance = &instance_.next;
    driver.settings = &instance_.settings;
    driver.reporter = &instance_.report;
    device->instance = &instance_;
    if (!dependsOnLayer(info_))
        return VK_SUCCESS;
    physical_ = describe(instance_, physicalHandle_);
    if (physical_->listed != VK_SUCCESS)
        return physical_->listed;
    driver.enabled = enabledFeatures(info_);
    driver.mode = modeOf(info_, physical_->have);
    driver.clearsWholeHandles = driver.keepsOldPushConstants = physical_->isLavapipeBefore26;
    if (driver.keepsOldPushConstants)
        driver.pushBytes = physical_->maxPushConstantsSize;
    const VkResult result = checkExtensions(instance_, physicalHandle_, info_, physical_->have, driver);
    if (result != VK_SUCCESS || !driver.providesMicromaps())
        return result;
    // Each physical device would have its own instance of the layer's tables, which the host could not map
    // (VUID-vkMapMemory-memory-00683).
    if (isGroup(info_)) {
        instance_.report.error("VELLUM-device-features",
                               "micromaps are not available on a device of several physical devices "
                               "(VkDeviceGroupDeviceCreateInfo)");
        return VK_ERROR_FEATURE_NOT_PRESENT;
    }
    driver.ownAddressCommands =
        driver.enabled.addressCommands && physical_->have.addressCommands == Implementation::Emulation;
    driver.nullIndexBuffer = enablesNullIndexBuffer(info_);
    driver.queriesStructureSize = enablesExtension(info_, VK_KHR_RAY_TRACING_MAINTENANCE_1_EXTENSION_NAME);
    driver.driverUuid = physical_->driverUuid;
    const VkResult prepared = driver.emulated() ? prepareEmulation() : prepareTranslation();
    const Backend &backend = *device->structures.backend;
    device->objects.rules.khr = backend.support();
    device->objects.rules.needs = [&backend](const input::MicromapBuild &build) { return backend.needs(build); };
    device->objects.rules.placesMicromap = [&backend](VkBuffer buffer, VkDeviceSize offset, VkDeviceAddress address) {
        return backend.placesMicromap(buffer, offset, address);
    };
    device->objects.rules.content = [&objects = device->objects](ObjectHandle handle) {
        return structureFacts(objects, handle).content;
    };
    return prepared;
}

VkResult DeviceCreation::prepareEmulation()
{
    device->structures.backend = std::make_unique<EmulatedBackend>(device->structures);
    device->objects.rules.ext = kEmulatedSupport;
    device->driver.threads = physical_->isCpu ? std::max(std::thread::hardware_concurrency(), 1u) : 0;
    if (device->driver.enabled.captureReplay && !physical_->replaysAddresses) {
        instance_.report.error("VELLUM-device-features", "micromapCaptureReplay is not supported");
        return VK_ERROR_FEATURE_NOT_PRESENT;
    }
    GpuContext &gpu = device->buffers.gpu;
    gpu.importsHostMemory = physical_->importsHostMemory;
    // An application that replays addresses chooses all of them.
    gpu.replaysAddresses = !gpu.importsHostMemory && !enablesAddressReplay(info_) && physical_->replaysAddresses;
    return VK_SUCCESS;
}

VkResult DeviceCreation::prepareTranslation()
{
    const EnabledFeatures &enabled = device->driver.enabled;
    device->buffers.gpu.driversMicromaps = enabled.ext || enabled.khr;
    device->structures.backend = std::make_unique<ExtBackend>(device->translation, physical_->extLimits);
    return VK_SUCCESS;
}

VkResult DeviceCreation::create(const NextLayer &next, const VkAllocationCallbacks *allocator, VkDevice *handle)
{
    if (!device->driver.providesMicromaps())
        return next.createDevice(physicalHandle_, &info_, allocator, handle);
    GpuContext &gpu = device->buffers.gpu;
    const DriverDeviceInfo driverInfo(info_, device->driver, physical_->have, gpu);
    if (driverInfo.unreachable) {
        instance_.report.error("VELLUM-device-features",
                               std::string(driverInfo.unreachable) + " is behind a structure of unknown size");
        return VK_ERROR_FEATURE_NOT_PRESENT;
    }
    gpu.memory = physical_->memory;
    gpu.queueFamilies = queueFamiliesIn(info_);
    return next.createDevice(physicalHandle_, &driverInfo.info, allocator, handle);
}

VkResult DeviceCreation::startEmulation()
{
    const GpuContext &gpu = device->buffers.gpu;
    device->buffers.onAddress = [&objects = device->objects](VkBuffer buffer) { bufferHasAddress(objects, buffer); };
    device->commands.onBegin = [&objects = device->objects] { reportGpuErrors(objects); };
    VkResult result = device->objects.root.create(gpu, keptAddresses(instance_.settings, *physical_));
    if (result == VK_SUCCESS)
        result = device->commands.injected.create(gpu, device->driver.pushBytes);
    if (result == VK_SUCCESS)
        device->commands.probes.choose(gpu, instance_.report, physical_->isCpu, physical_->queueFamilies, info_,
                                       loaderDataCallback(info_));
    return result;
}

VkResult DeviceCreation::start()
{
    if (!device->driver.providesMicromaps())
        return VK_SUCCESS;
    GpuContext &gpu = device->buffers.gpu;
    gpu.device = device->driver.handle;
    gpu.next = &device->driver.next;
    device->buffers.onAddress = [](VkBuffer) {};
    const bool emulated = device->driver.emulated();
    const VkResult result =
        emulated ? startEmulation() : device->commands.injected.create(gpu, device->driver.pushBytes);
    if (result != VK_SUCCESS) {
        instance_.report.error("VELLUM-device-tables", "no memory for the layer's tables");
        return result;
    }
    instance_.report.info("VELLUM-device", emulated ? "opacity micromaps are emulated on this device"
                                                    : "VK_KHR_opacity_micromap is translated to the driver's "
                                                      "VK_EXT_opacity_micromap on this device");
    return VK_SUCCESS;
}

RuleLimits DeviceCreation::ruleLimits(const EnabledFeatures &enabled) const
{
    if ((!enabled.ext && !enabled.khr) || !instance_.next.GetPhysicalDeviceProperties2)
        return {};
    VkPhysicalDeviceOpacityMicromapPropertiesEXT ext{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_EXT};
    VkPhysicalDeviceOpacityMicromapPropertiesKHR khr{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_PROPERTIES_KHR};
    VkPhysicalDeviceAccelerationStructurePropertiesKHR structures{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_PROPERTIES_KHR};
    VkPhysicalDeviceProperties2 properties{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &structures, {}};
    const auto add = [&properties](auto &structure) {
        structure.pNext = properties.pNext;
        properties.pNext = &structure;
    };
    if (enabled.ext)
        add(ext);
    if (enabled.khr)
        add(khr);
    getPhysicalDeviceProperties2(physicalHandle_, &properties);
    return {{ext.maxOpacity2StateSubdivisionLevel, ext.maxOpacity4StateSubdivisionLevel},
            {khr.maxOpacity2StateSubdivisionLevel, khr.maxOpacity4StateSubdivisionLevel,
             khr.maxOpacityLossy4StateSubdivisionLevel, khr.maxMicromapTriangles},
            structures.minAccelerationStructureScratchOffsetAlignment};
}

void DeviceCreation::startValidation(Device &added) const
try {
    const EnabledFeatures &enabled = added.driver.enabled;
    if (!enabled.any() || !instance_.settings.validate.any())
        return;
    auto validation = createValidation(added.driver, added.objects.rules, ruleLimits(enabled), implementationProcAddr,
                                       queueFamiliesIn(info_));
    if (!validation)
        return;
    validation->facts = factsOf(added.driver, info_);
    validation->buffers.gpu.importsHostMemory = added.buffers.gpu.importsHostMemory;
    if (added.driver.emulated() && validation->checks.gpu) {
        validation->reportGpuErrors = [&objects = added.objects](uint32_t known) { reportGpuErrors(objects, known); };
        added.objects.validationReportsGpuErrors = true;
    }
    added.validation = std::move(validation);
    if (!added.driver.providesMicromaps())
        added.driver.report().info("VELLUM-device", "the driver's opacity micromaps are validated on this device");
} catch (const std::bad_alloc &) { // the device exists: it works without validation
    added.driver.report().error("VELLUM-device-tables", "no memory for validation, which is therefore off");
}

} // namespace

Device *deviceOfKey(void *key)
{
    return devices->find(key);
}

bool isLayerObject(const Instance &instance, VkObjectType type, uint64_t handle)
{
    return devices->any(
        [&](const Device &device) { return device.instance == &instance && device.objects.own(type, handle); });
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice physicalDevice, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *handle)
{
    Instance &instance = instanceOf(physicalDevice);
    const NextLayer next = takeLink(instance, *info);
    if (!next.createDevice)
        return VK_ERROR_INITIALIZATION_FAILED;
    DeviceCreation creation(instance, physicalDevice, *info);
    VkResult result = creation.prepare();
    if (result == VK_SUCCESS)
        result = creation.create(next, allocator, handle);
    if (result != VK_SUCCESS)
        return result;

    static std::atomic<uint64_t> numbers{0};
    Driver &driver = creation.device->driver;
    driver.next.load(*handle, next.getDeviceProcAddr);
    driver.handle = *handle;
    driver.number = ++numbers;
    Undo undo([&, destroy = driver.next.DestroyDevice] {
        creation.device.reset();
        destroy(*handle, allocator);
        *handle = VK_NULL_HANDLE;
    });
    result = creation.start();
    if (result != VK_SUCCESS)
        return result;
    Device &added = *creation.device.release();
    devices->add(added, dispatchKey(*handle));
    undo.keep();
    creation.startValidation(added);
    if (!added.driver.providesMicromaps() && !added.validation)
        instance.report.info("VELLUM-device-unchanged",
                             added.driver.enabled.ext || added.driver.enabled.khr
                                 ? "the driver's opacity micromaps are used on this device, without validation"
                                 : "this device enables no extension of opacity micromaps");
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL destroyDevice(VkDevice handle, const VkAllocationCallbacks *allocator)
{
    if (!handle)
        return;
    if (Device *known = deviceOfKey(dispatchKey(handle)); known && known->validation) {
        remember(known->validation->objects, [&] { reportLeaks(*known->validation); });
        known->validation.reset(); // its objects are destroyed by the commands of the device
    }
    std::unique_ptr<Device> device(devices->take(dispatchKey(handle)));
    if (!device)
        return;
    const Undo undo([&] {
        const PFN_vkDestroyDevice destroy = device->driver.next.DestroyDevice;
        device.reset();
        destroy(handle, allocator);
    });
    reportGpuErrors(device->objects, 0); // errors that validation has not reported
}

bool forgetDevices(const Instance &instance)
{
    bool any = false;
    while (devices->take([&](const Device &device) { return device.instance == &instance; }))
        any = true;
    return any;
}

} // namespace vellum::layer
