// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "layer/input/builds.h"
#include "layer/validation/commands.h"

namespace vellum::layer
{

// The effect of a build of a micromap; `commandBuffer`: null for one on the host.
void micromapBuilt(DeviceValidation &device, VkCommandBuffer commandBuffer, const input::MicromapBuild &build);

} // namespace vellum::layer
