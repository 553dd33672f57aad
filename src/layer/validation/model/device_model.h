// SPDX-License-Identifier: Apache-2.0
// The device as validation knows it: the implementation's commands, the limits and features that rules are about, the
// application's objects, and the logs of its command buffers. Checks read it and report to it.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/command_buffer/device_command_buffers.h"
#include "layer/rules/rule.h"
#include "layer/validation/model/command_log.h"
#include "layer/validation/model/objects.h"

namespace vellum::layer
{

struct Driver;

// The facts about a device that rules use: the features that the application enabled on it, and its limits.
struct DeviceFacts {
    // Enabled features, beyond those in EnabledFeatures.
    bool nullDescriptor = false;
    bool indexTypeUint8 = false;
    bool drawIndirectCount = false;
    bool synchronization2 = false;
    bool maintenance9 = false; // buffers need no ownership transfers
    bool maintenance11 = false;
    bool addressCommands = false; // of VK_KHR_device_address_commands
    bool structureCaptureReplay = false;
    bool addressMultiDevice = false;

    // The host may learn that work is complete by presentation, or by fences and semaphores of others.
    bool waitsElsewhere = false;
    bool isGroup = false;                 // of several physical devices
    VkShaderStageFlags storingStages = 0; // stages whose shaders may write to memory

    bool protectedNoFault = false;
    uint32_t maxVertexInputBindings = 0;
    uint32_t maxVertexInputBindingStride = 0;
    VkDeviceSize maxTransformFeedbackBufferSize = VK_WHOLE_SIZE;
    std::vector<VkQueueFlags> queueFamilies; // of the physical device
};

DeviceFacts factsOf(const Driver &driver, const VkDeviceCreateInfo &info);

struct DeviceModel {
    // The implementation as a driver: `driver.next` holds its commands.
    Driver driver;
    DeviceTable &next = driver.next;
    Checks checks{};               // `gpu` only where data on the GPU can be checked
    bool emulated = false;         // the implementation is the layer's emulation
    bool implementsRanges = false; // the layer implements VK_KHR_device_address_commands
    DeviceFacts facts{};

    // The subsystems below, once more: for validation's own work on the GPU.
    DeviceBuffers buffers{driver};
    DeviceCommandBuffers commands{driver, buffers, {}, CommandLogs::makeStates()};
    RuleDevice rules{driver, buffers.addresses}; // evaluated as `checks` states
    MemoryPool captureMemory{buffers.gpu, 16,
                             [](const GpuContext &) { return VkBufferUsageFlags{VK_BUFFER_USAGE_TRANSFER_DST_BIT}; },
                             GpuBuffer::Content::Undefined};
    StructureRecords records{}; // without the check `gpu` it has none

    // Reports the errors that the emulation's shaders have found, except those whose bit is set in `known` (one bit for
    // each kGpuError*). Null if micromaps are not emulated, or if the emulation reports these errors itself.
    std::function<void(uint32_t known)> reportGpuErrors{};

    ValidatedObjects objects{};
    CommandLogs logs{commands.states};
    std::atomic<uint64_t> numbers{0}; // of structures
    std::atomic<bool> hasCheckedBuild{false};

    // The check of a place, which must outlive it.
    [[nodiscard]] InputCheck at(const Place &place, ObjectHandle object = {}) const { return {rules, place, object}; }
    // A micromap or an acceleration structure, as rules see it. Where memory ran out, an unknown one may be any.
    [[nodiscard]] ObjectFacts factsOf(ObjectHandle handle) const;
    [[nodiscard]] std::string nameOf(ObjectHandle object) const { return rules.nameOf(object); }
};

} // namespace vellum::layer
