// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "layer/validation/commands.h"
#include "layer/validation/rules/build_input.h"

namespace vellum::layer
{

// The effect of a build of a micromap; `commandBuffer`: null for one on the host.
void micromapBuilt(DeviceValidation &device, VkCommandBuffer commandBuffer, const MicromapBuildInput &build);

} // namespace vellum::layer
