// SPDX-License-Identifier: Apache-2.0
#include "check/case/case.h"

#include <cmath>
#include <utility>

namespace vellum::check
{

Target targetOf(Step::Kind kind)
{
    if (kind >= Step::Kind::CloneTop)
        return Target::Top;
    return kind >= Step::Kind::CloneMicromap && kind <= Step::Kind::SetStates ? Target::Micromap : Target::Object;
}

bool isUpdated(const Step &step, uint32_t object, const oracle::Scene &scene)
{
    using Kind = Step::Kind;
    switch (step.kind) {
    case Kind::UpdateObject: return step.target == object;
    case Kind::RebuildObjects:
    case Kind::SetIndices: return step.update && step.target == object;
    case Kind::CloneMicromap:
    case Kind::CompactMicromap:
    case Kind::ReloadMicromap:
    case Kind::SetStates: return step.update && scene.objects[object].uses(step.target);
    default: return false;
    }
}

namespace
{

void mirror(oracle::Object &object)
{
    for (oracle::Mesh &mesh : object.meshes) {
        const VertexFormat format = vertexFormat(mesh.layout.vertexFormat);
        for (Vec3 &vertex : mesh.vertices)
            if (!std::isnan(vertex[0]))
                vertex = quantized(mesh.layout.vertexFormat,
                                   {format.isUnsigned() ? 1 - vertex[0] : -vertex[0], vertex[1], vertex[2]});
        for (VkAabbPositionsKHR &box : mesh.boxes)
            if (!std::isnan(box.minX))
                box.minX = -std::exchange(box.maxX, -box.minX);
    }
}

} // namespace

void applyTo(oracle::Scene &scene, const Step &step)
{
    if (step.mirrored)
        mirror(scene.objects[step.target]);
    if (step.kind == Step::Kind::ReplaceObject) {
        const oracle::Object other = scene.objects[step.other];
        scene.objects[step.target].meshes = other.meshes;
        scene.objects[step.target].geometryPointers = other.geometryPointers;
    }
    if (step.kind == Step::Kind::SetStates)
        scene.micromaps[step.target].triangles = step.states;
    else if (step.kind == Step::Kind::SetIndices)
        scene.objects[step.target].meshes[step.other].micromap = step.micromapUse;
    else if (step.kind == Step::Kind::UpdateTop || step.kind == Step::Kind::RebuildTop)
        scene.instances = step.instances;
}

oracle::Scene sceneAfter(const Case &c)
{
    oracle::Scene scene = c.scene;
    for (const Step &step : c.steps)
        applyTo(scene, step);
    return scene;
}

} // namespace vellum::check
