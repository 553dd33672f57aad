// SPDX-License-Identifier: Apache-2.0
// The rules of creating and destroying micromaps and acceleration structures.
#pragma once

#include "layer/input/creations.h"
#include "layer/validation/model/device_model.h"

namespace vellum::layer
{

input::Creation checkCreation(DeviceModel &device, const VkMicromapCreateInfoEXT &info);
input::Creation checkCreation(DeviceModel &device, const VkAccelerationStructureCreateInfoKHR &info);
input::Creation checkCreation(DeviceModel &device, const VkAccelerationStructureCreateInfo2KHR &info);
// `structure`: null if it is unknown. `allocator`: allocation callbacks are given.
void checkDestruction(DeviceModel &device, const ValidatedStructure *structure, bool allocator);

} // namespace vellum::layer
