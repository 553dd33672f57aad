// SPDX-License-Identifier: Apache-2.0
// The back end of emulated micromaps: the driver builds structures without micromaps, and the layer adds the records
// that lead a shader from a hit to its micromap.
#pragma once

#include "layer/structures/device_structures.h"

namespace vellum::layer
{

struct TopLevelLayout;

class EmulatedBackend : public Backend
{
public:
    explicit EmulatedBackend(DeviceStructures &device) : device_(device) {}

    bool begin(VkCommandBuffer commandBuffer, const char *command) override;

    [[nodiscard]] MicromapSupport support() const override { return kEmulatedSupport; }
    [[nodiscard]] std::optional<input::BuildNeeds> needs(const input::MicromapBuild &build) const override
    {
        return emulatedNeeds(build);
    }
    void record(VkCommandBuffer commandBuffer, const char *command, std::vector<MicromapBuild> builds) override;
    // Shaders read and write 16 bytes at once.
    [[nodiscard]] bool placesMicromap(VkBuffer, VkDeviceSize offset, VkDeviceAddress address) const override
    {
        return (address != 0 ? address : offset) % 16 == 0;
    }
    bool createMicromap(AccelerationStructure &) override { return true; }

    void created(const std::shared_ptr<AccelerationStructure> &structure) override;
    void addressTaken(AccelerationStructure &structure) override;
    void getSizes(VkAccelerationStructureBuildTypeKHR type, StructureBuild &build, const uint32_t *primitives,
                  VkAccelerationStructureBuildSizesInfoKHR &sizes) override;
    // structure_build.cpp
    void record(VkCommandBuffer commandBuffer, const char *command, std::vector<StructureBuild> builds) override;

    VkAccelerationStructureKHR driverHandle(AccelerationStructure &structure) override;
    void recordMicromapAnswer(VkCommandBuffer, const Property &) override {}
    void recordCorrections(VkCommandBuffer commandBuffer, InjectedWork &work,
                           std::span<const Property> properties) override;

    // structure_copy.cpp
    [[nodiscard]] VkDeviceSize cloneBytes(const StructureCopy &copy) override;
    void record(VkCommandBuffer commandBuffer, const StructureCopy &copy) override;
    // structure_serialize.cpp
    void recordSave(VkCommandBuffer commandBuffer, const SerializedCopy &copy) override;
    [[nodiscard]] VkAccelerationStructureCompatibilityKHR
    compatibility(const VkAccelerationStructureVersionInfoKHR &info) override;
    void recordRestore(VkCommandBuffer commandBuffer, const SerializedCopy &copy) override;

private:
    DeviceStructures &device_;
};

// --- for structure_copy.cpp and structure_serialize.cpp ---
// Invocations of injected work that runs over a whole structure: enough to keep a GPU busy, few for a small one.
uint64_t copyInvocations(VkDeviceSize bytes);

// Builds `target` from the instances that the descriptor at `source` leads to.
// `from`: kFromStructure or kFromSerialized (core/push.h). False, after a message: nothing was recorded.
bool recordTopLevelCopy(InjectedWork &work, DeviceStructures &device, VkCommandBuffer commandBuffer,
                        const char *command, AccelerationStructure &target, VkDeviceAddress source,
                        const TopLevelLayout &layout, uint32_t from);

} // namespace vellum::layer
