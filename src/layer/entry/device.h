// SPDX-License-Identifier: Apache-2.0
// A device: the parts of all subsystems, and its creation.
#pragma once

#include <memory>
#include <tuple>

#include <vulkan/vulkan.h>

#include "layer/device_address/device_addresses.h"
#include "layer/entry/instance.h"
#include "layer/khr_over_ext/device_khr_over_ext.h"
#include "layer/pipelines/device_pipelines.h"
#include "layer/validation/device_validation.h"

namespace vellum::layer
{

struct Device : Registered<Device> {
    Instance *instance = nullptr;

    // Each part uses those before it, and is destroyed before them.
    Driver driver{};
    DeviceBuffers buffers{driver};
    DeviceState objects{driver, buffers};
    DeviceCommandBuffers commands{driver, buffers};
    DeviceMicromaps micromaps{driver, buffers, objects, commands};
    DeviceStructures structures{driver, buffers, objects, commands, micromaps};
    DeviceQueryPools queries{driver, buffers, objects, commands, structures};
    DevicePipelines pipelines{driver, buffers, objects, commands};
    DeviceKhrOverExt translation{driver, buffers, objects, commands, queries};
    DeviceAddresses addresses{driver, buffers, commands, queries};
    std::unique_ptr<DeviceValidation> validation{}; // above all of them; null if it is off
};

Device *deviceOfKey(void *key);
template <typename DispatchableHandle>
Device &deviceOf(DispatchableHandle handle)
{
    return *deviceOfKey(dispatchKey(handle));
}

// Returns whether an object of a device of the instance was created by the layer: the driver does not know its handle.
bool isLayerObject(const Instance &instance, VkObjectType type, uint64_t handle);

// Forgets the devices that are alive when their instance is destroyed, and returns whether there were any. Neither they
// nor their objects are destroyed: the application's threads and the GPU may still be using them.
bool forgetDevices(const Instance &instance);

// The part of a device that belongs to one subsystem, which is the first parameter of the subsystem's commands.
template <typename Subsystem>
Subsystem &subsystemOf(Device &device)
{
    return std::get<Subsystem &>(std::tie(device.driver, device.buffers, device.objects, device.commands,
                                          device.micromaps, device.structures, device.queries, device.pipelines,
                                          device.translation, device.addresses));
}

// As vkGetDeviceProcAddr, without validation: the implementation of micromaps, or the next layer.
VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL implementationProcAddr(VkDevice device, const char *name);

} // namespace vellum::layer
