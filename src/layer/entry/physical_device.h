// SPDX-License-Identifier: Apache-2.0
// The layer's facts about a physical device. They are found once for each instance, when a command first needs them.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/micromaps/micromap_input.h"

namespace vellum::layer
{

struct Instance;

enum class Implementation {
    None,        // the device cannot have it
    PassThrough, // the driver has it
    Emulation,   // the layer provides it
    Translation, // the layer provides it by another extension of the driver: KHR by EXT
};

// Who implements each extension on a device.
struct Implementations {
    Implementation ext = Implementation::None;             // VK_EXT_opacity_micromap
    Implementation khr = Implementation::None;             // VK_KHR_opacity_micromap
    Implementation addressCommands = Implementation::None; // VK_KHR_device_address_commands
    Implementation pipelines = Implementation::None;       // VK_ARM_pipeline_opacity_micromap

    // By the name of the extension; None for any other.
    [[nodiscard]] Implementation of(const char *extension) const;
    [[nodiscard]] bool anyEmulated() const;
    // Returns whether all devices of the physical device have the layer's shader module identifiers: there is one
    // algorithm.
    [[nodiscard]] bool mixesIdentifiers() const { return anyEmulated() && khr != Implementation::Translation; }
};
// Returns whether the layer provides the extension.
constexpr bool isProvided(Implementation implementation)
{
    return implementation == Implementation::Emulation || implementation == Implementation::Translation;
}

// The extensions that the layer provides.
struct ProvidedExtension {
    const char *name;
    uint32_t version;
    Implementation Implementations::*implementation;
    // The structure of its features. The first one is supported by every driver with the extension.
    VkStructureType features;
};
inline constexpr ProvidedExtension kProvidedExtensions[] = {
    {VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME, VK_EXT_OPACITY_MICROMAP_SPEC_VERSION, &Implementations::ext,
     VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT},
    {VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME, VK_KHR_OPACITY_MICROMAP_SPEC_VERSION, &Implementations::khr,
     VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_KHR},
    {VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME, VK_KHR_DEVICE_ADDRESS_COMMANDS_SPEC_VERSION,
     &Implementations::addressCommands, VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DEVICE_ADDRESS_COMMANDS_FEATURES_KHR},
    {VK_ARM_PIPELINE_OPACITY_MICROMAP_EXTENSION_NAME, 1, &Implementations::pipelines,
     VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_OPACITY_MICROMAP_FEATURES_ARM},
};

struct PhysicalDevice {
    VkResult listed = VK_SUCCESS;                  // of the driver's list of extensions; on failure all else is unknown
    std::vector<VkExtensionProperties> extensions; // of the driver
    Implementations have;

    // The rest is found only where the layer can provide something.
    bool replaysAddresses = false; // bufferDeviceAddressCaptureReplay: buffers can get their earlier addresses again
    bool isCpu = false;
    bool isLavapipeBefore26 = false;
    uint32_t maxPushConstantsSize = 0;
    std::array<uint8_t, VK_UUID_SIZE> driverUuid{};
    std::array<uint8_t, VK_UUID_SIZE> deviceUuid{};
    std::array<uint8_t, VK_UUID_SIZE> pipelineCacheUuid{};
    // Buffers can be created on host memory (VK_EXT_external_memory_host), and on a CPU their device addresses may be
    // the host addresses.
    bool importsHostMemory = false;
    MicromapLimits extLimits{}; // of the driver's VK_EXT_opacity_micromap, where KHR is translated to it
    VkPhysicalDeviceMemoryProperties memory{};
    std::vector<VkQueueFamilyProperties> queueFamilies;
};

// Never null.
std::shared_ptr<const PhysicalDevice> describe(Instance &instance, VkPhysicalDevice handle);

} // namespace vellum::layer
