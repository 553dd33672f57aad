// Who carries out what the commands of structure_commands.h have checked. There are two back ends: the layer's own
// micromaps (emulated_backend.h), and a driver's VK_EXT_opacity_micromap (khr_over_ext/ext_backend.h).
#pragma once

#include <memory>
#include <vector>

#include "layer/micromaps/micromap_input.h"
#include "layer/structures/structure_input.h"

namespace vellum::layer
{

class InjectedWork;

class Backend
{
public:
    Backend() = default;
    virtual ~Backend() = default;
    Backend(const Backend &) = delete;
    Backend &operator=(const Backend &) = delete;

    // At the begin of each recorded command. False, after a message: it cannot be recorded.
    virtual bool begin(VkCommandBuffer commandBuffer, const char *command) = 0;

    // --- micromaps of VK_KHR_opacity_micromap ---
    [[nodiscard]] virtual const MicromapLimits *limits() const = 0; // null: there are none
    [[nodiscard]] virtual MicromapBuildSizes sizes(const MicromapBuild &build) const = 0;
    virtual void record(VkCommandBuffer commandBuffer, const char *command, std::vector<MicromapBuild> builds) = 0;
    // What the addresses of micromaps are multiples of.
    [[nodiscard]] virtual uint32_t micromapAlignment() const = 0;
    // Whether a micromap can be at `range`; reports why not.
    [[nodiscard]] virtual bool checkMicromap(const InputCheck &check, const BufferRange &range) const = 0;
    // Makes what a micromap needs of the driver. False: out of memory.
    virtual bool createMicromap(AccelerationStructure &micromap) = 0;

    // --- other structures ---
    virtual void created(const std::shared_ptr<AccelerationStructure> &structure) = 0;
    virtual void addressTaken(AccelerationStructure &structure) = 0;
    // `primitives`: the most of each geometry; may be null without geometries.
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
    // The handle that the driver knows what was recorded last by.
    virtual VkAccelerationStructureKHR driverHandle(AccelerationStructure &structure) = 0;
    // The driver's answer about a micromap.
    virtual void recordMicromapAnswer(VkCommandBuffer commandBuffer, const Property &property) = 0;
    // Makes the driver's answer the application's.
    virtual void recordCorrection(InjectedWork &work, const Property &property) = 0;

    // --- both ---
    // The size that the target of a clone needs at least, as far as the host knows.
    [[nodiscard]] virtual VkDeviceSize cloneBytes(const StructureCopy &copy) = 0;
    virtual void record(VkCommandBuffer commandBuffer, const StructureCopy &copy) = 0;
    virtual void recordSave(VkCommandBuffer commandBuffer, const SerializedCopy &copy) = 0;
    virtual void recordRestore(VkCommandBuffer commandBuffer, const SerializedCopy &copy) = 0;
    [[nodiscard]] virtual VkAccelerationStructureCompatibilityKHR
    compatibility(const VkAccelerationStructureVersionInfoKHR &info) = 0;
};

} // namespace vellum::layer
