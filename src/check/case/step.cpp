// SPDX-License-Identifier: Apache-2.0
#include "check/case/step.h"

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

void applyTo(oracle::Scene &scene, const Step &step)
{
    if (step.kind == Step::Kind::SetStates)
        scene.micromaps[step.target].triangles = step.states;
    else if (step.kind == Step::Kind::SetIndices)
        scene.objects[step.target].meshes[step.other].micromap = step.micromapUse;
    else if (step.kind == Step::Kind::UpdateTop)
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
