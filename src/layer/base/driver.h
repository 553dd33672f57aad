// SPDX-License-Identifier: Apache-2.0
// The base: what every other subsystem uses, and what does not depend on micromaps. Dispatch tables, pNext chains,
// settings, messages, newer Vulkan declarations, and the driver of a device.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include <vulkan/vulkan.h>

#include "layer/base/dispatch.h"
#include "layer/base/report.h"
#include "layer/base/settings.h"

namespace vellum::layer
{

bool enablesExtension(const VkDeviceCreateInfo &info, const char *extension);
// Returns whether the device consists of several physical devices.
bool isGroup(const VkDeviceCreateInfo &info);

// The features that the application enabled on a device that depends on the layer.
struct EnabledFeatures {
    bool ext = false;             // VK_EXT_opacity_micromap
    bool khr = false;             // VK_KHR_opacity_micromap
    bool addressCommands = false; // VK_KHR_device_address_commands
    bool extFeature = false;      // VkPhysicalDeviceOpacityMicromapFeaturesEXT::micromap
    bool khrFeature = false;      // VkPhysicalDeviceOpacityMicromapFeaturesKHR::micromap
    bool captureReplay = false;
    bool hostCommands = false;
    bool bufferAddresses = false; // VkPhysicalDeviceBufferDeviceAddressFeatures::bufferDeviceAddress
    bool structures = false;      // VkPhysicalDeviceAccelerationStructureFeaturesKHR::accelerationStructure
    bool rayQueries = false;      // VkPhysicalDeviceRayQueryFeaturesKHR::rayQuery
    bool rayTracingPipelines = false;
    bool pipelineMicromaps = false; // VK_ARM_pipeline_opacity_micromap
    bool descriptorHeaps = false;   // VkPhysicalDeviceDescriptorHeapFeaturesEXT::descriptorHeap
    bool otherStructures = false;   // an extension that may build acceleration structures by commands of its own

    [[nodiscard]] bool any() const { return ext || khr || addressCommands || pipelineMicromaps; }
    [[nodiscard]] bool anyFeature() const { return extFeature || khrFeature; }
    // With VK_EXT_opacity_micromap every ray query uses micromaps; otherwise those with the execution mode.
    [[nodiscard]] bool everyQueryUsesMicromaps() const { return ext; }
};

// The implementation of micromaps on a device.
enum class Mode {
    PassThrough, // nothing, except by assume_micromaps: commands go to the next layer
    Identifiers, // the same, but shader module identifiers are those that emulated devices have
    Emulated,    // the layer provides micromaps
    KhrOverExt,  // the driver provides VK_EXT_opacity_micromap, and the layer translates VK_KHR_opacity_micromap to it
};

// A device of the next layer or the driver.
struct Driver {
    VkDevice handle = VK_NULL_HANDLE;
    uint64_t number = 0; // unique in this process: unlike handles, numbers are not used again
    VkPhysicalDevice physicalDevice = VK_NULL_HANDLE;
    const InstanceTable *instance = nullptr;
    const Settings *settings = nullptr;
    Reporter *reporter = nullptr;
    DeviceTable next;

    Mode mode = Mode::PassThrough;
    EnabledFeatures enabled;
    bool ownAddressCommands = false;   // VK_KHR_device_address_commands is enabled, and the layer provides it
    bool nullIndexBuffer = false;      // VK_NULL_HANDLE may be bound as index buffer
    bool queriesStructureSize = false; // VK_KHR_ray_tracing_maintenance1 is enabled
    std::array<uint8_t, VK_UUID_SIZE> driverUuid{};
    // Lavapipe before Mesa 26: a build clears the whole range of the handle, and a copy copies that many bytes,
    // although what follows the structure in memory may belong to other objects (structures/exact_size_handle.h).
    bool clearsWholeHandles = false;
    // Lavapipe before Mesa 26: in a pipeline made of libraries only, rays see the push constants of the last dispatch
    // instead of those that are set. So the last dispatch has to have the application's.
    bool keepsOldPushConstants = false;
    uint32_t pushBytes = 128; // of the push constants of injected work; 128 is the least maxPushConstantsSize
    uint32_t threads = 0;     // of a CPU implementation; 0 for GPUs

    [[nodiscard]] bool emulated() const { return mode == Mode::Emulated; }
    [[nodiscard]] bool translated() const { return mode == Mode::KhrOverExt; }
    [[nodiscard]] bool providesMicromaps() const { return emulated() || translated(); }
    // The setting assume_micromaps counts on this device.
    [[nodiscard]] bool assumesMicromaps() const { return settings->assumeMicromaps && enabled.anyFeature(); }
    [[nodiscard]] Reporter &report() const { return *reporter; }
    [[nodiscard]] VkDeviceAddress bufferAddress(VkBuffer buffer) const;
    // The reference by which instances name a bottom-level structure.
    [[nodiscard]] VkDeviceAddress structureAddress(VkAccelerationStructureKHR structure) const;
};

} // namespace vellum::layer
