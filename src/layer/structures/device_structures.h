// SPDX-License-Identifier: Apache-2.0
// The subsystem of acceleration structures on a device: creation, sizes, builds, copies and serialization, with the
// records that lead from a hit to its micromap.
#pragma once

#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/memory/gpu_memory.h"
#include "layer/micromaps/device_micromaps.h"
#include "layer/micromaps/micromap_input.h"
#include "layer/structures/structure_input.h"

namespace vellum::layer
{

class InjectedWork;
struct DeviceStructures;

// Serialized data, beginning with the driver's UUIDs. The driver gets it in place of data that it must not see.
struct FallbackStructure {
    std::mutex mutex;    // held while it is made: every user needs the result
    bool probed = false; // the probe was carried out, with whatever result
    GpuBuffer memory;
    uint32_t units = 0;              // of 16 bytes; 0: the driver could not serialize it
    VkDeviceSize structureBytes = 0; // of the structure that it is deserialized to
    // The driver serializes and deserializes as many bytes as the structure was created with.
    bool wholeCopies = false;
};

// A snapshot of what is known of the fallback: a repeated probe may add to it.
struct FallbackFacts {
    VkDeviceAddress address = 0;     // of its bytes, which the host sees as `words`; 0 without a fallback
    const uint32_t *words = nullptr; // lives as long as the device
    uint32_t units = 0;
    VkDeviceSize structureBytes = 0;
    bool wholeCopies = false;
};

// Returns no fallback if the application did not enable acceleration structures, or has no queue that can build them.
FallbackFacts fallbackStructure(DeviceStructures &device);

// A back end records the builds and copies that structure_commands.cpp has checked. There are two: emulated micromaps
// (emulated_backend.h), and VK_KHR_opacity_micromap on a driver's VK_EXT_opacity_micromap
// (khr_over_ext/device_khr_over_ext.h).
class Backend
{
public:
    Backend() = default;
    virtual ~Backend() = default;
    Backend(const Backend &) = delete;
    Backend &operator=(const Backend &) = delete;

    // Called first for each recorded command. False, after a message: the command cannot be recorded.
    virtual bool begin(VkCommandBuffer commandBuffer, const char *command) = 0;

    // --- micromaps of VK_KHR_opacity_micromap ---
    [[nodiscard]] virtual MicromapSupport support() const = 0;
    [[nodiscard]] virtual std::optional<input::BuildNeeds> needs(const input::MicromapBuild &build) const = 0;
    virtual void record(VkCommandBuffer commandBuffer, const char *command, std::vector<MicromapBuild> builds) = 0;
    // Returns whether a micromap can be created there (RuleDevice::placesMicromap).
    [[nodiscard]] virtual bool placesMicromap(VkBuffer buffer, VkDeviceSize offset, VkDeviceAddress address) const = 0;
    // Creates the driver's objects for a micromap. False: out of memory.
    virtual bool createMicromap(AccelerationStructure &micromap) = 0;

    // --- other structures ---
    virtual void created(const std::shared_ptr<AccelerationStructure> &structure) = 0;
    virtual void addressTaken(AccelerationStructure &structure) = 0;
    // `primitives`: the maximum of each geometry; may be null without geometries.
    virtual void getSizes(VkAccelerationStructureBuildTypeKHR type, StructureBuild &build, const uint32_t *primitives,
                          VkAccelerationStructureBuildSizesInfoKHR &sizes) = 0;
    virtual void record(VkCommandBuffer commandBuffer, const char *command, std::vector<StructureBuild> builds) = 0;

    // --- properties, written to a 64-bit number that shaders can access ---
    struct Property {
        VkQueryType type;
        AccelerationStructure &structure;
        bool micromap;
        VkBuffer buffer; // of the number
        VkDeviceSize offset;
        VkDeviceAddress address;
        VkQueryPool micromapPool; // a driver's pool of the same property of micromaps, and a query in it
        uint32_t query;
    };
    // The driver's handle for what was recorded last.
    virtual VkAccelerationStructureKHR driverHandle(AccelerationStructure &structure) = 0;
    // Records the driver's answer about a micromap.
    virtual void recordMicromapAnswer(VkCommandBuffer commandBuffer, const Property &property) = 0;
    // Records the corrections of the driver's answers.
    virtual void recordCorrections(VkCommandBuffer commandBuffer, InjectedWork &work,
                                   std::span<const Property> properties) = 0;

    // --- both ---
    // The least size of the target of a clone, as far as the host knows.
    [[nodiscard]] virtual VkDeviceSize cloneBytes(const StructureCopy &copy) = 0;
    virtual void record(VkCommandBuffer commandBuffer, const StructureCopy &copy) = 0;
    virtual void recordSave(VkCommandBuffer commandBuffer, const SerializedCopy &copy) = 0;
    virtual void recordRestore(VkCommandBuffer commandBuffer, const SerializedCopy &copy) = 0;
    [[nodiscard]] virtual VkAccelerationStructureCompatibilityKHR
    compatibility(const VkAccelerationStructureVersionInfoKHR &info) = 0;
};

struct DeviceStructures {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceState &objects;
    DeviceCommandBuffers &commands;
    DeviceMicromaps &micromaps;
    FallbackStructure fallback{};
    std::unique_ptr<Backend>
        backend{}; // set when the device is created; null on devices whose micromaps the layer leaves to the driver
};

} // namespace vellum::layer
