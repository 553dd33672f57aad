// SPDX-License-Identifier: Apache-2.0
// The subsystem khr_over_ext on a device: it translates VK_KHR_opacity_micromap for a driver that has only
// VK_EXT_opacity_micromap. Micromaps are the driver's. Devices that enable VK_KHR_opacity_micromap on such a driver use
// this subsystem in place of emulation.
#pragma once

#include "layer/query_pool/device_query_pools.h"

namespace vellum::layer
{

struct DeviceKhrOverExt {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceState &objects;
    DeviceCommandBuffers &commands;
    DeviceQueryPools &queries;
};

} // namespace vellum::layer
