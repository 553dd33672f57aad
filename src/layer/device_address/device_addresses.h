// SPDX-License-Identifier: Apache-2.0
// The subsystem of VK_KHR_device_address_commands: commands that take address ranges, recorded as older commands that
// take buffers (address_lookup.h). The addressFlags are ignored: older commands get that information from the buffer.
#pragma once

#include <mutex>

#include "layer/memory/gpu_memory.h"
#include "layer/query_pool/device_query_pools.h"
#include "vellum/vulkan_opacity_micromap.h"

namespace vellum::layer
{

// Replaces a null index buffer on devices without VK_KHR_maintenance6, where none may be bound.
class ZeroIndices
{
public:
    VkBuffer get(const GpuContext &context); // VK_NULL_HANDLE if out of memory

private:
    std::mutex mutex_;
    GpuBuffer buffer_;
};
// Returns whether VK_NULL_HANDLE may be bound as index buffer on a device with this create info.
bool enablesNullIndexBuffer(const VkDeviceCreateInfo &info);

struct DeviceAddresses {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceCommandBuffers &commands;
    DeviceQueryPools &queries;
    ZeroIndices zeroIndices{};
};

} // namespace vellum::layer
