// SPDX-License-Identifier: Apache-2.0
// A scene as plain data: triangles and boxes, micromaps, instances and rays.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "gpu/tracer.h"

namespace vellum::check
{
using namespace gpu;
} // namespace vellum::check

namespace vellum::check::oracle
{

struct MicromapTriangle {
    uint32_t level = 0;
    uint16_t format = kFourState;
    std::vector<uint8_t> states; // 4^level values, in the order of the curve
};

struct SceneMicromap {
    std::vector<MicromapTriangle> triangles;
    VkBuildMicromapFlagsEXT flags = 0; // and kLossy
    uint32_t triangleStride = sizeof(VkMicromapTriangleEXT);
    bool usagePointers = false; // usage counts come as an array of pointers
    uint32_t usage = 0;         // how they are stated: bits of check::UsageForm
    uint32_t layout = 0;        // where the data of triangles is: bits of check::DataLayout
    bool onHost = false;        // sizes are queried for builds on host or device; VK_EXT_opacity_micromap
};

// How a mesh uses a micromap.
struct MeshMicromap {
    std::optional<uint32_t> micromap; // its number in the scene; nothing: a null handle, and special indices only
    VkIndexType indexType = VK_INDEX_TYPE_NONE_KHR;
    std::vector<int32_t> indices; // index of each triangle of the mesh; negative: special
    uint32_t base = 0;
    // Bytes between two indices; tightly packed unless given; 0: every triangle reads the first index.
    std::optional<uint32_t> stride;
    uint32_t indexOffset = 0; // bytes before the first index
    // Usage counts come by pointers, which VK_EXT_opacity_micromap has here as well
    bool usagePointers = false;
    uint32_t usage = 0;

    // The index of a triangle, before the base is added.
    [[nodiscard]] int32_t indexOf(uint32_t triangle) const { return indices[stride == 0u ? 0 : triangle]; }
};

// Returns whether one is a micromap, a null handle or nothing, like the other: an update must not change that
// (VUID-vkCmdBuildAccelerationStructuresKHR-micromap-11625 to 11627).
inline bool isAlike(const std::optional<MeshMicromap> &a, const std::optional<MeshMicromap> &b)
{
    return a.has_value() == b.has_value() && (!a || a->micromap.has_value() == b->micromap.has_value());
}

// How the triangles or boxes of a mesh lie in memory. The bytes between them are garbage.
struct MeshLayout {
    VkFormat vertexFormat = VK_FORMAT_R32G32B32_SFLOAT;
    uint32_t stride = 0;          // bytes from one vertex or box to the next; 0: packed tightly
    uint32_t primitiveOffset = 0; // bytes before the first index, vertex (where there are no indices) or box
    // Triangles only.
    uint32_t firstVertex = 0;
    VkIndexType indexType = VK_INDEX_TYPE_NONE_KHR; // of vertices
    uint32_t firstIndex = 0;                        // vertices before the first one that an index refers to
    bool separate = false;                          // equal vertices have different indices
    uint32_t order = 0; // of vertices to which indices refer: 0: that of the triangles, else shuffled by this number
    std::optional<VkTransformMatrixKHR> transform; // transformData
    uint32_t transformOffset = 0;

    [[nodiscard]] bool isIndexed() const { return indexType != VK_INDEX_TYPE_NONE_KHR; }
};

struct Mesh { // a geometry, also one without triangles and boxes
    // Three of each triangle, as the device reads them: of the layout's format, before its transform. NaN for X of one
    // of them: the triangle is inactive.
    std::vector<Vec3> vertices;
    std::vector<VkAabbPositionsKHR> boxes; // not empty: instead of triangles; NaN for minX: an inactive one
    bool opaque = false;
    bool noDuplicates = false; // VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR
    MeshLayout layout;
    std::optional<MeshMicromap> micromap;

    [[nodiscard]] uint32_t triangles() const { return static_cast<uint32_t>(vertices.size() / 3); }
};

// The corners of a triangle in the structure's space, in double precision.
using Corners = std::array<std::array<double, 3>, 3>;
Corners cornersOf(const Mesh &mesh, uint32_t triangle);

struct Object {                                     // a bottom-level structure: triangles or boxes
    VkBuildAccelerationStructureFlagsKHR flags = 0; // besides those that steps and instances need
    bool geometryPointers = false;                  // ppGeometries
    std::vector<Mesh> meshes;

    [[nodiscard]] bool hasBoxes() const
    {
        return std::any_of(meshes.begin(), meshes.end(), [](const Mesh &mesh) { return !mesh.boxes.empty(); });
    }

    // Returns whether a mesh has that micromap.
    [[nodiscard]] bool uses(uint32_t micromap) const
    {
        return std::any_of(meshes.begin(), meshes.end(), [micromap](const Mesh &mesh) {
            return mesh.micromap && mesh.micromap->micromap == micromap;
        });
    }
};

struct Instance {
    uint32_t object = 0;
    VkTransformMatrixKHR transform{};
    uint32_t customIndex = 0;
    uint32_t mask = 0xff;
    uint32_t flags = 0;
    bool inactive = false;          // acceleration structure reference 0
    std::optional<uint32_t> record; // instanceShaderBindingTableRecordOffset; nothing: recordOffset()
};

struct Scene {
    VkBuildAccelerationStructureFlagsKHR topFlags = 0; // of the top level, besides those that steps need
    // Hits nearer than this to a line between micro-triangles, in barycentrics, are not compared: rounding decides.
    float edge = 5e-5f;
    std::vector<SceneMicromap> micromaps;
    std::vector<Object> objects;
    std::vector<Instance> instances;
    std::vector<Ray> rays;
};

} // namespace vellum::check::oracle
