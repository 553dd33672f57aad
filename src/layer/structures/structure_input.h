// SPDX-License-Identifier: Apache-2.0
// Builds and copies of acceleration structures, as the back ends record them.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/base/pnext.h"
#include "layer/input/builds.h"
#include "layer/rules/ids.h"
#include "layer/state/device_state.h"
#include "vk/newer.h"

namespace vellum::layer
{

// A geometry's micromap.
struct MicromapAttachment {
    input::Attachment given;
    // Null for a null handle, and in queries of sizes.
    Micromap micromap;
    std::shared_ptr<AccelerationStructure> structure; // of VK_KHR_opacity_micromap
};

// The properties of a geometry that the driver does not get.
struct GeometryInput {
    bool opaque = false;
    std::optional<MicromapAttachment> micromap;
    std::optional<Chain> chain; // the driver's pNext chain, if there is a micromap
};

// The build of a structure that is not a micromap, made of an accepted input.
struct StructureBuild {
    uint32_t element = 0;                                       // of pInfos
    std::vector<VkAccelerationStructureGeometryKHR> geometries; // the driver's: without micromaps
    std::vector<GeometryInput> inputs;                          // of each geometry
    bool topLevel = false;
    bool hasMicromaps = false;
    bool hasBoxes = false;
    input::BuildRanges ranges;
    // Null in queries of sizes. `source`: of an update.
    std::shared_ptr<AccelerationStructure> target, source;

    [[nodiscard]] VkAccelerationStructureTypeKHR type() const
    {
        return topLevel ? VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR
                        : VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
    }
    [[nodiscard]] uint32_t geometryCount() const { return static_cast<uint32_t>(geometries.size()); }
    // The maximum of primitives of each geometry.
    [[nodiscard]] std::vector<uint32_t> primitives() const;
    // The build for the driver; it points into this object.
    [[nodiscard]] const VkAccelerationStructureBuildGeometryInfoKHR &driverInfo();

    VkAccelerationStructureBuildGeometryInfoKHR info{}; // with the driver's handles, flags and mode
};

// The build without its structures.
StructureBuild structureBuildOf(const Driver &driver, const input::StructureBuild &given);
// Finds its structures. False: they do not exist any more.
bool findStructures(const DeviceState &objects, StructureBuild &build);

// An acceleration structure, as rules see it.
ObjectFacts structureFacts(const DeviceState &objects, ObjectHandle handle);

// The functions that make these check the input, and report what no back end can copy.
struct StructureCopy {
    std::shared_ptr<AccelerationStructure> source, target;
    bool compact = false; // otherwise a clone
    // The type of the copied content. GENERIC only if micromaps are the driver's, and the content is not a micromap.
    VkAccelerationStructureTypeKHR type = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    [[nodiscard]] bool isMicromap() const { return type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR; }
};
std::optional<StructureCopy> structureCopyOf(const DeviceState &objects, const char *command,
                                             const VkCopyAccelerationStructureInfoKHR &info);

// A copy to or from serialized data.
struct SerializedCopy {
    std::shared_ptr<AccelerationStructure> structure;
    VkDeviceAddress data = 0;
    VkAccelerationStructureTypeKHR content = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR; // of the source
};
std::optional<SerializedCopy> saveOf(const DeviceState &objects, const char *command,
                                     const VkCopyAccelerationStructureToMemoryInfoKHR &info);
std::optional<SerializedCopy> restoreOf(const DeviceState &objects, const char *command,
                                        const VkCopyMemoryToAccelerationStructureInfoKHR &info);

// Reports an error of a command, about a structure. Returns false, so that callers can write return rejectCommand(...).
// `element`: of pInfos.
inline bool rejectCommand(const Driver &driver, const char *command, VkAccelerationStructureKHR structure,
                          const char *id, const std::string &text, std::optional<uint32_t> element = std::nullopt)
{
    const std::string where = std::string(command) + (element ? ": pInfos[" + std::to_string(*element) + "]: " : ": ");
    driver.report().error(rules::ids::idAt(where, id), where + text, VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR,
                          reinterpret_cast<uint64_t>(structure));
    return false;
}

// The driver's builds of one command: direct builds by one call, indirect ones by another.
class DriverBuilds
{
public:
    // The pointers in `info` and `ranges` must stay valid until record().
    void add(const VkAccelerationStructureBuildGeometryInfoKHR &info, const input::BuildRanges &ranges);
    void record(const Driver &driver, VkCommandBuffer commandBuffer) const;

private:
    std::vector<VkAccelerationStructureBuildGeometryInfoKHR> direct_, indirect_;
    std::vector<const VkAccelerationStructureBuildRangeInfoKHR *> ranges_; // of direct_
    std::vector<VkDeviceAddress> addresses_;                               // of indirect_, as the next two
    std::vector<uint32_t> strides_;
    std::vector<const uint32_t *> most_;
};

} // namespace vellum::layer
