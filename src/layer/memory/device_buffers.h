// SPDX-License-Identifier: Apache-2.0
// The memory subsystem: the application's buffers and memory objects, the buffer at an address, the host's view of
// memory, and the layer's buffers.
#pragma once

#include <atomic>
#include <functional>

#include <vulkan/vulkan.h>

#include "layer/base/driver.h"
#include "layer/base/handle_map.h"
#include "layer/base/pnext.h"
#include "layer/memory/address_map.h"
#include "layer/memory/gpu_memory.h"
#include "layer/memory/host_memory.h"
#include "layer/memory/scratch_memory.h"

namespace vellum::layer
{

struct BufferInfo {
    VkDeviceSize size = 0;
    VkFlags64 usage = 0; // the driver's usage flags
    uint64_t number = 0; // unique on the device: unlike handles, numbers are not used again
};

struct DeviceBuffers {
    Driver &driver;
    GpuContext gpu{};
    HandleMap<VkBuffer, BufferInfo> infos{}; // of the driver's buffers
    std::atomic<uint64_t> numbers{0};
    AddressMap addresses{};
    HostMemory host{};
    MemoryPool scratch{gpu, kScratchAlignment, scratchUsage, GpuBuffer::Content::DevicesOnly}; // for command buffers
    // For hit records that the host writes.
    MemoryPool hitRecords{
        gpu, kScratchAlignment,
        [](const GpuContext &) -> VkBufferUsageFlags { return VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR; },
        GpuBuffer::Content::Undefined};
    // Called when a buffer is bound to memory, or its address is queried.
    std::function<void(VkBuffer)> onAddress{};
};

// The usage flags for the driver if micromaps are emulated. The layer's shaders read the inputs and write the storage
// of micromaps and acceleration structures by address, and copies of micromaps are buffer copies. Protected buffers and
// those in tile memory, which can hold neither structures nor their inputs, get no additional usage, since theirs is
// restricted (VUID-VkBufferCreateInfo-flags-09641, -usage-10764).
VkFlags64 emulatedUsage(VkFlags64 usage, VkBufferCreateFlags flags);
// The usage flags if micromaps are translated: those of VK_KHR_opacity_micromap are acceleration structures, without
// usage flags of their own.
VkFlags64 translatedUsage(VkFlags64 usage, VkBufferCreateFlags flags);

// Replaces the usage flags in a structure and in its chain by those for the driver, and returns the flags that the
// driver uses: those of VkBufferUsageFlags2CreateInfo (VK_KHR_maintenance5) if it is in the chain. Warns if that is
// behind a structure of unknown size, so that the driver gets the application's flags.
VkFlags64 editUsage(Reporter &report, Chain &chain, VkBufferUsageFlags &usage, VkBufferCreateFlags flags,
                    VkFlags64 (*driversUsage)(VkFlags64 usage, VkBufferCreateFlags flags));

// Keeps the address of a buffer that was bound. A device address command may name a range in a buffer whose address was
// never queried: the application knows it from another buffer in the same memory, or from a captured replay.
void rememberAddress(DeviceBuffers &device, VkBuffer buffer);

void bindDescriptorBuffers(DeviceBuffers &, VkCommandBuffer, uint32_t, const VkDescriptorBufferBindingInfoEXT *);

} // namespace vellum::layer
