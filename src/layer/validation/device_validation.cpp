// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/device_validation.h"

namespace vellum::layer
{

DeviceValidation::~DeviceValidation()
{
    reportCompleted(*this, true);
    commands.states.clear(); // they hold marks of `traces`
}

std::unique_ptr<DeviceValidation> createValidation(const Driver &driver, const RuleLimits &limits,
                                                   PFN_vkGetDeviceProcAddr implementation,
                                                   std::shared_ptr<const std::vector<uint32_t>> queueFamilies)
{
    auto device = std::make_unique<DeviceValidation>();
    device->driver = driver;
    device->driver.mode = Mode::PassThrough; // whoever implements micromaps is a driver that has them
    device->driver.ownAddressCommands = false;
    device->driver.next.load(driver.handle, implementation);
    device->checks = driver.settings->validate;
    device->emulated = driver.emulated();
    device->limits = limits;
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
