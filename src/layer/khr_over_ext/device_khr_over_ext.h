// SPDX-License-Identifier: Apache-2.0
// The subsystem khr_over_ext on a device: it translates VK_KHR_opacity_micromap for a driver that has only
// VK_EXT_opacity_micromap. Micromaps are the driver's. Devices that enable VK_KHR_opacity_micromap on such a driver use
// this subsystem in place of emulation.
#pragma once

#include "layer/query_pool/device_query_pools.h"

namespace vellum::layer
{

struct DeviceKhrOverExt {
    Driver &driver;
    DeviceBuffers &buffers;
    DeviceState &objects;
    DeviceCommandBuffers &commands;
    DeviceQueryPools &queries;
};

// The back end of the driver's micromaps: each command of VK_KHR_opacity_micromap is translated to
// VK_EXT_opacity_micromap.
class ExtBackend : public Backend
{
public:
    ExtBackend(DeviceKhrOverExt &device, const MicromapLimits &limits) : device_(device), limits_(limits) {}

    bool begin(VkCommandBuffer commandBuffer, const char *command) override;

    [[nodiscard]] MicromapSupport support() const override;
    // ext_builds.cpp
    [[nodiscard]] std::optional<input::BuildNeeds> needs(const input::MicromapBuild &build) const override;
    void record(VkCommandBuffer commandBuffer, const char *command, std::vector<MicromapBuild> builds) override;
    [[nodiscard]] bool placesMicromap(VkBuffer buffer, VkDeviceSize offset, VkDeviceAddress address) const override;
    bool createMicromap(AccelerationStructure &micromap) override;

    void created(const std::shared_ptr<AccelerationStructure> &) override {}
    void addressTaken(AccelerationStructure &) override {}
    // ext_builds.cpp
    void getSizes(VkAccelerationStructureBuildTypeKHR type, StructureBuild &build, const uint32_t *primitives,
                  VkAccelerationStructureBuildSizesInfoKHR &sizes) override;
    void record(VkCommandBuffer commandBuffer, const char *command, std::vector<StructureBuild> builds) override;

    VkAccelerationStructureKHR driverHandle(AccelerationStructure &structure) override { return structure.handle; }
    void recordMicromapAnswer(VkCommandBuffer commandBuffer, const Property &property) override;
    void recordCorrections(VkCommandBuffer commandBuffer, InjectedWork &work,
                           std::span<const Property> properties) override;

    [[nodiscard]] VkDeviceSize cloneBytes(const StructureCopy &copy) override;
    void record(VkCommandBuffer commandBuffer, const StructureCopy &copy) override;
    void recordSave(VkCommandBuffer commandBuffer, const SerializedCopy &copy) override;
    void recordRestore(VkCommandBuffer commandBuffer, const SerializedCopy &copy) override;
    [[nodiscard]] VkAccelerationStructureCompatibilityKHR
    compatibility(const VkAccelerationStructureVersionInfoKHR &info) override;

private:
    DeviceKhrOverExt &device_;
    MicromapLimits limits_; // the driver's
};

} // namespace vellum::layer
