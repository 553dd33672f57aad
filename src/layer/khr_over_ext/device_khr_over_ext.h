// The room of translation: VK_KHR_opacity_micromap by a driver that has VK_EXT_opacity_micromap only. Micromaps are the
// driver's; what is here puts each command of KHR as EXT has it. Devices that enable VK_KHR_opacity_micromap on such a
// driver use this room in the place of those that emulate.
#pragma once

#include "layer/pipelines/device_pipelines.h"
#include "layer/query_pool/device_query_pools.h"

namespace vellum::layer
{

struct DeviceKhrOverExt {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceState &objects;
    DeviceCommandBuffers &commands;
    DeviceQueryPools &queries;
    DevicePipelines &pipelines;
    HandleMap<VkShaderModule, uint64_t> tracingModules{}; // codeHash of those that trace rays by pipelines
};

} // namespace vellum::layer
