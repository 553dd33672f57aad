// Messages that the application sends, of VK_EXT_debug_utils and VK_EXT_debug_report: they name objects, of which some
// are the layer's own.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

VKAPI_ATTR void VKAPI_CALL submitDebugUtilsMessage(VkInstance instance, VkDebugUtilsMessageSeverityFlagBitsEXT severity,
                                                   VkDebugUtilsMessageTypeFlagsEXT types,
                                                   const VkDebugUtilsMessengerCallbackDataEXT *data);
VKAPI_ATTR void VKAPI_CALL debugReportMessage(VkInstance instance, VkDebugReportFlagsEXT flags,
                                              VkDebugReportObjectTypeEXT type, uint64_t object, size_t location,
                                              int32_t code, const char *prefix, const char *message);

} // namespace vellum::layer
