// Buffers, memory and render passes: usage flags that the driver does not know are taken out, addresses are kept.
#pragma once

#include <vulkan/vulkan.h>

#include "layer/base/pnext.h"

namespace vellum::layer
{

struct DeviceBuffers;
struct Driver;
class Reporter;

// Usage flags as the driver is to see them where micromaps are emulated. The layer's shaders read the inputs and write
// the storage of micromaps and acceleration structures by address, and copies of micromaps are buffer copies.
// Buffers that can hold neither structures nor their inputs, protected ones and those in tile memory, get no usage
// more: what they may have is restricted (VUID-VkBufferCreateInfo-flags-09641, -usage-10764).
VkFlags64 emulatedUsage(VkFlags64 usage, VkBufferCreateFlags flags);
// The same where they are translated: micromaps of VK_KHR_opacity_micromap are acceleration structures, which have no
// usage flags of their own.
VkFlags64 translatedUsage(VkFlags64 usage, VkBufferCreateFlags flags);

// Of a structure with usage flags: makes them those of the driver, by one of the above or another function. Those of
// VkBufferUsageFlags2CreateInfo, where the structure's chain has one, replace the 32-bit ones (VK_KHR_maintenance5).
// Returns what the driver sees. Reports where it sees the application's, since they lie behind a structure of unknown
// size.
VkFlags64 editUsage(Reporter &report, Chain &chain, VkBufferUsageFlags &usage, VkBufferCreateFlags flags,
                    VkFlags64 (*driversUsage)(VkFlags64 usage, VkBufferCreateFlags flags));

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
