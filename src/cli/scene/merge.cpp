// SPDX-License-Identifier: Apache-2.0
#include "cli/scene/merge.h"

#include <algorithm>
#include <cmath>

namespace vellum::cli
{
namespace
{

bool flattens(const Transform &m)
{
    double volume = 1; // if the axes were at right angles
    for (size_t column = 0; column < 3; ++column)
        volume *= std::hypot(static_cast<double>(m[0][column]), static_cast<double>(m[1][column]),
                             static_cast<double>(m[2][column]));
    return !(std::abs(determinant(m)) > 1e-9 * volume);
}

// Mirrored meshes stay apart: their triangles wind the other way round in the world.
bool merges(const MeshInstance &instance, const std::vector<uint32_t> &counts)
{
    return counts[instance.mesh] == 1 && (determinant(instance.transform) > 0 || flattens(instance.transform));
}

std::vector<uint32_t> countInstances(const Scene &scene)
{
    std::vector<uint32_t> counts(scene.meshes.size());
    for (const MeshInstance &instance : scene.instances)
        ++counts[instance.mesh];
    return counts;
}

} // namespace

void mergeSingleMeshes(Scene &scene)
{
    std::vector<uint32_t> counts = countInstances(scene);
    std::erase_if(scene.instances, [&](const MeshInstance &i) { return counts[i.mesh] > 1 && flattens(i.transform); });
    counts = countInstances(scene);

    std::vector<Geometry> geometries;
    const auto take = [&](const Mesh &mesh) {
        for (uint32_t i = 0; i < mesh.geometryCount; ++i)
            geometries.push_back(std::move(scene.geometries[mesh.firstGeometry + i]));
    };
    std::vector<MeshInstance> instances;
    for (const MeshInstance &instance : scene.instances) {
        if (!merges(instance, counts))
            continue;
        counts[instance.mesh] = 0; // has gone
        const size_t first = geometries.size();
        take(scene.meshes[instance.mesh]);
        for (size_t i = first; i < geometries.size() && instance.transform != kInPlace; ++i)
            for (Vec3 &position : geometries[i].positions)
                position = transformed(instance.transform, position);
    }
    std::vector<Mesh> meshes;
    if (!geometries.empty()) {
        meshes.push_back({0, static_cast<uint32_t>(geometries.size())});
        instances.push_back({0, kInPlace});
    }
    std::vector<uint32_t> moved(scene.meshes.size());
    for (size_t i = 0; i < scene.meshes.size(); ++i) {
        if (counts[i] == 0)
            continue;
        moved[i] = static_cast<uint32_t>(meshes.size());
        meshes.push_back({static_cast<uint32_t>(geometries.size()), scene.meshes[i].geometryCount});
        take(scene.meshes[i]);
    }
    for (const MeshInstance &instance : scene.instances)
        if (counts[instance.mesh] != 0)
            instances.push_back({moved[instance.mesh], instance.transform});
    scene.geometries = std::move(geometries);
    scene.meshes = std::move(meshes);
    scene.instances = std::move(instances);
}

} // namespace vellum::cli
