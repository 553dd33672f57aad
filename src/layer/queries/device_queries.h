// The room of queries: query pools whose results the driver cannot give, or not alone.
#pragma once

#include "layer/queries/query_pool.h"
#include "layer/structures/device_structures.h"

namespace vellum::layer
{

struct DeviceQueries {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceObjects &objects;
    DeviceCommands &commands;
    DeviceStructures &structures;
    HandleMap<VkQueryPool, std::shared_ptr<QueryPool>> pools{};
};

} // namespace vellum::layer
