// SPDX-License-Identifier: Apache-2.0
#include "compare.h"

#include <cstdio>
#include <cstdlib>

namespace oracle
{

uint32_t setting(const char *name, uint32_t otherwise)
{
    const char *value = std::getenv(name);
    return value != nullptr ? static_cast<uint32_t>(std::strtoul(value, nullptr, 0)) : otherwise;
}

uint32_t recordOffset(const Scene &scene, uint32_t instance)
{
    const bool boxes = !scene.objects[scene.instances[instance].object].meshes[0].boxes.empty();
    return instance % kRecordOffsets + (boxes ? kBoxRecords : 0);
}

std::vector<vt::Geometry> geometriesOf(const Object &object,
                                       const std::function<const vt::Micromap *(vt::MicromapInput)> &makeMicromap)
{
    std::vector<vt::Geometry> geometries;
    for (const Mesh &mesh : object.meshes) {
        vt::Geometry geometry;
        geometry.vertices = mesh.vertices;
        geometry.boxes = mesh.boxes;
        geometry.flags = mesh.opaque ? VK_GEOMETRY_OPAQUE_BIT_KHR : 0;
        if (mesh.micromap) {
            const MeshMicromap &from = *mesh.micromap;
            vt::Attachment attachment;
            attachment.indexType = from.indexType;
            attachment.indices = from.indices;
            attachment.base = from.base;
            if (!from.null) {
                vt::MicromapInput input;
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

VkBuildAccelerationStructureFlagsKHR structureFlags(const vt::Gpu &gpu)
{
    return gpu.options().micromaps
               ? VkBuildAccelerationStructureFlagsKHR{VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT}
               : 0;
}

std::vector<VkAccelerationStructureInstanceKHR> instancesOf(const Scene &scene,
                                                            std::span<const vt::Structure *const> objects)
{
    std::vector<VkAccelerationStructureInstanceKHR> instances;
    for (const Instance &from : scene.instances) {
        auto instance = vt::instance(*objects[from.object], {}, from.customIndex, from.flags, from.mask);
        instance.transform = from.transform;
        instance.instanceShaderBindingTableRecordOffset =
            recordOffset(scene, static_cast<uint32_t>(instances.size())) & 0xffffffu;
        if (from.inactive)
            instance.accelerationStructureReference = 0;
        instances.push_back(instance);
    }
    return instances;
}

Built build(vt::Gpu &gpu, const Scene &scene)
{
    Built built;
    std::vector<const vt::Structure *> objects;
    for (const Object &object : scene.objects) {
        std::vector<vt::Geometry> geometries = geometriesOf(object, [&](vt::MicromapInput input) {
            built.micromaps.push_back(std::make_unique<vt::Micromap>(gpu, std::move(input)));
            built.micromaps.back()->build();
            return built.micromaps.back().get();
        });
        built.objects.push_back(std::make_unique<vt::Blas>(gpu, std::move(geometries), structureFlags(gpu)));
        objects.push_back(built.objects.back().get());
    }
    built.scene = std::make_unique<vt::Tlas>(gpu, instancesOf(scene, objects));
    return built;
}

bool confirms(const vt::Ray &ray, const Hit &hit)
{
    return ray.rule == vt::kAlways ||
           (ray.rule == vt::kHash && vt::hashConfirms(hit.customIndex, hit.instance, hit.geometry, hit.primitive));
}

namespace
{

// Lavapipe 26 crashes in shaders that trace a top-level structure where some instance comes behind one that no ray can
// meet: two instances are enough, the first with reference 0 or mask 0. So it does without the layer; the specification
// says that an inactive object is "considered invisible to all rays", and allows every mask. Such ones at the end are
// well.
void showBeforeOthers(Scene &scene)
{
    bool others = false;
    for (auto instance = scene.instances.rbegin(); instance != scene.instances.rend(); ++instance) {
        if (others) {
            instance->inactive = false;
            instance->mask |= instance->mask == 0 ? 1u : 0u;
        }
        others |= !instance->inactive && instance->mask != 0;
    }
}

} // namespace

void compareScenes(vt::Gpu &gpu, const Limits &limits, uint32_t scenes, uint64_t minimum, const TraceScene &trace)
{
    const uint32_t seed = setting("VELLUM_ORACLE_SEED", 20260519);
    scenes = setting("VELLUM_ORACLE_SCENES", scenes);
    std::printf("seed %u, %u scenes\n", seed, scenes);
    uint64_t compared = 0, unsure = 0, handed = 0, hit = 0;
    int faults = 0;
    for (uint32_t s = 0; s < scenes; ++s) {
        Random random(seed + s);
        Scene scene = randomScene(random, limits);
        if (gpu.onLavapipe26())
            showBeforeOthers(scene);
        std::vector<Hits> hits;
        for (const vt::Ray &ray : scene.rays)
            hits.push_back(allHits(scene, ray));
        const std::vector<Traced> traced = trace(scene, hits);
        for (size_t i = 0; i < traced.size(); ++i) {
            if (hits[i].unsure) {
                ++unsure;
                continue;
            }
            ++compared;
            handed += traced[i].candidates;
            hit += traced[i].hit ? 1u : 0u;
            if (!traced[i].fault.empty() && ++faults <= 10)
                ADD_FAILURE() << "scene seed " << seed + s << " ray " << i << std::hex << " flags 0x"
                              << scene.rays[i].flags << std::dec << ": " << traced[i].fault;
        }
    }
    std::printf("%llu rays compared, %llu too close to call, %llu candidates, %llu hits\n",
                static_cast<unsigned long long>(compared), static_cast<unsigned long long>(unsure),
                static_cast<unsigned long long>(handed), static_cast<unsigned long long>(hit));
    EXPECT_EQ(faults, 0);
    EXPECT_LT(static_cast<double>(unsure), 0.05 * static_cast<double>(compared + unsure));
    if (std::getenv("VELLUM_ORACLE_SCENES") == nullptr) {
        EXPECT_GE(compared, minimum);
    }
}

} // namespace oracle
