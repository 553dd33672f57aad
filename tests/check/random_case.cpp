// SPDX-License-Identifier: Apache-2.0
#include "random_case.h"

#include "check/case/step.h"
#include "check/case/trace.h"
#include "check/groups/random_case.h"

using namespace vellum::check;

Case randomCase(uint32_t seed, uint32_t rays)
{
    Random random(seed);
    const Limits limits{.rays = rays,
                        .byteIndices = true,
                        .lossy = true,
                        .unusual = 50,
                        .formats = {kVertexFormats.begin(), kVertexFormats.end()}};
    Case c{.group = "random", .seed = (uint64_t{random()} << 32) | random()};
    c.scene = oracle::randomScene(random, limits);
    const auto yes = [&] { return below(random, 2) == 0; };
    const DeviceLimits device{.api = yes() ? Api::Ext : Api::Khr,
                              .byteIndices = true,
                              .hostCommands = true,
                              .hostReset = true,
                              .maintenance = true,
                              .dataAccess = true,
                              .maxLevel2 = 12,
                              .maxLevel4 = 12,
                              .maxLossyLevel = 12};
    varyBuilds(random, c.scene, device);
    std::array<Step::Kind, static_cast<size_t>(Step::Kind::Count)> kinds{};
    for (size_t i = 0; i < kinds.size(); ++i)
        kinds[i] = static_cast<Step::Kind>(i);
    addSteps(random, c, kinds, below(random, 12), device);
    c.memory = static_cast<Memory>(below(random, 3));
    c.build = {.micromaps = yes() ? BuildCommand::Device : BuildCommand::Host,
               .structures = yes() ? BuildCommand::Device : BuildCommand::Indirect,
               .together = yes(),
               .threads = 1 + below(random, 4),
               .instancePointers = yes(),
               .geometryPointers = yes(),
               .single = c.steps.empty() && yes(),
               .conditional = yes(),
               .spareTriangles = below(random, 3),
               .spareInstances = below(random, 3)};
    c.build.mixed = c.build.together && yes();
    for (uint32_t i = c.build.single ? 0 : below(random, 3); i > 0; --i)
        if (auto plan = randomQueries(random, c.scene, device))
            c.queries.push_back(std::move(*plan));
    for (Step &step : c.steps) {
        step.host = targetOf(step.kind) == Target::Micromap && yes();
        step.deferred = step.host && yes();
    }
    c.trace = {.method = static_cast<TracePlan::Method>(below(random, 2)),
               .stage = kQueryStages[below(random, kQueryStages.size())],
               .flags = static_cast<TracePlan::Flags>(below(random, 3)),
               .mode = static_cast<TracePlan::Mode>(below(random, 4)),
               .byAddress = yes(),
               .inlineModules = yes(),
               .besideBuild = yes(),
               .boundFirst = yes(),
               .libraries = static_cast<TracePlan::Libraries>(below(random, 4)),
               .dynamicStackSize = yes(),
               .recursion = yes(),
               .flags2 = yes(),
               .unusedStage = yes(),
               .launch = static_cast<Launch>(below(random, 3)),
               .recordPadding = below(random, 3),
               .withoutMicromaps = yes()};
    c.trace.queryArray = c.trace.stage == VK_SHADER_STAGE_COMPUTE_BIT && c.trace.flags == TracePlan::Flags::RunTime &&
                         !c.trace.byAddress;
    return c;
}
