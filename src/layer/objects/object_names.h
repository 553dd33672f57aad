// Names and tags that the application gives objects: the layer's own objects mean nothing to the driver, and their
// names are used in the layer's messages.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct DeviceObjects;

VkResult setDebugUtilsObjectName(DeviceObjects &, VkDevice, const VkDebugUtilsObjectNameInfoEXT *);
VkResult setDebugUtilsObjectTag(DeviceObjects &, VkDevice, const VkDebugUtilsObjectTagInfoEXT *);
VkResult debugMarkerSetObjectName(DeviceObjects &, VkDevice, const VkDebugMarkerObjectNameInfoEXT *);
VkResult debugMarkerSetObjectTag(DeviceObjects &, VkDevice, const VkDebugMarkerObjectTagInfoEXT *);

} // namespace vellum::layer
