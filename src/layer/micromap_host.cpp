// The host commands of micromaps (micromapHostCommands): not there yet.
#include "layer/device.h"
#include "layer/micromap.h"

namespace vellum::layer
{

VKAPI_ATTR VkResult VKAPI_CALL buildMicromaps(VkDevice handle, VkDeferredOperationKHR, uint32_t,
                                              const VkMicromapBuildInfoEXT *)
{
    deviceOf(handle).report().notAvailable("vkBuildMicromapsEXT (micromapHostCommands)");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

VKAPI_ATTR VkResult VKAPI_CALL copyMicromap(VkDevice handle, VkDeferredOperationKHR, const VkCopyMicromapInfoEXT *)
{
    deviceOf(handle).report().notAvailable("vkCopyMicromapEXT (micromapHostCommands)");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

VKAPI_ATTR VkResult VKAPI_CALL copyMicromapToMemory(VkDevice handle, VkDeferredOperationKHR,
                                                    const VkCopyMicromapToMemoryInfoEXT *)
{
    deviceOf(handle).report().notAvailable("vkCopyMicromapToMemoryEXT (micromapHostCommands)");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

VKAPI_ATTR VkResult VKAPI_CALL copyMemoryToMicromap(VkDevice handle, VkDeferredOperationKHR,
                                                    const VkCopyMemoryToMicromapInfoEXT *)
{
    deviceOf(handle).report().notAvailable("vkCopyMemoryToMicromapEXT (micromapHostCommands)");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

VKAPI_ATTR VkResult VKAPI_CALL writeMicromapsProperties(VkDevice handle, uint32_t, const VkMicromapEXT *, VkQueryType,
                                                        size_t, void *, size_t)
{
    deviceOf(handle).report().notAvailable("vkWriteMicromapsPropertiesEXT (micromapHostCommands)");
    return VK_ERROR_FEATURE_NOT_PRESENT;
}

} // namespace vellum::layer
