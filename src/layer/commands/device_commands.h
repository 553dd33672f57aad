// The room of command buffers: what the application has set in them, GPU work that the layer adds, synchronization as
// the driver knows it, trials of the driver, deferred operations, and what shaders found wrong.
#pragma once

#include <memory>

#include "layer/commands/command_state.h"
#include "layer/commands/complaints.h"
#include "layer/commands/deferred.h"
#include "layer/commands/injected_work.h"
#include "layer/commands/trials.h"
#include "layer/objects/device_objects.h"

namespace vellum::layer
{

struct DeviceCommands {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceObjects &objects;
    InjectedPipelines injected{};
    Complaints complaints{};
    CommandStates states{};
    HandleMap<VkDeferredOperationKHR, std::shared_ptr<DeferredOperation>> deferredOperations{};
    TrialQueue trials{}; // the last one: what is still running may use the others
};

} // namespace vellum::layer
