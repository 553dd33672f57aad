// SPDX-License-Identifier: Apache-2.0
// Declares the functions of base/commands.inc that implement commands.
#pragma once

#include <type_traits>

#include "vk/newer.h"

namespace vellum::layer
{

struct DeviceAddresses;
struct DeviceBuffers;
struct DeviceCommandBuffers;
struct DeviceMicromaps;
struct DevicePipelines;
struct DeviceQueryPools;
struct DeviceState;
struct DeviceStructures;

// A function that gets `Part`, the part of a device, before Vulkan's arguments of a command.
template <typename Part, typename Command>
struct WithPart;
template <typename Part, typename Result, typename... Arguments>
struct WithPart<Part, Result(VKAPI_PTR *)(Arguments...)> {
    using Function = Result(Part &, Arguments...);
};

// By scope. Commands of the instance and the device itself are those of the subsystem entry, as Vulkan calls them.
#define VELLUM_PLAIN(command, function) std::remove_pointer_t<PFN_vk##command> function;
#define VELLUM_OF_PART(command, function) WithPart<VELLUM_PART, PFN_vk##command>::Function function;
#define VELLUM_NOTHING(...)
#define VELLUM_Never VELLUM_NOTHING
#define VELLUM_Instance VELLUM_PLAIN
#define VELLUM_Device VELLUM_PLAIN
#define VELLUM_Debug VELLUM_OF_PART
#define VELLUM_Emulated VELLUM_OF_PART
#define VELLUM_Provided VELLUM_OF_PART
#define VELLUM_Shaders VELLUM_OF_PART
#define VELLUM_Heaps VELLUM_NOTHING // templates in command_buffer/device_command_buffers.h
#define VELLUM_Ext VELLUM_OF_PART
#define VELLUM_Address VELLUM_OF_PART
#define VELLUM_AddressEnabled VELLUM_OF_PART
#define VELLUM_GLOBAL VELLUM_PLAIN
#define VELLUM_INSTANCE(command, scope, function) VELLUM_##scope(command, function)
#define VELLUM_DEVICE(command, scope, function, ...) VELLUM_##scope(command, function)
#include "layer/base/commands.inc"
#undef VELLUM_PLAIN
#undef VELLUM_OF_PART
#undef VELLUM_NOTHING
#undef VELLUM_Never
#undef VELLUM_Instance
#undef VELLUM_Device
#undef VELLUM_Debug
#undef VELLUM_Emulated
#undef VELLUM_Provided
#undef VELLUM_Shaders
#undef VELLUM_Heaps
#undef VELLUM_Ext
#undef VELLUM_Address
#undef VELLUM_AddressEnabled

} // namespace vellum::layer
