// SPDX-License-Identifier: Apache-2.0
#include "check/oracle/random_scene.h"

#include <algorithm>
#include <cmath>

namespace vellum::check::oracle
{
namespace
{

uint32_t below(Random &random, uint32_t n)
{
    return static_cast<uint32_t>(random() % n);
}

bool chance(Random &random, uint32_t percent)
{
    return below(random, 100) < percent;
}

float between(Random &random, float low, float high)
{
    return low + (high - low) * static_cast<float>(random() >> 8) / 16777216.0f;
}

check::Vec3 point(Random &random, float size)
{
    return {between(random, -size, size), between(random, -size, size), between(random, -size, size)};
}

MicromapTriangle randomTriangle(Random &random, uint32_t maxLevel)
{
    MicromapTriangle triangle;
    triangle.level = below(random, maxLevel + 1);
    triangle.format = chance(random, 40) ? check::kTwoState : check::kFourState;
    const uint32_t values = triangle.format == check::kTwoState ? 2 : 4;
    triangle.states.resize(size_t{1} << (2 * triangle.level));
    // Uniform triangles and uniform stretches are what a layer treats specially.
    const uint32_t stretch = 1u << (2 * below(random, 4));
    uint8_t state = 0;
    for (size_t i = 0; i < triangle.states.size(); ++i) {
        if (i % stretch == 0)
            state = static_cast<uint8_t>(below(random, values));
        triangle.states[i] = state;
    }
    if (chance(random, 15))
        std::fill(triangle.states.begin(), triangle.states.end(), state);
    return triangle;
}

MeshMicromap randomMicromap(Random &random, uint32_t triangles, uint32_t maxLevel)
{
    MeshMicromap micromap{};
    constexpr std::array types{VK_INDEX_TYPE_NONE_KHR, VK_INDEX_TYPE_UINT16, VK_INDEX_TYPE_UINT32};
    micromap.indexType = types[below(random, 3)];
    micromap.base = chance(random, 50) ? 0 : below(random, 7);
    micromap.null = micromap.indexType != VK_INDEX_TYPE_NONE_KHR && chance(random, 10);
    const bool direct = micromap.indexType == VK_INDEX_TYPE_NONE_KHR;
    const uint32_t count = direct ? triangles : 1 + below(random, triangles);
    for (uint32_t i = 0; i < count + micromap.base; ++i)
        micromap.triangles.push_back(randomTriangle(random, maxLevel));
    for (uint32_t i = 0; i < triangles; ++i) {
        if (direct)
            micromap.indices.push_back(static_cast<int32_t>(i));
        else if (micromap.null || chance(random, 20))
            micromap.indices.push_back(-1 - static_cast<int32_t>(below(random, 4)));
        else
            micromap.indices.push_back(static_cast<int32_t>(below(random, count)));
    }
    return micromap;
}

Mesh randomMesh(Random &random, bool boxes, const Limits &limits)
{
    Mesh mesh{};
    mesh.opaque = chance(random, 50);
    const uint32_t count = 1 + below(random, boxes ? 5 : 32);
    for (uint32_t i = 0; i < count; ++i) {
        const check::Vec3 centre = point(random, 2);
        if (boxes) {
            const float size = between(random, 0.1f, 0.7f);
            mesh.boxes.push_back({centre[0] - size, centre[1] - size, centre[2] - size, centre[0] + size,
                                  centre[1] + size, centre[2] + size});
            continue;
        }
        for (int k = 0; k < 3; ++k) {
            const check::Vec3 offset = point(random, 1.5f);
            mesh.vertices.push_back({centre[0] + offset[0], centre[1] + offset[1], centre[2] + offset[2]});
        }
    }
    if (!boxes && limits.micromaps && chance(random, 70))
        mesh.micromap = randomMicromap(random, count, limits.maxLevel);
    return mesh;
}

// Turned, stretched, sometimes mirrored, moved.
VkTransformMatrixKHR randomTransform(Random &random)
{
    double x = 1, y = 0, z = 0, w = 0, length = 0;
    do {
        const check::Vec3 q = point(random, 1);
        x = double{q[0]}, y = double{q[1]}, z = double{q[2]}, w = double{between(random, -1, 1)};
        length = std::sqrt(x * x + y * y + z * z + w * w);
    } while (length < 0.1);
    x /= length, y /= length, z /= length, w /= length;
    const double rotation[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                                   {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                                   {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
    const check::Vec3 place = point(random, 2);
    VkTransformMatrixKHR out{};
    for (size_t c = 0; c < 3; ++c) {
        double scale = double{between(random, 0.5f, 1.8f)};
        if (chance(random, 20))
            scale = -scale;
        for (size_t r = 0; r < 3; ++r)
            out.matrix[r][c] = static_cast<float>(rotation[r][c] * scale);
    }
    for (size_t r = 0; r < 3; ++r)
        out.matrix[r][3] = place[r];
    return out;
}

Instance randomInstance(Random &random, uint32_t objects, const Limits &limits)
{
    Instance instance{};
    instance.object = below(random, objects);
    instance.transform = randomTransform(random);
    instance.customIndex = static_cast<uint32_t>(random()) & 0xffffffu;
    instance.mask = chance(random, 70) ? 0xff : below(random, 256);
    if (chance(random, 15))
        instance.flags |= VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR;
    if (chance(random, 15))
        instance.flags |= VK_GEOMETRY_INSTANCE_TRIANGLE_FLIP_FACING_BIT_KHR;
    if (chance(random, 20))
        instance.flags |= VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR;
    else if (chance(random, 20))
        instance.flags |= VK_GEOMETRY_INSTANCE_FORCE_NO_OPAQUE_BIT_KHR;
    if (limits.micromaps && chance(random, 25))
        instance.flags |= check::kFlagTwoState;
    if (limits.micromaps && chance(random, 15))
        instance.flags |= check::kFlagDisable;
    instance.inactive = chance(random, 4);
    return instance;
}

check::Ray randomRay(Random &random, const Limits &limits)
{
    check::Ray ray;
    ray.origin = point(random, 9);
    const check::Vec3 target = point(random, 2.5f);
    for (size_t i = 0; i < 3; ++i)
        ray.direction[i] = (target[i] - ray.origin[i]) * 0.2f;
    ray.tMin = chance(random, 50) ? 0 : between(random, 0, 5);
    ray.tMax = chance(random, 60) ? 1000 : between(random, 3, 12);
    constexpr std::array opacity{
        0u, 0u, check::kRayOpaque, check::kRayNoOpaque, check::kRayCullOpaque, check::kRayCullNoOpaque};
    ray.flags = opacity[below(random, opacity.size())];
    if (chance(random, 15))
        ray.flags |= check::kRayTerminateOnFirstHit;
    switch (below(random, 12)) {
    case 0: ray.flags |= check::kRayCullBack; break;
    case 1: ray.flags |= check::kRayCullFront; break;
    case 2: ray.flags |= check::kRaySkipBoxes; break;
    case 3:
        if (chance(random, 30))
            ray.flags |= check::kRaySkipTriangles;
        break;
    default: break;
    }
    if (limits.micromaps && chance(random, 25))
        ray.flags |= check::kRayForceTwoState;
    ray.cullMask = chance(random, 70) ? 0xff : below(random, 256);
    ray.rule = below(random, 3);
    ray.generate = chance(random, 60) ? 0 : between(random, ray.tMin + 0.001f, ray.tMax);
    return ray;
}

} // namespace

Scene randomScene(Random &random, const Limits &limits)
{
    Scene scene;
    const uint32_t objects = 1 + below(random, 5);
    for (uint32_t i = 0; i < objects; ++i) {
        Object object;
        const bool boxes = chance(random, 20);
        const uint32_t meshes = 1 + below(random, 3);
        for (uint32_t m = 0; m < meshes; ++m)
            object.meshes.push_back(randomMesh(random, boxes, limits));
        scene.objects.push_back(std::move(object));
    }
    const uint32_t instances = 1 + below(random, 10);
    for (uint32_t i = 0; i < instances; ++i)
        scene.instances.push_back(randomInstance(random, objects, limits));
    for (uint32_t i = 0; i < limits.rays; ++i)
        scene.rays.push_back(randomRay(random, limits));
    return scene;
}

} // namespace vellum::check::oracle
