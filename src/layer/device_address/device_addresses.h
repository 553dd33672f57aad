// SPDX-License-Identifier: Apache-2.0
// The subsystem of VK_KHR_device_address_commands: commands that take address ranges, recorded as older commands.
#pragma once

#include "layer/device_address/device_address_commands.h"
#include "layer/query_pool/device_query_pools.h"

namespace vellum::layer
{

struct DeviceAddresses {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceCommandBuffers &commands;
    DeviceQueryPools &queries;
    ZeroIndices zeroIndices{};
};

} // namespace vellum::layer
