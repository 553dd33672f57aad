// SPDX-License-Identifier: Apache-2.0
// The subsystem of acceleration structures on a device: creation, sizes, builds, copies and serialization, with the
// records that lead from a hit to its micromap.
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
    std::unique_ptr<Backend>
        backend{}; // set when the device is created; null on devices whose micromaps the layer leaves to the driver
};

} // namespace vellum::layer
