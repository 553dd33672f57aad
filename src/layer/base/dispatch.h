// SPDX-License-Identifier: Apache-2.0
// Function pointers of the next layer or driver, for each command in base/commands.inc.
#pragma once

#include "vk/newer.h"

namespace vellum::layer
{

// The name under which the registry describes a command: `name`, or what it is an alias of.
const char *commandOf(const char *name);

struct InstanceTable {
#define VELLUM_INSTANCE(command, ...) PFN_vk##command command = nullptr;
#include "layer/base/commands.inc"
    PFN_vkGetInstanceProcAddr GetInstanceProcAddr = nullptr;
    // `core`: the instance has Vulkan 1.1 or later. Others have the commands that 1.1 promoted under their aliases.
    void load(VkInstance instance, PFN_vkGetInstanceProcAddr next, bool core);
};

struct DeviceTable {
#define VELLUM_DEVICE(command, ...) PFN_vk##command command = nullptr;
#include "layer/base/commands.inc"
    void load(VkDevice device, PFN_vkGetDeviceProcAddr next);
};

} // namespace vellum::layer
