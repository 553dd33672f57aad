// SPDX-License-Identifier: Apache-2.0
// The memory subsystem: the application's buffers and memory objects, the buffer at an address, the host's view of
// memory, and the layer's buffers.
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

} // namespace vellum::layer
