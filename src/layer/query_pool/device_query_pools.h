// The room of queries: query pools whose results the driver cannot give, or not alone.
#pragma once

#include "layer/query_pool/query_pool.h"
#include "layer/structures/device_structures.h"

namespace vellum::layer
{

struct DeviceQueryPools {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceState &objects;
    DeviceCommandBuffers &commands;
    DeviceStructures &structures;
    // Each pool on pages of its own: the host resets one while the device writes another, which layers below that guard
    // pages would take for the same.
    MemoryPool memory{buffers.gpu, 4096,
                      [](const GpuContext &) -> VkBufferUsageFlags {
                          return VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
                      },
                      GpuBuffer::Content::Undefined};
    HandleMap<VkQueryPool, std::shared_ptr<QueryPool>> pools{};
};

} // namespace vellum::layer
