// SPDX-License-Identifier: Apache-2.0
// The rules of builds that need to know the application's objects: what they hold when a build is executed, and their
// memory. layer/rules/builds.h has the rules of the input.
#pragma once

#include "layer/input/builds.h"
#include "layer/validation/rules/rule_check.h"

namespace vellum::layer
{

// Reports VELLUM-checked with the first build of the device: `vellum run` counts devices on which something was
// checked.
void noteChecked(DeviceModel &device, const input::Builds &builds);

// Checks all rules of a command that builds, and finds what the builds access. `commandBuffer`: null for
// vkBuildMicromapsEXT.
void checkBuilds(DeviceModel &device, VkCommandBuffer commandBuffer, input::Builds &builds);

} // namespace vellum::layer
