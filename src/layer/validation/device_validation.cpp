// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/device_validation.h"

namespace vellum::layer
{

void reportLeaks(const DeviceModel &device)
{
    size_t count = 0;
    ObjectHandle first;
    const auto add = [&](auto, const std::shared_ptr<ValidatedStructure> &structure) {
        first = count++ == 0 ? structure->handle : first;
    };
    device.objects.micromaps.visit(add);
    device.objects.structures.visit(add);
    if (device.checks.core && count != 0)
        device.at(Place("vkDestroyDevice"), first)
            .report("VUID-vkDestroyDevice-device-05137", nullptr,
                    std::to_string(count) + " micromaps and acceleration structures were not destroyed; one is " +
                        device.nameOf(first));
}

DeviceValidation::~DeviceValidation()
{
    reportCompleted(*this, true);
    commands.states.clear(); // they hold marks of `traces`
}

namespace
{

// The memory that a build needs where micromaps are the driver's own.
std::optional<input::BuildNeeds> driverNeeds(const DeviceModel &device, const input::MicromapBuild &build)
{
    const auto type =
        build.host ? VK_ACCELERATION_STRUCTURE_BUILD_TYPE_HOST_KHR : VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR;
    if (!build.khr) {
        VkMicromapBuildSizesInfoEXT sizes{VK_STRUCTURE_TYPE_MICROMAP_BUILD_SIZES_INFO_EXT};
        device.next.GetMicromapBuildSizesEXT(device.driver.handle, type,
                                             static_cast<const VkMicromapBuildInfoEXT *>(build.given), &sizes);
        return input::BuildNeeds{sizes.micromapSize, 0, sizes.buildScratchSize, sizes.discardable == VK_TRUE};
    }
    VkAccelerationStructureBuildSizesInfoKHR sizes{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
    device.next.GetAccelerationStructureBuildSizesKHR(
        device.driver.handle, type, static_cast<const VkAccelerationStructureBuildGeometryInfoKHR *>(build.given),
        nullptr, &sizes);
    return input::BuildNeeds{sizes.accelerationStructureSize, 0, sizes.buildScratchSize};
}

} // namespace

std::unique_ptr<DeviceValidation> createValidation(const Driver &driver, const RuleDevice &rules,
                                                   const RuleLimits &limits, PFN_vkGetDeviceProcAddr implementation,
                                                   std::shared_ptr<const std::vector<uint32_t>> queueFamilies)
{
    auto device = std::make_unique<DeviceValidation>();
    device->driver = driver;
    device->driver.mode = Mode::PassThrough; // the implementation below counts as a driver with micromaps
    device->driver.ownAddressCommands = false;
    device->implementsRanges = driver.ownAddressCommands;
    device->driver.next.load(driver.handle, implementation);
    device->checks = driver.settings->validate;
    device->emulated = driver.emulated();
    RuleDevice &own = device->rules;
    own.validating = device->checks.core;
    own.ext = rules.ext;
    own.khr = rules.khr;
    own.needs = [&model = *device, &rules](const input::MicromapBuild &build) {
        return rules.support(build.khr) ? rules.needs(build) : driverNeeds(model, build);
    };
    own.lacksBuffer = [&model = *device](VkDeviceAddress address) {
        return !model.objects.anyUnknown && !model.buffers.addresses.find(address).buffer;
    };
    own.content = rules.content;
    own.placesMicromap = rules.placesMicromap;
    own.extLimits = limits.ext;
    own.khrLimits = limits.khr;
    own.scratchAlignment = limits.scratchAlignment;
    GpuContext &gpu = device->buffers.gpu;
    gpu.device = driver.handle;
    gpu.next = &device->driver.next;
    gpu.queueFamilies = std::move(queueFamilies);
    driver.instance->GetPhysicalDeviceMemoryProperties(driver.physicalDevice, &gpu.memory);
    device->buffers.onAddress = [](VkBuffer) {};
    VkResult result = device->commands.injected.create(gpu, driver.pushBytes);
    if (result == VK_SUCCESS) {
        device->gpu.create(driver);
        return device;
    }
    driver.report().error("VELLUM-device-tables", "no memory for validation, which is therefore off");
    return nullptr;
}

} // namespace vellum::layer
