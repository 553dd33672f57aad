// SPDX-License-Identifier: Apache-2.0
#include "check/oracle/scene_build.h"

#include <cstring>
#include <map>
#include <random>

namespace vellum::check::oracle
{
namespace
{

Vec3 moved(const Mesh &mesh, Vec3 vertex)
{
    for (float &value : vertex)
        value += 0.5f;
    return quantized(mesh.layout.vertexFormat, vertex);
}

// The vertices that the corners of triangles refer to, and the indices.
void addIndexed(Geometry &geometry, const MeshLayout &layout, std::span<const Vec3> corners)
{
    std::vector<uint32_t> numbers; // of the vertex of each corner
    std::vector<Vec3> vertices;
    std::map<std::array<uint32_t, 3>, uint32_t> known;
    for (const Vec3 &corner : corners) {
        std::array<uint32_t, 3> bits{};
        std::memcpy(bits.data(), corner.data(), sizeof bits);
        const auto next = static_cast<uint32_t>(vertices.size());
        const auto found = known.emplace(bits, next);
        if (found.second || layout.separate)
            vertices.push_back(corner);
        numbers.push_back(layout.separate ? next : found.first->second);
    }
    std::vector<uint32_t> positions(vertices.size()); // of each vertex
    for (uint32_t i = 0; i < positions.size(); ++i)
        positions[i] = i;
    std::mt19937 random(layout.order);
    for (size_t i = positions.size(); layout.order != 0 && i > 1; --i)
        std::swap(positions[i - 1], positions[random() % i]);
    const size_t first = size_t{layout.firstVertex} + layout.firstIndex;
    geometry.vertices.resize(first + vertices.size());
    for (size_t i = 0; i < vertices.size(); ++i)
        geometry.vertices[first + positions[i]] = vertices[i];
    for (const uint32_t number : numbers)
        geometry.indices.push_back(layout.firstIndex + positions[number]);
}

// The geometry of a mesh of triangles. spare: copies of the first ones, at the end.
Geometry trianglesOf(const Mesh &mesh, uint32_t spare)
{
    const MeshLayout &layout = mesh.layout;
    Geometry geometry{.indexType = layout.indexType,
                      .spareTriangles = spare,
                      .firstVertex = layout.firstVertex,
                      .vertexFormat = layout.vertexFormat,
                      .transform = layout.transform,
                      .transformOffset = layout.transformOffset};
    std::vector<Vec3> corners = mesh.vertices;
    for (size_t i = 0; i < size_t{3} * spare; ++i)
        corners.push_back(moved(mesh, mesh.vertices.empty() ? Vec3{} : mesh.vertices[i % mesh.vertices.size()]));
    if (layout.isIndexed()) {
        addIndexed(geometry, layout, corners);
    } else {
        geometry.vertices.resize(layout.firstVertex);
        geometry.vertices.insert(geometry.vertices.end(), corners.begin(), corners.end());
    }
    return geometry;
}

} // namespace

Corners cornersOf(const Mesh &mesh, uint32_t triangle)
{
    Corners corners{};
    for (size_t i = 0; i < 3; ++i) {
        const Vec3 &vertex = mesh.vertices[size_t{3} * triangle + i];
        for (size_t r = 0; r < 3; ++r) {
            corners[i][r] = double{vertex[r]};
            if (!mesh.layout.transform)
                continue;
            const float *const row = mesh.layout.transform->matrix[r];
            corners[i][r] = double{row[0]} * double{vertex[0]} + double{row[1]} * double{vertex[1]} +
                            double{row[2]} * double{vertex[2]} + double{row[3]};
        }
    }
    return corners;
}

uint32_t recordOffset(const Scene &scene, uint32_t instance)
{
    if (scene.instances[instance].record)
        return *scene.instances[instance].record;
    const bool boxes = scene.objects[scene.instances[instance].object].hasBoxes();
    return instance % kRecordOffsets + (boxes ? kBoxRecords : 0);
}

MicromapInput inputOf(const SceneMicromap &micromap)
{
    MicromapInput input;
    for (const MicromapTriangle &triangle : micromap.triangles)
        input.add(triangle.level, triangle.format, triangle.states);
    input.stride = micromap.triangleStride;
    input.usagePointers = micromap.usagePointers;
    input.usageForm = micromap.usage;
    input.onHost = micromap.onHost;
    input.layOut(micromap.layout);
    return input;
}

std::vector<Geometry> geometriesOf(const Object &object, std::span<const std::unique_ptr<Micromap>> micromaps,
                                   uint32_t spareTriangles)
{
    std::vector<Geometry> geometries;
    const bool boxes = object.hasBoxes();
    for (const Mesh &mesh : object.meshes) {
        Geometry geometry = boxes ? Geometry{.boxes = mesh.boxes, .isAabbs = true} : trianglesOf(mesh, spareTriangles);
        geometry.stride = mesh.layout.stride;
        geometry.leadingBytes = mesh.layout.primitiveOffset;
        geometry.byPointer = object.geometryPointers;
        geometry.flags =
            (mesh.opaque ? VkGeometryFlagsKHR{VK_GEOMETRY_OPAQUE_BIT_KHR} : 0) |
            (mesh.noDuplicates ? VkGeometryFlagsKHR{VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR} : 0);
        if (mesh.micromap) {
            const MeshMicromap &from = *mesh.micromap;
            geometry.micromap = Attachment{.micromap = from.micromap ? micromaps[*from.micromap].get() : nullptr,
                                           .indexType = from.indexType,
                                           .indices = from.indices,
                                           .stride = from.stride,
                                           .base = from.base,
                                           .indexOffset = from.indexOffset,
                                           .usagePointers = from.usagePointers,
                                           .usageForm = from.usage};
        }
        geometries.push_back(std::move(geometry));
    }
    return geometries;
}

VkBuildAccelerationStructureFlagsKHR structureFlags(const Device &gpu)
{
    return gpu.options().micromaps
               ? VkBuildAccelerationStructureFlagsKHR{VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT}
               : 0;
}

std::vector<VkAccelerationStructureInstanceKHR> instancesOf(const Scene &scene,
                                                            std::span<const Structure *const> objects)
{
    std::vector<VkAccelerationStructureInstanceKHR> instances;
    for (const Instance &from : scene.instances) {
        auto out = check::instance(*objects[from.object], {}, from.customIndex, from.flags, from.mask);
        out.transform = from.transform;
        out.instanceShaderBindingTableRecordOffset =
            recordOffset(scene, static_cast<uint32_t>(instances.size())) & 0xffffffu;
        if (from.inactive)
            out.accelerationStructureReference = 0;
        instances.push_back(out);
    }
    return instances;
}

Built build(Device &gpu, const Scene &scene)
{
    Built built;
    for (const SceneMicromap &micromap : scene.micromaps) {
        built.micromaps.push_back(std::make_unique<Micromap>(gpu, inputOf(micromap), micromap.flags));
        built.micromaps.back()->build();
    }
    std::vector<const Structure *> objects;
    for (const Object &object : scene.objects) {
        built.objects.push_back(
            std::make_unique<Blas>(gpu, geometriesOf(object, built.micromaps), structureFlags(gpu)));
        objects.push_back(built.objects.back().get());
    }
    built.scene = std::make_unique<Tlas>(gpu, instancesOf(scene, objects));
    return built;
}

bool confirms(const Ray &ray, const Hit &hit)
{
    return ray.rule == kAlways || ray.rule == kTerminate ||
           (ray.rule == kHash && hashConfirms(hit.customIndex, hit.instance, hit.geometry, hit.primitive));
}

} // namespace vellum::check::oracle
