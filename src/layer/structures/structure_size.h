// What an application is told of the sizes of acceleration structures: the driver's answer, and the layer's part.
#pragma once

#include <vulkan/vulkan.h>

#include "layer/commands/injected_work.h"

namespace vellum::layer
{

struct DeviceStructures;

// Whether the answers to queries of this type must go through recordStructureProperty.
bool isStructureProperty(VkQueryType type);

// Records the correction of a query result. `value`: address, a multiple of 4, of a 64-bit number in memory that
// shaders can write, which holds the driver's answer when this executes, and the application's afterwards. What a
// structure holds is known on the GPU only, so there is no correction on the host.
//
// The caller puts work.barrier() between the copy of the driver's answer and this, and between this and its use. The
// answer for VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR is also where a compacted copy puts the records.
void recordStructureProperty(InjectedWork &work, DeviceStructures &device, VkAccelerationStructureKHR structure,
                             VkQueryType type, VkDeviceAddress value);

} // namespace vellum::layer
