// SPDX-License-Identifier: Apache-2.0
// Groups about what rays meet: the opacity of a hit by micromap, geometry, instance and ray.
#include <array>

#include "check/groups/random_case.h"

namespace vellum::check
{
namespace
{

constexpr std::string_view kRayOpacity =
    "Ray Opacity Micromap: the table of 4 State value, 2 State value, Special index value and 2 State override; then "
    "VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR, ..._FORCE_NO_OPAQUE_BIT_KHR and the ray flags; Ray Opacity Culling.";

Case queries(Random &random, const DeviceLimits &limits)
{
    return {.scene = makeScene(random, smallScene(limits), limits)};
}

Case pipelines(Random &random, const DeviceLimits &limits)
{
    return {.scene = makeScene(random, smallScene(limits), limits), .trace = {.method = TracePlan::Method::Pipeline}};
}

Case plain(Random &random, const DeviceLimits &limits)
{
    Limits scene = smallScene(limits);
    scene.micromaps = false;
    return {.scene = makeScene(random, scene, limits),
            .trace = {.method = limits.pipelines && chance(random, 50) ? TracePlan::Method::Pipeline
                                                                       : TracePlan::Method::Query}};
}

// Few triangles with fine micromaps, up to the limits of the device.
Case levels(Random &random, const DeviceLimits &limits)
{
    Limits scene = smallScene(limits);
    scene.objects = scene.meshes = 1;
    scene.instances = 2;
    scene.triangles = 3;
    const uint32_t most = std::max(limits.maxLevel2, limits.maxLevel4);
    scene.maxLevel = chance(random, 15) ? most : std::min(most, 5 + below(random, 5));
    Case c{.scene = makeScene(random, scene, limits)};
    // Rays that meet few triangles can be compared where micro-triangles are small.
    for (oracle::SceneMicromap &micromap : c.scene.micromaps) {
        oracle::MicromapTriangle &first = micromap.triangles[0];
        first.level = first.format == kTwoState ? std::min(limits.maxLevel2, scene.maxLevel)
                                                : std::min(limits.maxLevel4, scene.maxLevel);
        const uint32_t values = first.format == kTwoState ? 2 : 4;
        first.states.resize(size_t{1} << 2 * first.level);
        for (uint8_t &state : first.states)
            state = static_cast<uint8_t>(below(random, values));
    }
    return c;
}

// A row of right-angled triangles in the plane z = 0, and rays at their micro-triangles.
void addRow(Random &random, oracle::Scene &scene, uint32_t triangles, const Limits &limits)
{
    oracle::Mesh mesh;
    mesh.opaque = chance(random, 50);
    const auto y = 1.5f * static_cast<float>(scene.objects[0].meshes.size());
    for (uint32_t t = 0; t < triangles; ++t) {
        appendTriangle(mesh.vertices, {1.5f * static_cast<float>(t), y, 0});
        for (uint32_t r = 0; r < 4; ++r) {
            Ray ray = oracle::randomRay(random, limits);
            const float u = 0.03f + 0.9f * static_cast<float>(below(random, 1000)) / 1000;
            const float v = (1 - u) * (0.05f + 0.9f * static_cast<float>(below(random, 1000)) / 1000);
            ray.origin = {1.5f * static_cast<float>(t) + u, y + v, 3};
            ray.direction = {0, 0, -1};
            ray.tMin = 0;
            ray.tMax = 10;
            ray.cullMask = 0xff;
            ray.flags &= ~(kRayCullBack | kRayCullFront | kRaySkipTriangles);
            scene.rays.push_back(ray);
        }
    }
    scene.objects[0].meshes.push_back(mesh);
}

oracle::Instance oneInstance(Random &random)
{
    oracle::Instance instance;
    for (size_t i = 0; i < 3; ++i)
        instance.transform.matrix[i][i] = 1;
    instance.customIndex = below(random, 1u << 24);
    return instance;
}

// Every type of index with every special index, stride, offset and base, also of null micromaps.
Case indices(Random &random, const DeviceLimits &limits)
{
    Limits scene = smallScene(limits);
    scene.maxLevel = 3;
    scene.objects = scene.meshes = 1;
    scene.rays = 0;
    Case c;
    c.scene.objects.resize(1);
    c.scene.instances = {oneInstance(random)};
    // 200 triangles, so that indices of eight bits reach beyond 127, which are not special.
    oracle::SceneMicromap &micromap = c.scene.micromaps.emplace_back();
    const uint32_t count = chance(random, 30) ? 200 : 12;
    for (uint32_t i = 0; i < count; ++i)
        micromap.triangles.push_back(oracle::randomTriangle(random, scene.maxLevel));
    for (uint32_t m = 0; m < 3; ++m) {
        const uint32_t triangles = 4 + below(random, 8);
        addRow(random, c.scene, triangles, scene);
        if (chance(random, 85))
            c.scene.objects[0].meshes.back().micromap = oracle::randomUse(random, c.scene, triangles, scene);
    }
    if (limits.pipelines && chance(random, 25))
        c.trace.method = TracePlan::Method::Pipeline;
    return c;
}

// One object in many instances, whose flags differ.
Case flags(Random &random, const DeviceLimits &limits)
{
    Limits scene = smallScene(limits);
    scene.objects = 1;
    scene.instances = 10;
    scene.maxLevel = 2;
    Case c{.scene = makeScene(random, scene, limits)};
    for (oracle::Instance &instance : c.scene.instances) {
        constexpr std::array<uint32_t, 6> some{0,
                                               kFlagTwoState,
                                               kFlagDisable,
                                               kFlagTwoState | kFlagDisable,
                                               VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR,
                                               VK_GEOMETRY_INSTANCE_FORCE_NO_OPAQUE_BIT_KHR};
        instance.flags = (instance.flags & 3u) | some[below(random, some.size())];
    }
    if (limits.pipelines && chance(random, 40))
        c.trace.method = TracePlan::Method::Pipeline;
    return c;
}

Case lossy(Random &random, const DeviceLimits &limits)
{
    Limits scene = smallScene(limits);
    scene.lossy = true;
    scene.triangles = 4;
    scene.objects = 2;
    Case c{.scene = makeScene(random, scene, limits)};
    if (c.scene.micromaps.empty() || limits.api == Api::Ext)
        return c;
    c.scene.micromaps[0].flags |= kLossy;
    for (oracle::MicromapTriangle &triangle : c.scene.micromaps[0].triangles) {
        while (triangle.format == kFourState && triangle.level > limits.maxLossyLevel)
            triangle = oracle::randomTriangle(random, scene.maxLevel);
    }
    return c;
}

constexpr std::array kGroups{
    Group{"resolution-query", "random scenes, by ray queries in compute shaders", kRayOpacity, 400,
          [](Session &s, uint64_t seed) { return runRandomCase(s, "resolution-query", seed, queries); }},
    Group{"resolution-pipeline",
          "random scenes, by ray tracing pipelines whose hit groups have and lack any-hit and closest-hit shaders, and "
          "by "
          "null records",
          kRayOpacity, 200,
          [](Session &s, uint64_t seed) { return runRandomCase(s, "resolution-pipeline", seed, pipelines); }},
    Group{"plain", "random scenes without micromaps: whether oracle and driver agree at all",
          "Ray Traversal; Ray Intersection Culling", 60,
          [](Session &s, uint64_t seed) { return runRandomCase(s, "plain", seed, plain); }},
    Group{"levels", "subdivision levels up to the limits of the device, of both formats in one micromap",
          "Opacity Micromap: the curve by which micro-triangles are numbered; maxOpacity2StateSubdivisionLevel and "
          "maxOpacity4StateSubdivisionLevel; VkMicromapTriangleKHR: subdivisionLevel and format of each triangle",
          150, [](Session &s, uint64_t seed) { return runRandomCase(s, "levels", seed, levels); }},
    Group{"indices", "special and other indices of every type, stride and offset, with a base triangle, null micromaps",
          "VkAccelerationStructureTrianglesOpacityMicromapKHR: \"a triangle in the micromap is fetched at index "
          "reinterpret_cast<indexType>(indexBuffer + indexStride * geomTriangleIndex) + baseTriangle\"; \"If the index "
          "fetched from indexbuffer is negative then it is a special value\"; VK_EXT_opacity_micromap: \"the unsigned "
          "cast "
          "of one of the values from VkOpacityMicromapSpecialIndexEXT\"",
          300, [](Session &s, uint64_t seed) { return runRandomCase(s, "indices", seed, indices); }},
    Group{"flags", "one object in instances with different flags, which force two states or disable micromaps",
          "VkGeometryInstanceFlagBitsKHR: FORCE_OPACITY_MICROMAP_2_STATE, DISABLE_OPACITY_MICROMAPS; the ray flag "
          "ForceOpacityMicromap2StateEXT",
          200, [](Session &s, uint64_t seed) { return runRandomCase(s, "flags", seed, flags); }},
    Group{
        "lossy", "lossy builds: a state may become unknown, and nothing else",
        "VK_BUILD_ACCELERATION_STRUCTURE_MICROMAP_LOSSY_BIT_KHR: \"the implementation can additionally substitute any "
        "state to any of the UNKNOWN states\"",
        100, [](Session &s, uint64_t seed) { return runRandomCase(s, "lossy", seed, lossy); }},
};

} // namespace

std::span<const Group> resolutionGroups()
{
    return kGroups;
}

} // namespace vellum::check
