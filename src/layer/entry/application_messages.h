// SPDX-License-Identifier: Apache-2.0
// Messages that the application sends, by VK_EXT_debug_utils and VK_EXT_debug_report. They may name objects of the
// layer, which the driver does not know.
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
