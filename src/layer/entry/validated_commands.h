// SPDX-License-Identifier: Apache-2.0
// The commands of devices that are validated.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

// The function of a command that validation intercepts, by any of its names; null for other commands.
PFN_vkVoidFunction validatedCommand(const char *name);

} // namespace vellum::layer
