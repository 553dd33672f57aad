// The room of VK_KHR_device_address_commands: commands that take address ranges, carried out with older ones.
#pragma once

#include "layer/address/device_address_commands.h"
#include "layer/queries/device_queries.h"

namespace vellum::layer
{

struct DeviceAddresses {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceCommands &commands;
    DeviceQueries &queries;
    ZeroIndices zeroIndices{};
};

} // namespace vellum::layer
