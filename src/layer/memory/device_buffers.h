// The room of memory: the application's buffers and memory objects, which buffer an address lies in, the host's view of
// them, and buffers of the layer's own.
#pragma once

#include <atomic>
#include <functional>

#include "layer/base/driver.h"
#include "layer/base/handle_map.h"
#include "layer/memory/address_map.h"
#include "layer/memory/gpu_memory.h"
#include "layer/memory/host_memory.h"
#include "layer/memory/scratch_memory.h"

namespace vellum::layer
{

struct BufferInfo {
    VkDeviceSize size = 0;
    VkFlags64 usage = 0; // as the driver knows it
    uint64_t number = 0; // of all buffers of the device: unlike handles, numbers are not used again
};

struct DeviceBuffers {
    Driver &driver;
    GpuContext gpu{};
    HandleMap<VkBuffer, BufferInfo> infos{};
    std::atomic<uint64_t> numbers{0};
    AddressMap addresses{};
    HostMemory host{};
    MemoryPool scratch{gpu, kScratchAlignment, scratchUsage, GpuBuffer::Content::DevicesOnly}; // of command buffers
    // Of hit records that the host writes.
    MemoryPool hitRecords{
        gpu, kScratchAlignment,
        [](const GpuContext &) -> VkBufferUsageFlags { return VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR; },
        GpuBuffer::Content::Undefined};
    // Called when a buffer has got memory, or its address is asked for.
    std::function<void(VkBuffer)> onAddress{};
};

} // namespace vellum::layer
