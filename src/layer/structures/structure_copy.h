// SPDX-License-Identifier: Apache-2.0
// Clones and compacted copies of acceleration structures with emulated micromaps.
//
// A copy of a bottom-level structure is the driver's, and a shader adds the records behind it. A copy of a top-level
// structure is a build from the instances that the source keeps, so that it has slots of its own: it stays as it is
// when the source is built again or destroyed. What was built into the source is read on the GPU, when the copy
// executes: commands may be recorded in any order.
#pragma once

#include "layer/command_buffer/injected_work.h"
#include "layer/structures/structure_input.h"

namespace vellum::layer
{

struct DeviceStructures;
struct TopLevelLayout;

// Invocations of injected work that runs over a whole structure: enough to keep a GPU busy, few for a small one.
uint64_t copyInvocations(VkDeviceSize bytes);

// Builds `target` from the instances that the descriptor at `source` leads to.
// `from`: kFromStructure or kFromSerialized (core/push.h). False, after a message: nothing was recorded.
bool recordTopLevelCopy(InjectedWork &work, DeviceStructures &device, VkCommandBuffer commandBuffer,
                        const char *command, AccelerationStructure &target, VkDeviceAddress source,
                        const TopLevelLayout &layout, uint32_t from);

} // namespace vellum::layer
