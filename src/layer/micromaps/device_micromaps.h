// The room of micromaps: builds, copies, host commands, the serialized form, and the front ends of
// VK_EXT_opacity_micromap and VK_KHR_opacity_micromap.
#pragma once

#include "layer/command_buffer/device_command_buffers.h"

namespace vellum::layer
{

struct DeviceMicromaps {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceState &objects;
    DeviceCommandBuffers &commands;
};

} // namespace vellum::layer
