// SPDX-License-Identifier: Apache-2.0
// The state of an instance, and the commands that take an instance or a physical device.
#pragma once

#include <map>
#include <memory>
#include <mutex>

#include <vulkan/vulkan.h>

#include "layer/base/dispatch.h"
#include "layer/base/report.h"
#include "layer/base/settings.h"
#include "layer/entry/physical_device.h"
#include "layer/entry/registry.h"

namespace vellum::layer
{

// The key of a dispatchable handle: its first word points to the loader's table, which an instance shares with its
// physical devices, and a device with its queues and command buffers.
template <typename DispatchableHandle>
void *dispatchKey(DispatchableHandle handle)
{
    return *reinterpret_cast<void **>(handle);
}

struct Instance : Registered<Instance> {
    VkInstance handle = VK_NULL_HANDLE;
    InstanceTable next;
    bool isVulkan11 = false; // the application requests Vulkan 1.1 or later
    Settings settings;
    Reporter report;
    std::mutex physicalDevicesMutex;                                                   // guards the next member
    std::map<VkPhysicalDevice, std::shared_ptr<const PhysicalDevice>> physicalDevices; // see describe()
};

// The state of the instance that a VkInstance or VkPhysicalDevice belongs to.
Instance *instanceOfKey(void *key);
template <typename DispatchableHandle>
Instance &instanceOf(DispatchableHandle handle)
{
    return *instanceOfKey(dispatchKey(handle));
}

} // namespace vellum::layer
