// SPDX-License-Identifier: Apache-2.0
// Builds of micromaps and acceleration structures, and queries of their sizes, as values: the structures of both
// extensions are parsed here, once for each command. Values refer to the application's arrays, and live as long as the
// command.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/input/objects.h"
#include "vk/newer.h"

namespace vellum::layer::input
{

// The usage counts of a micromap or an attachment.
class UsageCounts
{
public:
    UsageCounts() = default;
    UsageCounts(uint32_t count, const VkMicromapUsageEXT *counts, const VkMicromapUsageEXT *const *pointers)
        : count_(count), counts_(counts), pointers_(pointers)
    {
    }
    UsageCounts(uint32_t count, const VkMicromapUsageKHR *counts, const VkMicromapUsageKHR *const *pointers);

    [[nodiscard]] uint32_t size() const { return arrays() == 0 ? 0 : count_; }
    // A null pointer counts as no triangles.
    [[nodiscard]] const VkMicromapUsageEXT &operator[](uint32_t i) const
    {
        static constexpr VkMicromapUsageEXT kNone{0, 0, VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT};
        return counts_ ? counts_[i] : pointers_[i] ? *pointers_[i] : kNone;
    }
    // The number of arrays that are given; 1 if there are no counts.
    [[nodiscard]] uint32_t arrays() const
    {
        return count_ == 0 ? 1 : uint32_t{counts_ != nullptr} + uint32_t{pointers_ != nullptr};
    }
    [[nodiscard]] uint64_t triangles() const;
    // One for each level and format, unless their sum exceeds 32 bits: an application may give one for each triangle.
    [[nodiscard]] std::vector<VkMicromapUsageEXT> merged() const;

private:
    uint32_t count_ = 0;
    const VkMicromapUsageEXT *counts_ = nullptr;
    const VkMicromapUsageEXT *const *pointers_ = nullptr;
};

// The commands that build.
enum class BuildCommand : uint8_t { Micromaps, HostMicromaps, Structures, IndirectStructures };
const char *nameOf(BuildCommand command);

// Memory that a build on the device accesses by address: its input, and its scratch memory.
struct Access {
    enum class Of : uint8_t {
        Data,
        TriangleArray,
        Vertices,
        Indices,
        Transform,
        Boxes,
        Instances,
        MicromapIndices,
        Scratch,
    };
    Of of;
    VkDeviceAddress address; // as the build states it
    // What is certainly accessed, from the address on. Where in the data of a micromap and of triangles and boxes a
    // build reads is not looked up: these have one byte. Indirect builds may have no primitives: 0 bytes.
    VkDeviceSize offset, bytes;
    uint32_t geometry; // kNone: none
    static constexpr uint32_t kNone = UINT32_MAX;

    [[nodiscard]] VkDeviceAddress begin() const { return address + offset; }
};

// Bytes that a build of a micromap needs.
struct BuildNeeds {
    VkDeviceSize micromap = 0; // sizes as queries report them
    VkDeviceSize written = 0;  // at most; a smaller micromap would be overrun
    VkDeviceSize scratch = 0;
    bool discardable = false; // VkMicromapBuildSizesInfoEXT; false of every micromap that the layer implements
};

struct MicromapBuild {
    bool khr = false;            // by VK_KHR_opacity_micromap
    bool host = false;           // on the host
    uint32_t element = 0;        // of pInfos
    const void *given = nullptr; // VkMicromapBuildInfoEXT or VkAccelerationStructureBuildGeometryInfoKHR

    ObjectHandle target;
    VkFlags flags = 0;   // VkBuildMicromapFlagsEXT or VkBuildAccelerationStructureFlagsKHR
    bool isBuild = true; // the mode is BUILD
    UsageCounts usages;
    VkDeviceOrHostAddressConstKHR data{};
    VkDeviceOrHostAddressConstKHR triangles{};
    VkDeviceSize triangleStride = 0;
    VkDeviceOrHostAddressKHR scratch{};

    // VK_EXT_opacity_micromap
    VkMicromapTypeEXT type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT;
    VkStructureType sType = VK_STRUCTURE_TYPE_MICROMAP_BUILD_INFO_EXT;
    bool hasChain = false;

    // VK_KHR_opacity_micromap
    bool indirect = false;
    bool hasSource = false;
    bool hasRanges = false;
    uint32_t geometries = 1;
    bool twoArrays = false;                                       // of geometries
    const VkAccelerationStructureGeometryKHR *geometry = nullptr; // the first one
    bool hasData = false;                                         // of a micromap

