// SPDX-License-Identifier: Apache-2.0
// The subsystem of micromaps on a device: builds, copies, host commands and serialization of emulated micromaps, and
// the input of both extensions.
#pragma once

#include "layer/command_buffer/device_command_buffers.h"
#include "layer/micromaps/micromap_compaction.h"
#include "layer/state/device_state.h"

namespace vellum::layer
{

struct DeviceMicromaps {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceState &objects;
    DeviceCommandBuffers &commands;
    MicromapBounds bounds{};
};

} // namespace vellum::layer
