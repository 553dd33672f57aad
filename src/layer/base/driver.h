// The ground: what every other room stands on and what knows nothing of micromaps. Dispatch tables, pNext chains,
// settings, messages, newer Vulkan declarations, and the driver below a device.
#pragma once

#include <array>
#include <cstdint>

#include <vulkan/vulkan.h>

#include "layer/base/dispatch.h"
#include "layer/base/report.h"
#include "layer/base/settings.h"

namespace vellum::layer
{

// What the application enabled on an emulated or translated device.
struct EnabledFeatures {
    bool ext = false;             // VK_EXT_opacity_micromap
    bool khr = false;             // VK_KHR_opacity_micromap
    bool addressCommands = false; // VK_KHR_device_address_commands
    bool extFeature = false;      // VkPhysicalDeviceOpacityMicromapFeaturesEXT::micromap
    bool khrFeature = false;      // VkPhysicalDeviceOpacityMicromapFeaturesKHR::micromap
    bool captureReplay = false;
    bool hostCommands = false;
    bool structures = false; // VkPhysicalDeviceAccelerationStructureFeaturesKHR::accelerationStructure
    bool rayQueries = false; // VkPhysicalDeviceRayQueryFeaturesKHR::rayQuery
    bool rayTracingPipelines = false;
    bool pipelineMicromaps = false; // VK_ARM_pipeline_opacity_micromap

    [[nodiscard]] bool anyFeature() const { return extFeature || khrFeature; }
    // With VK_EXT_opacity_micromap every ray query uses micromaps; without it, those whose entry point asks for it.
    [[nodiscard]] bool everyQueryUsesMicromaps() const { return ext; }
};

// What the layer does on a device.
enum class Mode {
    PassThrough, // nothing: every command except vkDestroyDevice goes to the next layer
    Identifiers, // the same, but shader module identifiers are those that emulated devices have
    Emulated,    // the layer provides micromaps
    KhrOverExt,  // the driver provides VK_EXT_opacity_micromap, and the layer translates VK_KHR_opacity_micromap to it
};

// A device as the next layer or the driver made it.
struct Driver {
    VkDevice handle = VK_NULL_HANDLE;
    uint64_t number = 0; // of all devices of this process: unlike handles, numbers are not used again
    VkPhysicalDevice physicalDevice = VK_NULL_HANDLE;
    const InstanceTable *instance = nullptr;
    const Settings *settings = nullptr;
    Reporter *reporter = nullptr;
    DeviceTable next;

    Mode mode = Mode::PassThrough;
    EnabledFeatures enabled;
    bool ownAddressCommands = false;   // VK_KHR_device_address_commands is enabled, and the layer's
    bool nullIndexBuffer = false;      // VK_NULL_HANDLE may be bound as index buffer
    bool queriesStructureSize = false; // VK_KHR_ray_tracing_maintenance1 is enabled
    std::array<uint8_t, VK_UUID_SIZE> driverUuid{};
    // Lavapipe before Mesa 26: a build clears all that the handle reaches over, and a copy is one of that many bytes as
    // they are. What lies behind the structure is not the build's to write: structures/exact_size_handle.h.
    bool clearsWholeHandles = false;
    // The same: the rays of a pipeline that consists of libraries only see the push constants of the
    // last dispatch, not those that are set. They are to be the application's.
    bool keepsOldPushConstants = false;
    uint32_t threads = 0; // of a device that is a CPU; 0: it is none

    [[nodiscard]] bool emulated() const { return mode == Mode::Emulated; }
    [[nodiscard]] bool translated() const { return mode == Mode::KhrOverExt; }
    [[nodiscard]] Reporter &report() const { return *reporter; }
    [[nodiscard]] VkDeviceAddress bufferAddress(VkBuffer buffer) const;
    // The reference that instances name a bottom-level structure by.
    [[nodiscard]] VkDeviceAddress structureAddress(VkAccelerationStructureKHR structure) const;
};

} // namespace vellum::layer
