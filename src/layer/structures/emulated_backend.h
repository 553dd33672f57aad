// The back end whose micromaps are the layer's own: the driver builds structures without them, and the layer adds the
// records that lead a shader from a hit to its micromap.
//
// A copy of a bottom-level structure is the driver's, and a shader adds the records behind it. A copy of a top-level
// structure is a build from the instances that the source keeps, so that it has slots of its own: it stays as it is
// when the source is built again or destroyed. What was built into the source is read on the GPU, when the copy
// executes: commands may be recorded in any order.
#pragma once

#include "layer/command_buffer/injected_work.h"
#include "layer/structures/backend.h"

namespace vellum::layer
{

struct DeviceStructures;
struct TopLevelLayout;

class EmulatedBackend : public Backend
{
public:
    explicit EmulatedBackend(DeviceStructures &device) : device_(device) {}

    bool begin(VkCommandBuffer commandBuffer, const char *command) override;

    [[nodiscard]] const MicromapLimits *limits() const override;
    [[nodiscard]] MicromapBuildSizes sizes(const MicromapBuild &build) const override;
    void record(VkCommandBuffer commandBuffer, const char *command, std::vector<MicromapBuild> builds) override;
    [[nodiscard]] uint32_t micromapAlignment() const override { return 16; } // shaders read and write 16 bytes at once
    [[nodiscard]] bool checkMicromap(const InputCheck &, const BufferRange &) const override { return true; }
    bool createMicromap(AccelerationStructure &) override { return true; }

    void created(const std::shared_ptr<AccelerationStructure> &structure) override;
    void addressTaken(AccelerationStructure &structure) override;
    void getSizes(VkAccelerationStructureBuildTypeKHR type, StructureBuild &build, const uint32_t *primitives,
                  VkAccelerationStructureBuildSizesInfoKHR &sizes) override;
    // structure_build.cpp
    void record(VkCommandBuffer commandBuffer, const char *command, std::vector<StructureBuild> builds) override;

    VkAccelerationStructureKHR driverHandle(AccelerationStructure &structure) override;
    void recordMicromapAnswer(VkCommandBuffer, const Property &) override {}
    // structure_size.cpp
    void recordCorrection(InjectedWork &work, const Property &property) override;

    // structure_copy.cpp
    [[nodiscard]] VkDeviceSize cloneBytes(const StructureCopy &copy) override;
    void record(VkCommandBuffer commandBuffer, const StructureCopy &copy) override;
    // structure_serialize.cpp
    void recordSave(VkCommandBuffer commandBuffer, const SerializedCopy &copy) override;
    [[nodiscard]] VkAccelerationStructureCompatibilityKHR
    compatibility(const VkAccelerationStructureVersionInfoKHR &info) override;
    // structure_restore.cpp
    void recordRestore(VkCommandBuffer commandBuffer, const SerializedCopy &copy) override;

private:
    DeviceStructures &device_;
};

// Invocations of injected work that runs over a whole structure: enough to keep a GPU busy, few for a small one.
uint64_t copyInvocations(VkDeviceSize bytes);

// Builds `target` from the instances that the descriptor at `source` leads to, of which there are at most `most`.
// `from`: kFromStructure or kFromSerialized (core/push.h). False, after a message: nothing was recorded.
bool recordTopLevelCopy(InjectedWork &work, DeviceStructures &device, VkCommandBuffer commandBuffer,
                        const char *command, AccelerationStructure &target, VkDeviceAddress source,
                        const TopLevelLayout &layout, uint32_t from);

} // namespace vellum::layer
