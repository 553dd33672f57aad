// SPDX-License-Identifier: Apache-2.0
#include "layer/entry/application_messages.h"

#include <vector>

#include "layer/entry/device.h"

namespace vellum::layer
{

void submitDebugUtilsMessage(VkInstance handle, VkDebugUtilsMessageSeverityFlagBitsEXT severity,
                             VkDebugUtilsMessageTypeFlagsEXT types, const VkDebugUtilsMessengerCallbackDataEXT *data)
{
    Instance &instance = instanceOf(handle);
    // Layers below may look objects up by their types. The application's messengers, which are below, still get them.
    std::vector<VkDebugUtilsObjectNameInfoEXT> objects(data->pObjects, data->pObjects + data->objectCount);
    for (VkDebugUtilsObjectNameInfoEXT &object : objects) {
        if (isLayerObject(instance, object.objectType, object.objectHandle))
            object.objectType = VK_OBJECT_TYPE_UNKNOWN;
    }
    VkDebugUtilsMessengerCallbackDataEXT own = *data;
    own.pObjects = objects.data();
    instance.next.SubmitDebugUtilsMessageEXT(handle, severity, types, &own);
}

void debugReportMessage(VkInstance handle, VkDebugReportFlagsEXT flags, VkDebugReportObjectTypeEXT type,
                        uint64_t object, size_t location, int32_t code, const char *prefix, const char *message)
{
    Instance &instance = instanceOf(handle);
    // VkDebugReportObjectTypeEXT has no value for VkMicromapEXT. For acceleration structures it has the number of
    // VkObjectType.
    if (isLayerObject(instance, static_cast<VkObjectType>(type), object))
        type = VK_DEBUG_REPORT_OBJECT_TYPE_UNKNOWN_EXT;
    instance.next.DebugReportMessageEXT(handle, flags, type, object, location, code, prefix, message);
}

} // namespace vellum::layer
