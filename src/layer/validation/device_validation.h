// SPDX-License-Identifier: Apache-2.0
// The validation subsystem: with the setting `validate`, it checks the rules of the extensions between the application
// and whoever implements micromaps, this layer or the driver. It is put together like a layer of its own: it knows the
// implementation only by its commands, keeps its own state of the application's objects, and changes nothing that the
// application can see. Where the setting is off, nothing here exists.
#pragma once

#include <atomic>

#include "layer/command_buffer/device_command_buffers.h"
#include "layer/validation/command_log.h"
#include "layer/validation/gpu/gpu_checks.h"
#include "layer/validation/objects.h"
#include "layer/validation/place.h"
#include "layer/validation/ranges/device_facts.h"
#include "layer/validation/ranges/image_copies.h"
#include "layer/validation/rules/pipeline_rules.h"
#include "layer/validation/sync/device_sync.h"
#include "layer/validation/traces/traced_code.h"

namespace vellum::layer
{

// The limits of the micromaps of one extension.
struct MicromapRuleLimits {
    uint32_t twoStateLevel = 0;
    uint32_t fourStateLevel = 0;
    uint32_t lossyLevel = 0;    // VK_KHR_opacity_micromap
    uint64_t mostTriangles = 0; // VK_KHR_opacity_micromap
};

// The limits of a physical device, as the application sees them. 0: unknown.
struct RuleLimits {
    MicromapRuleLimits ext{};
    MicromapRuleLimits khr{};
    uint32_t scratchAlignment = 0;
};

struct DeviceValidation {
    ~DeviceValidation()
    {
        reportCompleted(*this, true);
        gpu.pending.clear(); // what they hold is given back to `traces`
    }

    // The implementation as a driver: `driver.next` holds its commands.
    Driver driver;
    const DeviceTable &next = driver.next;
    Checks checks{};
    RuleLimits limits{};
    DeviceFacts facts{};

    // The subsystems below, once more: for validation's own work on the GPU.
    DeviceBuffers buffers{driver};
    DeviceState state{driver, buffers};
    DeviceCommandBuffers commands{driver, buffers, state};

    GpuChecks gpu{};
    DeviceTraces traces{buffers};
    ValidatedObjects objects{};
    HandleMap<VkImage, std::shared_ptr<const ValidatedImage>> images{};
    ValidatedPipelines pipelines{};
    CommandLogs logs{};
    DeviceSync sync{};
    std::atomic<uint64_t> numbers{0}; // of structures

    // Reports the violation of a rule. `vuid`: as the specification names it; for a rule without one, an
    // id of Vellum. `text`: what was found, what is expected.
    void fault(const Place &place, const char *vuid, const std::string &text, ObjectHandle object = {})
    {
        fault(place.text(), vuid, text, object);
    }
    // The same for a place whose text was kept: for faults that show when a command buffer is submitted.
    void fault(const std::string &place, const char *vuid, const std::string &text, ObjectHandle object = {});
    // How messages name an object: its name in quotes, if it has one, and its handle.
    [[nodiscard]] std::string nameOf(ObjectHandle object) const;
};

// Makes the validation of a device that was created. `implementation`: the functions of the device without validation.
// Null, after a message, without memory.
std::unique_ptr<DeviceValidation> createValidation(const Driver &driver, const RuleLimits &limits,
                                                   PFN_vkGetDeviceProcAddr implementation,
                                                   std::shared_ptr<const std::vector<uint32_t>> queueFamilies);

} // namespace vellum::layer