    // Set by the check of the rules.
    BuildNeeds needs;
    bool accepted = true;         // the layer's implementation records it
    std::vector<Access> accesses; // set by validation
};

// The micromap that a geometry of triangles attaches by the structure of either extension.
struct Attachment {
    bool khr = false; // by that of VK_KHR_opacity_micromap
    VkIndexType indexType = VK_INDEX_TYPE_NONE_KHR;
    VkDeviceOrHostAddressConstKHR indexBuffer{};
    VkDeviceSize indexStride = 0;
    uint32_t baseTriangle = 0;
    ObjectHandle micromap; // 0 for a null handle
    UsageCounts usages;    // VK_EXT_opacity_micromap has them
};

struct Geometry {
    const VkAccelerationStructureGeometryKHR *given = nullptr; // null: a null pointer in an array of pointers
    std::optional<Attachment> attachment;

    [[nodiscard]] bool isTriangles() const { return given && given->geometryType == VK_GEOMETRY_TYPE_TRIANGLES_KHR; }
    [[nodiscard]] bool isInstances() const { return given && given->geometryType == VK_GEOMETRY_TYPE_INSTANCES_KHR; }
};

// The ranges of one build, direct or indirect.
struct BuildRanges {
    const VkAccelerationStructureBuildRangeInfoKHR *direct = nullptr; // of each geometry
    VkDeviceAddress indirect = 0; // of the first geometry's range; the others follow, `stride` bytes apart
    uint32_t stride = 0;
    const uint32_t *most = nullptr; // maximum of primitives of each geometry, for an indirect build

    [[nodiscard]] bool given() const { return direct || most; }
    // The maximum of primitives of geometry g.
    [[nodiscard]] uint32_t primitives(uint32_t g) const
    {
        return direct ? direct[g].primitiveCount : most ? most[g] : 0;
    }
    // Address of geometry g's range; 0 for a direct build.
    [[nodiscard]] VkDeviceAddress address(uint32_t g) const { return direct ? 0 : indirect + uint64_t{g} * stride; }
};

// The build of a structure that is not a micromap.
struct StructureBuild {
    uint32_t element = 0; // of pInfos
    const VkAccelerationStructureBuildGeometryInfoKHR *given = nullptr;
    std::vector<Geometry> geometries;
    BuildRanges ranges;
    bool accepted = true;         // the layer's implementation records it
    std::vector<Access> accesses; // set by validation

    [[nodiscard]] bool isUpdate() const { return given->mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR; }
    // Instances have the layouts of VK_NV_ray_tracing_motion_blur.
    [[nodiscard]] bool hasMotion() const { return (given->flags & VK_BUILD_ACCELERATION_STRUCTURE_MOTION_BIT_NV) != 0; }
    // The geometries determine the type of a GENERIC structure.
    [[nodiscard]] bool isTopLevel() const;
};

// The builds of a command, each kind in the order of pInfos.
struct Builds {
    BuildCommand command = BuildCommand::Structures;
    std::vector<MicromapBuild> micromaps;
    std::vector<StructureBuild> structures;
};

Builds parse(uint32_t count, const VkMicromapBuildInfoEXT *infos, bool host = false);
// vkCmdBuildAccelerationStructuresKHR, and with null `ranges` vkBuildAccelerationStructuresKHR and queries of sizes
Builds parse(uint32_t count, const VkAccelerationStructureBuildGeometryInfoKHR *infos,
             const VkAccelerationStructureBuildRangeInfoKHR *const *ranges);
Builds parseIndirect(uint32_t count, const VkAccelerationStructureBuildGeometryInfoKHR *infos,
                     const VkDeviceAddress *addresses, const uint32_t *strides, const uint32_t *const *most);

// In the order of geometries. Scratch memory of structures is not among them: only a query finds how much they need.
std::vector<Access> accessesOf(const MicromapBuild &build);
std::vector<Access> accessesOf(const StructureBuild &build);

// Bytes of an index; 0 without indices and for unknown types.
constexpr uint32_t indexBytes(VkIndexType type)
{
    return type == VK_INDEX_TYPE_UINT8_EXT ? 1
           : type == VK_INDEX_TYPE_UINT16  ? 2
           : type == VK_INDEX_TYPE_UINT32  ? 4
                                           : 0;
}
// Bytes from one instance, or pointer to one, to the next.
inline VkDeviceSize instanceStride(const VkAccelerationStructureGeometryInstancesDataKHR &instances)
{
    return instances.arrayOfPointers ? sizeof(VkDeviceAddress) : sizeof(VkAccelerationStructureInstanceKHR);
}

} // namespace vellum::layer::input
