// A device: the rooms of the layer put together, and its creation.
#pragma once

#include <vulkan/vulkan.h>

#include "layer/address/device_addresses.h"
#include "layer/door/instance.h"
#include "layer/pipelines/device_pipelines.h"

namespace vellum::layer
{

struct Device {
    Instance *instance = nullptr;

    // Each uses those before it, and ends before they do.
    Driver driver{};
    DeviceBuffers buffers{driver};
    DeviceObjects objects{driver, buffers};
    DeviceCommands commands{driver, buffers, objects};
    DeviceMicromaps micromaps{driver, buffers, objects, commands};
    DeviceStructures structures{driver, buffers, objects, commands, micromaps};
    DeviceQueries queries{driver, buffers, objects, commands, structures};
    DevicePipelines pipelines{driver, buffers, objects, commands};
    DeviceAddresses addresses{driver, buffers, commands, queries};
};

Device *deviceOfKey(void *key);
template <typename DispatchableHandle>
Device &deviceOf(DispatchableHandle handle)
{
    return *deviceOfKey(dispatchKey(handle));
}

// What a room has of a device: its commands take that as their first parameter.
template <typename Room>
Room &roomOf(Device &device);
template <>
inline Driver &roomOf(Device &device)
{
    return device.driver;
}
template <>
inline DeviceBuffers &roomOf(Device &device)
{
    return device.buffers;
}
template <>
inline DeviceObjects &roomOf(Device &device)
{
    return device.objects;
}
template <>
inline DeviceCommands &roomOf(Device &device)
{
    return device.commands;
}
template <>
inline DeviceMicromaps &roomOf(Device &device)
{
    return device.micromaps;
}
template <>
inline DeviceStructures &roomOf(Device &device)
{
    return device.structures;
}
template <>
inline DeviceQueries &roomOf(Device &device)
{
    return device.queries;
}
template <>
inline DevicePipelines &roomOf(Device &device)
{
    return device.pipelines;
}
template <>
inline DeviceAddresses &roomOf(Device &device)
{
    return device.addresses;
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice physicalDevice, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device);
VKAPI_ATTR void VKAPI_CALL destroyDevice(VkDevice device, const VkAllocationCallbacks *allocator);

} // namespace vellum::layer
