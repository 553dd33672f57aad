// SPDX-License-Identifier: Apache-2.0
// Serialization and deserialization of acceleration structures with emulated micromaps (layouts: core/records.h). The
// driver reads and writes memory of the layer; shaders move the data to and from the application's memory, because they
// know where its buffer ends, and check everything that they read there.
//
// The data states what it holds. A structure of type GENERIC does not state what it was made for: its handle may have
// any size. For such a target everything is recorded that the data can need, and the device decides which of it has an
// effect.
#pragma once

#include "layer/structures/structure_input.h"

namespace vellum::layer
{

struct DeviceStructures;

void recordStructureSave(DeviceStructures &device, VkCommandBuffer commandBuffer, const SerializedCopy &copy);
void recordStructureRestore(DeviceStructures &device, VkCommandBuffer commandBuffer, const SerializedCopy &copy);
VkAccelerationStructureCompatibilityKHR structureCompatibility(DeviceStructures &device,
                                                               const VkAccelerationStructureVersionInfoKHR &info);

} // namespace vellum::layer
