// Names and tags that the application gives objects: the layer's own objects mean nothing to the driver, and their
// names are used in the layer's messages.
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
