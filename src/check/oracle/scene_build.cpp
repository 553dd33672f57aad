// SPDX-License-Identifier: Apache-2.0
#include "check/oracle/scene_build.h"

namespace vellum::check::oracle
{

uint32_t recordOffset(const Scene &scene, uint32_t instance)
{
    if (scene.instances[instance].record)
        return *scene.instances[instance].record;
    const bool boxes = !scene.objects[scene.instances[instance].object].meshes[0].boxes.empty();
    return instance % kRecordOffsets + (boxes ? kBoxRecords : 0);
}

MicromapInput inputOf(const SceneMicromap &micromap)
{
    MicromapInput input;
    for (const MicromapTriangle &triangle : micromap.triangles)
        input.add(triangle.level, triangle.format, triangle.states);
    input.stride = micromap.triangleStride;
    input.usagePointers = micromap.usagePointers;
    return input;
}

std::vector<Geometry> geometriesOf(const Object &object, std::span<const std::unique_ptr<Micromap>> micromaps,
                                   uint32_t spareTriangles)
{
    std::vector<Geometry> geometries;
    for (const Mesh &mesh : object.meshes) {
        Geometry geometry;
        geometry.vertices.resize(size_t{3} * mesh.skippedTriangles);
        geometry.vertices.insert(geometry.vertices.end(), mesh.vertices.begin(), mesh.vertices.end());
        geometry.skippedTriangles = mesh.skippedTriangles;
        geometry.spareTriangles = mesh.boxes.empty() ? spareTriangles : 0;
        for (uint32_t i = 0; i < 3 * geometry.spareTriangles; ++i) {
            Vec3 vertex = mesh.vertices[i % mesh.vertices.size()];
            vertex[2] += 0.5f;
            geometry.vertices.push_back(vertex);
        }
        geometry.boxes = mesh.boxes;
        geometry.flags = mesh.opaque ? VK_GEOMETRY_OPAQUE_BIT_KHR : 0;
        if (mesh.micromap) {
            const MeshMicromap &from = *mesh.micromap;
            geometry.micromap = Attachment{.micromap = from.micromap ? micromaps[*from.micromap].get() : nullptr,
                                           .indexType = from.indexType,
                                           .indices = from.indices,
                                           .stride = from.stride,
                                           .base = from.base,
                                           .indexOffset = from.indexOffset};
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
