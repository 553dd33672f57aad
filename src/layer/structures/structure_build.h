// SPDX-License-Identifier: Apache-2.0
// Builds and updates of acceleration structures with emulated micromaps: the driver's builds, the instances that it
// builds from, and the records behind its structures.
#pragma once

#include <vector>

#include "layer/structures/structure_input.h"

namespace vellum::layer
{

struct DeviceStructures;

void recordStructureBuilds(DeviceStructures &device, VkCommandBuffer commandBuffer, const char *command,
                           std::vector<StructureBuild> builds);

} // namespace vellum::layer
