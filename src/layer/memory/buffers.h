// Buffers, memory and render passes: usage flags that the driver does not know are taken out, addresses are kept.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct Device;

// Called when a buffer is bound. A range of device address commands may come from a buffer whose address was not asked
// for: it is asked for of another one, which shares the memory, or was known from a captured replay.
void rememberAddress(Device &device, VkBuffer buffer);

VKAPI_ATTR VkResult VKAPI_CALL createBuffer(VkDevice, const VkBufferCreateInfo *, const VkAllocationCallbacks *,
                                            VkBuffer *);
VKAPI_ATTR void VKAPI_CALL destroyBuffer(VkDevice, VkBuffer, const VkAllocationCallbacks *);
VKAPI_ATTR void VKAPI_CALL getDeviceBufferMemoryRequirements(VkDevice, const VkDeviceBufferMemoryRequirements *,
                                                             VkMemoryRequirements2 *);
VKAPI_ATTR VkResult VKAPI_CALL allocateMemory(VkDevice, const VkMemoryAllocateInfo *, const VkAllocationCallbacks *,
                                              VkDeviceMemory *);
VKAPI_ATTR VkDeviceAddress VKAPI_CALL getBufferDeviceAddress(VkDevice, const VkBufferDeviceAddressInfo *);
VKAPI_ATTR void VKAPI_CALL getPhysicalDeviceExternalBufferProperties(VkPhysicalDevice,
                                                                     const VkPhysicalDeviceExternalBufferInfo *,
                                                                     VkExternalBufferProperties *);
VKAPI_ATTR void VKAPI_CALL cmdBindDescriptorBuffers(VkCommandBuffer, uint32_t,
                                                    const VkDescriptorBufferBindingInfoEXT *);
VKAPI_ATTR VkResult VKAPI_CALL setDebugUtilsObjectName(VkDevice, const VkDebugUtilsObjectNameInfoEXT *);
VKAPI_ATTR VkResult VKAPI_CALL setDebugUtilsObjectTag(VkDevice, const VkDebugUtilsObjectTagInfoEXT *);
VKAPI_ATTR VkResult VKAPI_CALL debugMarkerSetObjectName(VkDevice, const VkDebugMarkerObjectNameInfoEXT *);
VKAPI_ATTR VkResult VKAPI_CALL debugMarkerSetObjectTag(VkDevice, const VkDebugMarkerObjectTagInfoEXT *);

} // namespace vellum::layer
