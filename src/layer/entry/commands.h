// SPDX-License-Identifier: Apache-2.0
// The intercepted commands: which there are on an instance and on a device.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance instance, const char *name);
VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice device, const char *name);
// As above, without validation: the implementation of micromaps, or the next layer.
VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL implementationProcAddr(VkDevice device, const char *name);

} // namespace vellum::layer
