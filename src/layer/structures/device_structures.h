// The room of acceleration structures: their creation, sizes, builds, copies and serialized form, with the records that
// lead from a hit to its micromap.
#pragma once

#include "layer/micromaps/device_micromaps.h"
#include "layer/structures/blank_structure.h"

namespace vellum::layer
{

struct DeviceStructures {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceObjects &objects;
    DeviceCommands &commands;
    DeviceMicromaps &micromaps;
    BlankStructure blank{};
};

} // namespace vellum::layer
