// SPDX-License-Identifier: Apache-2.0
// Queries of the sizes of acceleration structures.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct AccelerationStructure;
struct DeviceStructures;
class InjectedWork;

// Corrects the driver's answer, the 64-bit number at `value`, for a structure with emulated micromaps.
void recordStructureProperty(InjectedWork &work, DeviceStructures &device, AccelerationStructure &structure,
                             VkQueryType type, VkDeviceAddress value);

} // namespace vellum::layer
