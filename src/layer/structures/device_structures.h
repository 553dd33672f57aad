// The room of acceleration structures: their creation, sizes, builds, copies and serialized form, with the records that
// lead from a hit to its micromap.
#pragma once

#include <memory>

#include "layer/micromaps/device_micromaps.h"
#include "layer/structures/backend.h"
#include "layer/structures/fallback_structure.h"

namespace vellum::layer
{

struct DeviceStructures {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceState &objects;
    DeviceCommandBuffers &commands;
    DeviceMicromaps &micromaps;
    FallbackStructure fallback{};
    std::unique_ptr<Backend> backend{}; // set while the device is made, if micromaps are the layer's business
};

} // namespace vellum::layer
