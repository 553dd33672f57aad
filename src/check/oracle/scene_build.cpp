// SPDX-License-Identifier: Apache-2.0
#include "check/oracle/scene_build.h"

namespace vellum::check::oracle
{

uint32_t recordOffset(const Scene &scene, uint32_t instance)
{
    const bool boxes = !scene.objects[scene.instances[instance].object].meshes[0].boxes.empty();
    return instance % kRecordOffsets + (boxes ? kBoxRecords : 0);
}

std::vector<check::Geometry>
geometriesOf(const Object &object, const std::function<const check::Micromap *(check::MicromapInput)> &makeMicromap)
{
    std::vector<check::Geometry> geometries;
    for (const Mesh &mesh : object.meshes) {
        check::Geometry geometry;
        geometry.vertices = mesh.vertices;
        geometry.boxes = mesh.boxes;
        geometry.flags = mesh.opaque ? VK_GEOMETRY_OPAQUE_BIT_KHR : 0;
        if (mesh.micromap) {
            const MeshMicromap &from = *mesh.micromap;
            check::Attachment attachment;
            attachment.indexType = from.indexType;
            attachment.indices = from.indices;
            attachment.base = from.base;
            if (!from.null) {
                check::MicromapInput input;
                for (const MicromapTriangle &triangle : from.triangles)
                    input.add(triangle.level, triangle.format, triangle.states);
                attachment.micromap = makeMicromap(std::move(input));
            }
            geometry.micromap = std::move(attachment);
        }
        geometries.push_back(std::move(geometry));
    }
    return geometries;
}

VkBuildAccelerationStructureFlagsKHR structureFlags(const check::Device &gpu)
{
    return gpu.options().micromaps
               ? VkBuildAccelerationStructureFlagsKHR{VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT}
               : 0;
}

std::vector<VkAccelerationStructureInstanceKHR> instancesOf(const Scene &scene,
                                                            std::span<const check::Structure *const> objects)
{
    std::vector<VkAccelerationStructureInstanceKHR> instances;
    for (const Instance &from : scene.instances) {
        auto instance = check::instance(*objects[from.object], {}, from.customIndex, from.flags, from.mask);
        instance.transform = from.transform;
        instance.instanceShaderBindingTableRecordOffset =
            recordOffset(scene, static_cast<uint32_t>(instances.size())) & 0xffffffu;
        if (from.inactive)
            instance.accelerationStructureReference = 0;
        instances.push_back(instance);
    }
    return instances;
}

Built build(check::Device &gpu, const Scene &scene)
{
    Built built;
    std::vector<const check::Structure *> objects;
    for (const Object &object : scene.objects) {
        std::vector<check::Geometry> geometries = geometriesOf(object, [&](check::MicromapInput input) {
            built.micromaps.push_back(std::make_unique<check::Micromap>(gpu, std::move(input)));
            built.micromaps.back()->build();
            return built.micromaps.back().get();
        });
        built.objects.push_back(std::make_unique<check::Blas>(gpu, std::move(geometries), structureFlags(gpu)));
        objects.push_back(built.objects.back().get());
    }
    built.scene = std::make_unique<check::Tlas>(gpu, instancesOf(scene, objects));
    return built;
}

bool confirms(const check::Ray &ray, const Hit &hit)
{
    return ray.rule == check::kAlways || (ray.rule == check::kHash && check::hashConfirms(hit.customIndex, hit.instance,
                                                                                          hit.geometry, hit.primitive));
}

} // namespace vellum::check::oracle
