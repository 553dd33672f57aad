// SPDX-License-Identifier: Apache-2.0
// VkDeviceCreateInfo: what the application enables, and what the layer requests of the driver instead.
#pragma once

#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/driver.h"
#include "layer/base/pnext.h"
#include "layer/entry/physical_device.h"
#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

EnabledFeatures enabledFeatures(const VkDeviceCreateInfo &info);

// Returns whether the application captures and replays device addresses.
bool enablesAddressReplay(const VkDeviceCreateInfo &info);

// The create info that the driver gets: without what the layer provides, and with what the layer needs. Clears
// `gpu.replaysAddresses` if the feature cannot be enabled.
struct DriverDeviceInfo {
    DriverDeviceInfo(const VkDeviceCreateInfo &application, const Driver &driver, const Implementations &have,
                     GpuContext &gpu);
    DriverDeviceInfo(const DriverDeviceInfo &) = delete;
    DriverDeviceInfo &operator=(const DriverDeviceInfo &) = delete;

    VkDeviceCreateInfo info;
    // A structure that has to be changed, but is behind one of unknown size; null if there is none.
    const char *unreachable = nullptr;

private:
    void listExtensions(const VkDeviceCreateInfo &application, const Driver &driver, const Implementations &have,
                        const GpuContext &gpu);
    // Both return false if the structure cannot be changed and lacks the feature.
    bool enableAddresses(GpuContext &gpu);
    bool enableExtMicromaps();

    Chain chain_;
    std::vector<const char *> extensions_;
    VkPhysicalDeviceOpacityMicromapFeaturesEXT micromaps_{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT};
    VkPhysicalDeviceBufferDeviceAddressFeatures addresses_{
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES};
};

} // namespace vellum::layer
