// Buffers, memory and render passes: usage flags that the driver does not know are taken out, addresses are kept.
#pragma once

#include <vulkan/vulkan.h>

namespace vellum::layer
{

struct DeviceBuffers;
struct Driver;

// Usage flags as the driver is to see them where micromaps are emulated. The layer's shaders read the inputs and write
// the storage of micromaps and acceleration structures by address, and copies of micromaps are buffer copies.
VkFlags64 emulatedUsage(VkFlags64 usage);
// The same where they are translated: micromaps of VK_KHR_opacity_micromap are acceleration structures, which have no
// usage flags of their own.
VkFlags64 translatedUsage(VkFlags64 usage);
VkFlags64 driverUsage(const Driver &driver, VkFlags64 usage);

// Called when a buffer is bound. A range of device address commands may come from a buffer whose address was not asked
// for: it is asked for of another one, which shares the memory, or was known from a captured replay.
void rememberAddress(DeviceBuffers &device, VkBuffer buffer);

VkResult createBuffer(DeviceBuffers &, VkDevice, const VkBufferCreateInfo *, const VkAllocationCallbacks *, VkBuffer *);
void destroyBuffer(DeviceBuffers &, VkDevice, VkBuffer, const VkAllocationCallbacks *);
void getDeviceBufferMemoryRequirements(DeviceBuffers &, VkDevice, const VkDeviceBufferMemoryRequirements *,
                                       VkMemoryRequirements2 *);
VkResult allocateMemory(DeviceBuffers &, VkDevice, const VkMemoryAllocateInfo *, const VkAllocationCallbacks *,
                        VkDeviceMemory *);
VkDeviceAddress getBufferDeviceAddress(DeviceBuffers &, VkDevice, const VkBufferDeviceAddressInfo *);
void cmdBindDescriptorBuffers(DeviceBuffers &, VkCommandBuffer, uint32_t, const VkDescriptorBufferBindingInfoEXT *);

} // namespace vellum::layer
