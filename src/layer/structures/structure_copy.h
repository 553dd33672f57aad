// Copies of acceleration structures: clone, compact, serialize, deserialize.
//
// A copy of a bottom-level structure is the driver's, and a shader adds the records behind it. A copy of a top-level
// structure is a build from the instances that the source keeps, so that it has slots of its own: it stays as it is
// when the source is built again or destroyed. What was built into the source is read on the GPU, when the copy
// executes: commands may be recorded in any order.
#pragma once

#include <cstdint>
#include <memory>

#include <vulkan/vulkan.h>

#include "layer/commands/injected_work.h"

namespace vellum::layer
{

struct DeviceStructures;

struct AccelerationStructure;

// Commands of injected work that run over a whole structure: enough invocations to keep a GPU busy, few for a small
// one.
uint64_t copyInvocations(VkDeviceSize bytes);

// Builds `target` from the instances that the cell at `source` leads to, of which there are at most `most`.
// `from`: Structure or Serialized. False, after a message: nothing was recorded.
bool recordTopLevelCopy(InjectedWork &work, DeviceStructures &device, VkCommandBuffer commandBuffer,
                        const char *command, VkAccelerationStructureKHR target, VkDeviceAddress source, uint32_t most,
                        InstancesFrom from);

void cmdCopyAccelerationStructure(DeviceStructures &, VkCommandBuffer, const VkCopyAccelerationStructureInfoKHR *);
// structure_restore.cpp
void cmdCopyMemoryToAccelerationStructure(DeviceStructures &, VkCommandBuffer,
                                          const VkCopyMemoryToAccelerationStructureInfoKHR *);
// structure_serialize.cpp
void cmdCopyAccelerationStructureToMemory(DeviceStructures &, VkCommandBuffer,
                                          const VkCopyAccelerationStructureToMemoryInfoKHR *);
// On the host: each reports that it is not there and does nothing, since the driver alone would lose the records.
VkResult copyAccelerationStructure(DeviceStructures &, VkDevice, VkDeferredOperationKHR,
                                   const VkCopyAccelerationStructureInfoKHR *);
VkResult copyAccelerationStructureToMemory(DeviceStructures &, VkDevice, VkDeferredOperationKHR,
                                           const VkCopyAccelerationStructureToMemoryInfoKHR *);
VkResult copyMemoryToAccelerationStructure(DeviceStructures &, VkDevice, VkDeferredOperationKHR,
                                           const VkCopyMemoryToAccelerationStructureInfoKHR *);
void getDeviceAccelerationStructureCompatibility(DeviceStructures &, VkDevice,
                                                 const VkAccelerationStructureVersionInfoKHR *,
                                                 VkAccelerationStructureCompatibilityKHR *);

} // namespace vellum::layer
