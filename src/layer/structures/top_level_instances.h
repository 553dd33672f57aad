// SPDX-License-Identifier: Apache-2.0
// The instances that the driver builds a top-level structure from: the application's are brought to the structure's
// tail, and changed there.
#pragma once

#include <cstdint>

#include <vulkan/vulkan.h>

namespace vellum::layer
{

class InjectedWork;
class SlotRange;
struct DeviceStructures;

// Where the instances come from, which decides what they may reference.
enum class InstanceSource { Build, IndirectBuild, Copy };

// Records the dispatches that make `count` instances in the tail those for the driver. `source`: the application's, or
// the tail, if they were brought there before.
bool patchInstances(InjectedWork &work, const DeviceStructures &device, const SlotRange &slots, uint32_t count,
                    VkDeviceAddress source, VkDeviceAddress tail, InstanceSource from);

} // namespace vellum::layer
