// SPDX-License-Identifier: Apache-2.0
// Builds and copies of acceleration structures, parsed from the application's structures and checked. Nothing after
// this reads those structures.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <unordered_set>
#include <vector>

#include "layer/base/input_check.h"
#include "layer/base/pnext.h"
#include "layer/state/device_state.h"
#include "vk/newer.h"

namespace vellum::layer
{

// A geometry's micromap, parsed from the structure of either extension.
struct MicromapAttachment {
    VkIndexType indexType = VK_INDEX_TYPE_NONE_KHR;
    VkDeviceAddress indexBuffer = 0;
    VkDeviceSize indexStride = 0;
    uint32_t baseTriangle = 0;
    VkMicromapEXT ext = VK_NULL_HANDLE;              // of VkAccelerationStructureTrianglesOpacityMicromapEXT
    VkAccelerationStructureKHR khr = VK_NULL_HANDLE; // of VkAccelerationStructureTrianglesOpacityMicromapKHR
    // Set by the check; null for a null handle.
    Micromap micromap;
    std::shared_ptr<AccelerationStructure> structure; // of `khr`
};

// The properties of a geometry that the driver does not get.
struct GeometryInput {
    bool opaque = false;
    std::optional<MicromapAttachment> micromap;
    std::optional<Chain> chain; // the driver's pNext chain, if there is a micromap
};

// The ranges of one build, direct or indirect.
struct BuildRanges {
    const VkAccelerationStructureBuildRangeInfoKHR *direct = nullptr; // of each geometry
    VkDeviceAddress indirect = 0; // of the first geometry's range; the others follow, `stride` bytes apart
    uint32_t stride = 0;
    const uint32_t *most = nullptr; // maximum of primitives of each geometry, for an indirect build

    // The maximum of primitives of geometry g.
    [[nodiscard]] uint32_t primitives(uint32_t g) const { return direct ? direct[g].primitiveCount : most[g]; }
    // Address of geometry g's range; 0 for a direct build.
    [[nodiscard]] VkDeviceAddress address(uint32_t g) const { return direct ? 0 : indirect + uint64_t{g} * stride; }
};

// The build of a structure that is not a micromap.
struct StructureBuild {
    uint32_t element = 0;                                       // of pInfos
    std::vector<VkAccelerationStructureGeometryKHR> geometries; // the driver's: without micromaps
    std::vector<GeometryInput> inputs;                          // of each geometry
    bool topLevel = false;
    bool hasMicromaps = false;
    bool hasBoxes = false;
    BuildRanges ranges;
    // Set by the check. `source`: of an update.
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

// nullopt, after a message, if the build contains something that no driver may get.
std::optional<StructureBuild> parseStructureBuild(const Driver &driver, const InputCheck &check,
                                                  const VkAccelerationStructureBuildGeometryInfoKHR &info);
// Finds the structures that a build names, and checks them. `built`: micromaps that the same command builds.
using MicromapSet = std::unordered_set<VkAccelerationStructureKHR>;
bool checkStructureBuild(const DeviceState &objects, const InputCheck &check, const MicromapSet &built,
                         StructureBuild &build);

struct StructureCopy {
    std::shared_ptr<AccelerationStructure> source, target;
    bool compact = false; // otherwise a clone
    // Of the copied content. GENERIC only if micromaps are the driver's, and the content is not a micromap.
    VkAccelerationStructureTypeKHR type = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR;
    [[nodiscard]] bool isMicromap() const { return type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR; }
};
std::optional<StructureCopy> parseStructureCopy(const DeviceState &objects, const char *command,
                                                const VkCopyAccelerationStructureInfoKHR &info);

// To or from serialized data.
struct SerializedCopy {
    std::shared_ptr<AccelerationStructure> structure;
    VkDeviceAddress data = 0;
    VkAccelerationStructureTypeKHR content = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR; // of the source
};
std::optional<SerializedCopy> parseSave(const DeviceState &objects, const char *command,
                                        const VkCopyAccelerationStructureToMemoryInfoKHR &info);
std::optional<SerializedCopy> parseRestore(const DeviceState &objects, const char *command,
                                           const VkCopyMemoryToAccelerationStructureInfoKHR &info);

// The check of a command's input, whose messages name a structure.
inline InputCheck inputCheck(const Driver &driver, const char *command, VkAccelerationStructureKHR structure,
                             std::optional<uint32_t> element = std::nullopt)
{
    return {driver.report(), command, VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR, reinterpret_cast<uint64_t>(structure),
            element};
}

} // namespace vellum::layer
