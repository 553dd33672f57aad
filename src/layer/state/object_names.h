// SPDX-License-Identifier: Apache-2.0
// Names and tags of objects. The driver does not know layer objects; their names appear in the layer's messages.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct DeviceState;

VkResult setDebugUtilsObjectName(DeviceState &, VkDevice, const VkDebugUtilsObjectNameInfoEXT *);
VkResult setDebugUtilsObjectTag(DeviceState &, VkDevice, const VkDebugUtilsObjectTagInfoEXT *);
VkResult debugMarkerSetObjectName(DeviceState &, VkDevice, const VkDebugMarkerObjectNameInfoEXT *);
VkResult debugMarkerSetObjectTag(DeviceState &, VkDevice, const VkDebugMarkerObjectTagInfoEXT *);

} // namespace vellum::layer
