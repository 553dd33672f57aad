// SPDX-License-Identifier: Apache-2.0
#include "random_case.h"

using namespace vellum::check;

namespace
{

using oracle::Random;
using Kind = Step::Kind;

uint32_t below(Random &random, size_t n)
{
    return static_cast<uint32_t>(random() % n);
}

// As many triangles as before.
std::vector<oracle::MicromapTriangle> otherStates(Random &random, size_t count)
{
    std::vector<oracle::MicromapTriangle> triangles;
    for (size_t i = 0; i < count; ++i)
        triangles.push_back(oracle::randomTriangle(random, 4));
    return triangles;
}

void addStep(Random &random, Case &c, const oracle::Limits &limits)
{
    oracle::Scene &scene = c.scene;
    Step step{.kind = static_cast<Kind>(below(random, static_cast<size_t>(Kind::Count)))};
    step.update = below(random, 2) == 0;
    if (step.kind >= Kind::CloneMicromap && step.kind <= Kind::SetStates) {
        if (scene.micromaps.empty())
            return;
        step.target = below(random, scene.micromaps.size());
        if (step.kind == Kind::CompactMicromap)
            scene.micromaps[step.target].flags |= VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
        if (step.kind == Kind::SetStates)
            step.states = otherStates(random, scene.micromaps[step.target].triangles.size());
    } else if (step.kind < Kind::CloneTop) {
        step.target = below(random, scene.objects.size());
        const oracle::Object &object = scene.objects[step.target];
        if (step.kind == Kind::MoveObject)
            step.other = below(random, scene.objects.size());
        if (step.kind == Kind::SetIndices) {
            step.other = below(random, object.meshes.size());
            const oracle::Mesh &mesh = object.meshes[step.other];
            if (!mesh.boxes.empty() || scene.micromaps.empty())
                return;
            step.micromapUse =
                oracle::randomUse(random, scene, static_cast<uint32_t>(mesh.vertices.size() / 3), limits);
        }
    }
    c.steps.push_back(step);
}

} // namespace

Case randomCase(uint32_t seed, uint32_t rays)
{
    Random random(seed);
    const oracle::Limits limits{.rays = rays, .byteIndices = true, .lossy = true};
    Case c{.group = "random", .seed = (uint64_t{random()} << 32) | random()};
    c.scene = oracle::randomScene(random, limits);
    const uint32_t steps = below(random, 12);
    for (uint32_t i = 0; i < steps; ++i)
        addStep(random, c, limits);
    const auto yes = [&] { return below(random, 2) == 0; };
    constexpr std::array stages{VK_SHADER_STAGE_COMPUTE_BIT, VK_SHADER_STAGE_VERTEX_BIT, VK_SHADER_STAGE_FRAGMENT_BIT,
                                VK_SHADER_STAGE_RAYGEN_BIT_KHR};
    c.memory = static_cast<Memory>(below(random, 3));
    c.build = {.micromaps = yes() ? BuildCommand::Device : BuildCommand::Host,
               .structures = yes() ? BuildCommand::Device : BuildCommand::Indirect,
               .together = yes(),
               .threads = 1 + below(random, 4),
               .instancePointers = yes()};
    c.trace = {.method = static_cast<TracePlan::Method>(below(random, 2)),
               .stage = stages[below(random, stages.size())],
               .flags = static_cast<TracePlan::Flags>(below(random, 2)),
               .mode = static_cast<TracePlan::Mode>(below(random, 3)),
               .besideBuild = yes(),
               .libraries = yes(),
               .inlineModules = yes(),
               .dynamicStackSize = yes()};
    if (c.trace.flags == TracePlan::Flags::Specialized)
        for (Ray &ray : c.scene.rays)
            ray.flags = c.scene.rays[0].flags;
    return c;
}
