// SPDX-License-Identifier: Apache-2.0
// The validation subsystem: with the setting `validate`, it checks the rules of the extensions between the application
// and whoever implements micromaps, this layer or the driver. It is put together like a layer of its own: it knows the
// implementation only by its commands, keeps its own state of the application's objects, and changes nothing that the
// application can see. Where the setting is off, nothing here exists.
#pragma once

#include "layer/validation/gpu/gpu_checks.h"
#include "layer/validation/model/device_model.h"
#include "layer/validation/sync/sync_checks.h"
#include "layer/validation/traces/trace_checks.h"

namespace vellum::layer
{

// The model, and the checks on it that have a state of their own.
struct DeviceValidation : DeviceModel {
    ~DeviceValidation();

    // Returns which batches of submissions may still be executed.
    [[nodiscard]] PendingTraces::IsPending pendingBatches() const
    {
        return [this](VkQueue queue, uint64_t batch) { return sync.tracker.isPending(uint64_t(queue), batch); };
    }

    GpuChecks gpu{*this};
    DeviceTraces traces{*this};
    DeviceSync sync{*this};
};

// The limits of a physical device, as the application sees them.
struct RuleLimits {
    MicromapLimits ext{}, khr{};
    uint32_t scratchAlignment = 0; // 0: unknown
};
// Makes the validation of a device that was created. `rules`: as the implementation has them. `implementation`: the
// functions of the device without validation. Null, after a message, without memory.
std::unique_ptr<DeviceValidation> createValidation(const Driver &driver, const RuleDevice &rules,
                                                   const RuleLimits &limits, PFN_vkGetDeviceProcAddr implementation,
                                                   std::shared_ptr<const std::vector<uint32_t>> queueFamilies);
// The device is destroyed: reports objects that the application should have destroyed before.
void reportLeaks(const DeviceModel &device);
// Reports everything that is certain now: findings, checks that wait for the device, marks of shaders. `idle`: the
// device executes nothing.
void reportCompleted(DeviceValidation &device, bool idle);

} // namespace vellum::layer
