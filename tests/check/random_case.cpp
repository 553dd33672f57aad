// SPDX-License-Identifier: Apache-2.0
#include "random_case.h"

#include "check/case/case.h"
#include "check/case/trace.h"
#include "check/groups/random_case.h"

using namespace vellum::check;

Case randomCase(uint32_t seed, uint32_t rays)
{
    Random random(seed);
    const Limits limits{.rays = rays,
                        .byteIndices = true,
                        .lossy = true,
                        .oddStrides = true,
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
               .conditional = static_cast<Conditional>(below(random, 4)),
               .spareTriangles = below(random, 3),
               .spareInstances = below(random, 3),
               .skippedInstances = below(random, 3)};
    c.build.otherTop = !c.build.single && yes();
    c.build.unrelated = yes();
    c.build.secondary = yes();
    c.build.twice = yes();
    c.build.mixed = c.build.together && yes();
    c.build.sharedInputs = yes();
    c.build.aliasedInputs = yes();
    c.build.lateInputs = c.memory == Memory::Apart && yes();
    c.build.rerecorded = yes();
    c.build.backwards = c.build.single && yes();
    c.build.secondDevice = c.build.threads == 1 && yes();
    for (uint32_t i = c.build.single ? 0 : below(random, 3); i > 0; --i)
        if (auto plan = randomQueries(random, c.scene, device))
            c.queries.push_back(std::move(*plan));
    buildableOnHost(c.scene);
    for (Step &step : c.steps) {
        step.host = targetOf(step.kind) == Target::Micromap && yes();
        step.deferred = step.host && yes();
    }
    c.trace = {.method = static_cast<TracePlan::Method>(below(random, 2)),
               .stage = kQueryStages[below(random, kQueryStages.size())],
               .flags = static_cast<TracePlan::Flags>(below(random, 4)),
               .mode = static_cast<TracePlan::Mode>(below(random, 6)),
               .byAddress = yes(),
               .inlineModules = yes(),
               .besideBuild = yes(),
               .boundFirst = yes(),
               .pipelineLast = yes(),
               .maintenance6 = yes(),
               .twice = yes(),
               .signedFlags = yes(),
               .tablesInPlace = yes(),
               .tableBarrier = below(random, 4),
               .dynamicStackSize = yes(),
               .from = static_cast<TracePlan::From>(below(random, 3)),
               .flags2 = yes(),
               .chained = below(random, 8),
               .unusedStage = yes(),
               .launch = {.command = static_cast<Launch>(below(random, 3)), .height = 1 + below(random, 3)},
               .attributes = static_cast<HitAttributes>(below(random, 4)),
               .creation = below(random, 8),
               .withoutMicromaps = yes()};
    if (c.trace.stage == VK_SHADER_STAGE_COMPUTE_BIT && !c.trace.byAddress) {
        c.trace.query = static_cast<TracePlan::Query>(below(random, 8));
        c.trace.optimized =
            c.trace.method == TracePlan::Method::Query && c.trace.flags == TracePlan::Flags::RunTime && yes();
    }
    if (c.trace.stage != VK_SHADER_STAGE_TASK_BIT_EXT)
        c.trace.otherEntry = static_cast<OtherEntry>(below(random, 4));
    using oracle::HitRecord;
    const auto table = [&] {
        oracle::TablePlan made{.misses = 1 + below(random, 3),
                               .nullMiss = yes(),
                               .content = yes() ? RecordData::Word : RecordData::Words,
                               .zeroData = yes() ? std::optional(below(random, 9)) : std::nullopt,
                               .layout = {.before = below(random, 3),
                                          .reversed = yes(),
                                          .missPadding = below(random, 3),
                                          .hitPadding = below(random, 3),
                                          .cut = yes(),
                                          .otherStride = yes()}};
        for (uint32_t i = below(random, 4); i > 0; --i)
            made.records.push_back(static_cast<HitRecord>(below(random, 5)));
        return made;
    };
    const auto pipeline = [&] {
        PipelinePlan made{.table = table()};
        if (yes())
            made.parts = {{{3, 2, 9}, {2, 3}},
                          {{5, 1, 4, 7, 6, 8, 10}, {4, 6, 7, 10, 12}, {0}},
                          {{0, 10}, {0, 1, 5, 8, 9, 11, 13, 14}, {1}}};
        if (yes())
            made.otherTables.push_back(table());
        return made;
    };
    c.trace.pipeline = pipeline();
    if (yes())
        c.trace.otherPipelines.push_back(pipeline());
    c.trace.firstDestroyed = !c.trace.otherPipelines.empty() && yes();
    // Parts have the stage and the group of the shader that traces in recursion where there is one.
    for (PipelinePlan *each :
         {&c.trace.pipeline, c.trace.otherPipelines.empty() ? nullptr : &c.trace.otherPipelines[0]})
        for (size_t i = 0; each != nullptr && c.trace.from == TracePlan::From::RayGeneration && i < each->parts.size();
             ++i) {
            std::erase(each->parts[i].stages, 10u);
            std::erase(each->parts[i].groups, 14u);
        }
    c.trace.rebound = c.trace.stage == VK_SHADER_STAGE_COMPUTE_BIT && yes();
    c.trace.vertexBuffers = c.trace.stage == VK_SHADER_STAGE_VERTEX_BIT && !c.trace.byAddress &&
                            c.trace.flags == TracePlan::Flags::RunTime && yes();
    c.trace.shaderObjects = c.trace.stage == VK_SHADER_STAGE_COMPUTE_BIT && !c.trace.inlineModules && yes();
    if (!c.build.single && yes())
        c.addressCopies = randomAddressCopies(random);
    return c;
}
