// SPDX-License-Identifier: Apache-2.0
// The subsystem of query pools on a device: pools whose results the layer writes or corrects.
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
    // Pools do not share pages: the host may reset one while the device writes another, and layers below that guard
    // pages would not distinguish them.
    MemoryPool memory{buffers.gpu, 4096,
                      [](const GpuContext &) -> VkBufferUsageFlags {
                          return VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
                      },
                      GpuBuffer::Content::Undefined};
    HandleMap<VkQueryPool, std::shared_ptr<QueryPool>> pools{};
};

} // namespace vellum::layer
