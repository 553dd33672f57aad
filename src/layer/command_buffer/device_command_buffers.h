// The room of command buffers: what the application has set in them, GPU work that the layer adds, synchronization as
// the driver knows it, trials of the driver, deferred operations, and what shaders found wrong.
#pragma once

#include <memory>

#include "layer/command_buffer/command_state.h"
#include "layer/command_buffer/deferred_operation.h"
#include "layer/command_buffer/driver_probe.h"
#include "layer/command_buffer/gpu_validation_log.h"
#include "layer/command_buffer/injected_work.h"
#include "layer/state/device_state.h"

namespace vellum::layer
{

struct DeviceCommandBuffers {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceState &objects;
    InjectedPipelines injected{};
    GpuValidationLog validationLog{};
    CommandStates states{};
    HandleMap<VkDeferredOperationKHR, std::shared_ptr<DeferredOperation>> deferredOperations{};
    ProbeQueue probes{}; // the last one: what is still running may use the others
};

} // namespace vellum::layer
