// SPDX-License-Identifier: Apache-2.0
// Groups about ray tracing pipelines: how they are made, the binding tables, and the instructions that trace.
#include <array>

#include "check/case/names.h"
#include "check/case/trace.h"
#include "check/groups/random_case.h"

namespace vellum::check
{
namespace
{

using From = TracePlan::From;
using oracle::HitRecord;
using oracle::TablePlan;

template <class T, size_t N>
T oneOf(Random &random, const std::array<T, N> &values)
{
    return values[below(random, N)];
}

// A small scene for pipelines.
Limits pipelineScene(const DeviceLimits &limits, uint32_t rays)
{
    Limits scene = smallScene(limits);
    scene.rays = rays;
    scene.boxes = 35;
    return scene;
}

// A scene of these limits, traced by a pipeline.
Case pipelineCase(Random &random, const DeviceLimits &limits, const Limits &scene)
{
    Case c{.scene = makeScene(random, scene, limits), .trace = {.method = TracePlan::Method::Pipeline}};
    terminateSome(random, c.scene);
    for (Ray &ray : c.scene.rays)
        ray.flags |= chance(random, 15) ? kRaySkipClosestHit : 0;
    return c;
}

// Bits of TableBarrier, where tables are written over others.
uint32_t randomBarrier(Random &random, const TracePlan &trace, const DeviceLimits &limits)
{
    if (!trace.tablesInPlace)
        return 0;
    const uint32_t forTables = limits.maintenance && chance(random, 60) ? uint32_t{kBarrierForTables} : 0;
    return forTables | (chance(random, 40) ? uint32_t{kBarrierOfMemory} : 0);
}

LaunchPlan randomLaunch(Random &random, Launch command = Launch::Direct)
{
    LaunchPlan launch{.command = command};
    if (chance(random, 50))
        launch.height = 1 + below(random, 5), launch.depth = 1 + below(random, 4);
    launch.offset = command != Launch::Direct && chance(random, 50) ? below(random, 70) : 0;
    return launch;
}

uint32_t randomCreation(Random &random)
{
    return chance(random, 25) ? 1 + below(random, kCreateDeferred | kCreateCached | kCreateSeveral) : 0;
}

// Other structures in the pNext chains of pipelines, before or behind that of the flags.
void chainInfos(Random &random, TracePlan &trace, const DeviceLimits &limits)
{
    if (!chance(random, 50))
        return;
    trace.chained = below(random, allOf(kChainedNames) + 1) & limits.chained;
    trace.flags2 |= chance(random, 40);
}

HitAttributes randomAttributes(Random &random)
{
    return chance(random, 65) ? HitAttributes::Vec2 : static_cast<HitAttributes>(1 + below(random, 3));
}

From randomFrom(Random &random)
{
    return chance(random, 60) ? From::RayGeneration : chance(random, 50) ? From::ClosestHit : From::Miss;
}

// Parts that have every stage and group, each in a random one that may have it.
std::vector<PipelinePart> randomParts(Random &random, const TracePlan &trace, const DeviceLimits &limits)
{
    std::vector<PipelinePart> parts(2 + below(random, 4));
    const auto last = static_cast<uint32_t>(parts.size() - 1);
    for (uint32_t i = 0; i < last; ++i) {
        std::vector<uint32_t> &libraries = parts[chance(random, 50) ? last : i + 1 + below(random, last - i)].libraries;
        libraries.insert(libraries.begin() + below(random, static_cast<uint32_t>(libraries.size()) + 1), i);
    }
    const bool relay = trace.from != From::RayGeneration;
    constexpr auto kRelay = static_cast<uint32_t>(kTracerStageNames.size() - 1);
    const auto randomPart = [&]() -> PipelinePart & { return parts[below(random, last + 1)]; };
    const auto insert = [&](std::vector<uint32_t> &list, uint32_t value) {
        if (std::ranges::find(list, value) == list.end())
            list.insert(list.begin() + below(random, static_cast<uint32_t>(list.size()) + 1), value);
    };
    for (uint32_t stage = 0; stage < kRelay + (relay ? 1 : 0); ++stage) {
        const bool own = (stage == 0 || stage == kRelay) && limits.has(Fault::RayGenerationInLibrary);
        insert((own ? parts[last] : randomPart()).stages, stage);
        // Stages may be in several parts.
        if (stage >= 2 && stage != kRelay && chance(random, 40))
            insert(randomPart().stages, stage);
    }
    for (uint32_t group = 0; group < kTracerGroupNames.size() - (relay ? 0 : 1); ++group) {
        const std::vector<uint32_t> needed = stagesOfGroup(group);
        std::vector<PipelinePart *> able;
        for (PipelinePart &part : parts) {
            const std::vector<uint32_t> stages = stagesOf(parts, part);
            if (std::ranges::all_of(needed,
                                    [&](uint32_t stage) { return std::ranges::find(stages, stage) != stages.end(); }))
                able.push_back(&part);
        }
        insert(able[below(random, static_cast<uint32_t>(able.size()))]->groups, group);
    }
    // A library without libraries needs a stage.
    for (PipelinePart &part : parts)
        if (part.libraries.empty() && part.stages.empty())
            part.stages.push_back(2 + below(random, 4));
    if (trace.withoutMicromaps && chance(random, 50)) {
        // VUID-VkRayTracingPipelineCreateInfoKHR-flags-07403: what has the bit links only what has it.
        for (uint32_t i = 0; i < last; ++i)
            parts[i].micromapBit =
                limits.has(Fault::LayerMixedLibraries) ||
                (chance(random, 60) &&
                 std::ranges::all_of(parts[i].libraries, [&](uint32_t library) { return parts[library].micromapBit; }));
    }
    return parts;
}

// NO_NULL_... flags, and with `skip` SKIP_... flags, which go with the rays' flags.
VkPipelineCreateFlags randomFlags(Random &random, const Case &c, bool skip)
{
    VkPipelineCreateFlags flags = 0;
    constexpr std::array kNoNull{VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_ANY_HIT_SHADERS_BIT_KHR,
                                 VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_CLOSEST_HIT_SHADERS_BIT_KHR,
                                 VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_MISS_SHADERS_BIT_KHR,
                                 VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_INTERSECTION_SHADERS_BIT_KHR};
    for (const VkPipelineCreateFlags bit : kNoNull)
        if (chance(random, 30))
            flags |= bit;
    const auto none = [&](uint32_t bit) {
        return std::ranges::none_of(c.scene.rays, [&](const Ray &ray) { return (ray.flags & bit) != 0; });
    };
    if (skip && c.trace.from != From::ClosestHit && chance(random, 50) && none(kRaySkipBoxes))
        flags |= VK_PIPELINE_CREATE_RAY_TRACING_SKIP_TRIANGLES_BIT_KHR;
    else if (skip && chance(random, 30) && none(kRaySkipTriangles))
        flags |= VK_PIPELINE_CREATE_RAY_TRACING_SKIP_AABBS_BIT_KHR;
    if (c.trace.from == From::ClosestHit)
        flags &= ~VkPipelineCreateFlags{VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_ANY_HIT_SHADERS_BIT_KHR};
    return flags;
}

TraceParameters randomParameters(Random &random)
{
    return {.recordOffset = chance(random, 50) ? 0 : below(random, 16),
            .recordStride = chance(random, 50) ? 1 : below(random, 16),
            .missIndex = chance(random, 50) ? 0 : below(random, 12)};
}

TablePlan randomTable(Random &random, const PipelinePlan &pipeline)
{
    TablePlan table;
    constexpr VkPipelineCreateFlags kNoNullMiss = VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_MISS_SHADERS_BIT_KHR;
    const bool nulls = (pipeline.flags & allOf(kPipelineFlagNames) & ~kNoNullMiss) == 0;
    constexpr std::array kKinds{HitRecord::Full,          HitRecord::Full,
                                HitRecord::WithoutAnyHit, HitRecord::WithoutClosestHit,
                                HitRecord::WithoutBoth,   HitRecord::Null};
    if (!nulls || chance(random, 60))
        for (uint32_t i = 1 + below(random, 7); i > 0; --i)
            table.records.push_back(kKinds[below(random, nulls ? kKinds.size() : kKinds.size() - 1)]);
    table.misses = pipeline.parameters.missIndex + 1 + (chance(random, 30) ? below(random, 5) : 0);
    table.nullMiss = (pipeline.flags & kNoNullMiss) == 0 && chance(random, 10);
    table.content = oneOf(random, std::array{RecordData::None, RecordData::Word, RecordData::Words, RecordData::Words});
    table.layout = {.before = chance(random, 40) ? below(random, 9) : 0,
                    .reversed = chance(random, 40),
                    .missPadding = chance(random, 40) ? below(random, 6) : 0,
                    .hitPadding = chance(random, 50)   ? below(random, 6)
                                  : chance(random, 20) ? below(random, 64)
                                                       : 0,
                    .cut = chance(random, 40)};
    return table;
}

// Libraries in every arrangement.
Case pipelineLibraries(Random &random, const DeviceLimits &limits)
{
    Limits scene = pipelineScene(limits, 48);
    scene.micromaps = !chance(random, 15);
    Case c = pipelineCase(random, limits, scene);
    c.trace.withoutMicromaps = !scene.micromaps && chance(random, 80);
    c.trace.from = chance(random, 25) ? randomFrom(random) : From::RayGeneration;
    c.trace.inlineModules = chance(random, 30);
    c.trace.flags2 = chance(random, 30);
    c.trace.dynamicStackSize = chance(random, 20);
    c.trace.attributes = randomAttributes(random);
    c.trace.creation = randomCreation(random);
    if (chance(random, 20))
        c.trace.pipeline.flags = randomFlags(random, c, false);
    c.trace.pipeline.table = randomTable(random, c.trace.pipeline);
    c.trace.pipeline.parts = randomParts(random, c.trace, limits);
    chainInfos(random, c.trace, limits);
    return c;
}

// Ray tracing pipelines created by other commands and from libraries.
Case pipelinePlans(Random &random, const DeviceLimits &limits)
{
    Limits scene = pipelineScene(limits, 64);
    scene.micromaps = !chance(random, 20);
    Case c = pipelineCase(random, limits, scene);
    c.trace.byAddress = chance(random, 30);
    c.trace.inlineModules = chance(random, 30);
    c.trace.dynamicStackSize = chance(random, 20);
    c.trace.from = randomFrom(random);
    c.trace.flags2 = chance(random, 30);
    c.trace.unusedStage = chance(random, 20);
    c.trace.creation = randomCreation(random);
    c.trace.launch = randomLaunch(random);
    c.trace.attributes = randomAttributes(random);
    c.trace.callables = c.trace.from == From::RayGeneration && !c.trace.byAddress && chance(random, 30);
    c.trace.withoutMicromaps = !scene.micromaps && chance(random, 70);
    c.trace.pipeline.flags = randomFlags(random, c, true);
    c.trace.pipeline.table = randomTable(random, c.trace.pipeline);
    chainInfos(random, c.trace, limits);
    return c;
}

// The data of a hit record that rays reach begins with 0.
void zeroSome(Random &random, const oracle::Scene &scene, const TraceParameters &parameters, TablePlan &table)
{
    if (table.content == RecordData::None || !chance(random, 40))
        return;
    const oracle::Instance &instance = scene.instances[below(random, static_cast<uint32_t>(scene.instances.size()))];
    table.zeroData = instance.record.value_or(0) + (parameters.recordOffset & 15);
    if (chance(random, 70))
        table.content = RecordData::Word; // all of it is 0 then
}

// Tables, of which shaders read their records.
Case bindingTables(Random &random, const DeviceLimits &limits)
{
    Case c = pipelineCase(random, limits, pipelineScene(limits, 96));
    PipelinePlan &pipeline = c.trace.pipeline;
    pipeline.parameters = randomParameters(random);
    c.trace.from = chance(random, 15) ? From::Miss : From::RayGeneration;
    c.trace.callables = c.trace.from == From::RayGeneration && chance(random, 40);
    c.trace.launch = randomLaunch(random);
    setRecords(random, c);
    // A table that ends before the records of opaque hits whose closest-hit shaders rays skip.
    const bool shortTable = chance(random, 15);
    for (Ray &ray : c.scene.rays)
        if (shortTable)
            ray.flags = (ray.flags & (kRayTerminateOnFirstHit | kRayCullBack | kRayCullFront)) | kRayOpaque |
                        kRaySkipClosestHit | kRaySkipBoxes;
    const auto most = static_cast<uint32_t>(
        tableOf(c.scene, {.parameters = pipeline.parameters, .table = {.misses = 13}}).hit.size());
    for (uint32_t i = 1 + below(random, 3); i > 0; --i) {
        TablePlan table = randomTable(random, pipeline);
        if (shortTable)
            table.length = chance(random, 40) ? 0 : below(random, most + 1);
        else if (chance(random, 30))
            table.length = most + below(random, 20);
        zeroSome(random, c.scene, pipeline.parameters, table);
        if (c.trace.pipeline.table == TablePlan())
            pipeline.table = table;
        else
            pipeline.otherTables.push_back(table);
    }
    c.trace.tablesInPlace = !pipeline.otherTables.empty() && chance(random, 30);
    pipeline.table.layout.otherStride = chance(random, 30);
    // One record for all hits, which are then all on triangles.
    if (chance(random, 15)) {
        const auto triangles =
            std::ranges::find_if(c.scene.objects, [](const oracle::Object &object) { return !object.hasBoxes(); });
        for (oracle::Instance &instance : c.scene.instances)
            if (triangles != c.scene.objects.end() && c.scene.objects[instance.object].hasBoxes())
                instance.object = static_cast<uint32_t>(triangles - c.scene.objects.begin());
        pipeline.table.layout.zeroStride = true;
        pipeline.table.length.reset();
    }
    c.trace.tableBarrier = randomBarrier(random, c.trace, limits);
    c.trace.rerecorded = chance(random, 20);
    return c;
}

// Ray flags, and the other parameters of traceRayEXT, from everywhere.
Case pipelineRayFlags(Random &random, const DeviceLimits &limits)
{
    Limits scene = pipelineScene(limits, 64);
    if (chance(random, 15)) { // many geometries of boxes, of which some are opaque
        scene.boxes = 100;
        scene.meshes = 32;
    }
    Case c = pipelineCase(random, limits, scene);
    c.trace.byAddress = chance(random, 30);
    c.trace.signedFlags = chance(random, 20);
    c.trace.from = randomFrom(random);
    c.trace.pipeline.parameters = randomParameters(random);
    c.trace.pipeline.table.misses = c.trace.pipeline.parameters.missIndex + 1;
    setRecords(random, c);
    using Flags = TracePlan::Flags;
    c.trace.flags =
        oneOf(random, std::array{Flags::RunTime, Flags::Specialized, Flags::Literal, Flags::Mixed, Flags::Computed});
    if (c.trace.flags == Flags::Specialized || c.trace.flags == Flags::Literal) {
        setConstantFlags(random, c.scene);
    } else if (c.trace.flags == Flags::Mixed) {
        for (Ray &ray : c.scene.rays)
            ray.flags = chance(random, 60) ? c.scene.rays[0].flags : ray.flags;
    }
    selectFlags(random, c, 40);
    return c;
}

// Several pipelines and tables at a time.
Case severalPipelines(Random &random, const DeviceLimits &limits)
{
    Case c = pipelineCase(random, limits, pipelineScene(limits, 32));
    c.trace.from = chance(random, 20) ? randomFrom(random) : From::RayGeneration;
    c.trace.tablesInPlace = chance(random, 40);
    c.trace.maintenance6 = limits.maintenance6 && chance(random, 20);
    const auto randomPipeline = [&] {
        PipelinePlan pipeline;
        if (chance(random, 30))
            pipeline.flags = randomFlags(random, c, true);
        pipeline.parameters = randomParameters(random);
        pipeline.table = randomTable(random, pipeline);
        if (chance(random, c.trace.tablesInPlace ? 90 : 40)) {
            TablePlan other = randomTable(random, pipeline);
            // Only the groups and data of records differ, so that each record is at the same address.
            if (c.trace.tablesInPlace) {
                other.content = pipeline.table.content;
                other.misses = pipeline.table.misses;
                other.layout = pipeline.table.layout;
            }
            pipeline.otherTables.push_back(other);
        }
        if (chance(random, 20))
            pipeline.parts = randomParts(random, c.trace, limits);
        return pipeline;
    };
    c.trace.pipeline = randomPipeline();
    for (uint32_t i = 1 + (chance(random, 20) ? 1 : 0); i > 0; --i)
        c.trace.otherPipelines.push_back(randomPipeline());
    c.trace.firstDestroyed = chance(random, 50);
    c.trace.twice = chance(random, 20);
    c.trace.rerecorded = chance(random, 30);
    c.trace.creation = randomCreation(random);
    c.trace.launch = randomLaunch(random);
    c.trace.dynamicStackSize = chance(random, 20);
    setRecords(random, c);
    c.trace.tableBarrier = randomBarrier(random, c.trace, limits);
    return c;
}

// Rays whose number and tables are read by the device.
Case indirectTraces(Random &random, const DeviceLimits &limits)
{
    Case c = pipelineCase(random, limits, pipelineScene(limits, 160));
    c.trace.secondary = chance(random, 30);
    c.trace.launch = randomLaunch(random, chance(random, 50) ? Launch::Indirect : Launch::Indirect2);
    c.trace.pipeline.parameters = randomParameters(random);
    setRecords(random, c);
    c.trace.pipeline.table = randomTable(random, c.trace.pipeline);
    c.trace.pipeline.table.layout.hitPadding = chance(random, 60) ? below(random, 8) : 0;
    c.trace.from = chance(random, 15) ? From::ClosestHit : From::RayGeneration;
    c.trace.callables = c.trace.from == From::RayGeneration && chance(random, 50);
    return c;
}

constexpr std::array kPipelinesGroups{
    Group{"pipeline-plans",
          "ray tracing pipelines with inline modules, stack sizes, recursion, callable shaders, hit attributes of "
          "several types and create flags, which "
          "skip triangles or promise shaders, in the create info or in a structure of its own; created by deferred "
          "operations, with caches, several at once, with feedback and robustness",
          "vkCreateRayTracingPipelinesKHR; VkPipelineCreateFlags2CreateInfo, VkPipelineCreationFeedbackCreateInfo, "
          "VkPipelineRobustnessCreateInfo: pNext; VK_PIPELINE_CREATE_RAY_TRACING_OPACITY_MICROMAP_BIT_KHR, "
          "..._SKIP_TRIANGLES_BIT_KHR, ..._SKIP_AABBS_BIT_KHR, ..._NO_NULL_..._SHADERS_BIT_KHR; "
          "IncomingRayFlagsKHR: \"Setting pipeline flags on the ray tracing pipeline must not cause any corresponding "
          "flags to be set\"",
          200, runGroup<pipelinePlans>, 30},
    Group{
        "pipeline-libraries",
        "pipelines of libraries, nested or not, whose groups name stages of libraries, among shaders that must not run",
        "VkRayTracingPipelineCreateInfoKHR: shaders and groups of pLibraryInfo \"are treated as if they were defined "
        "as additional entries in pStages\" and pGroups",
        150, runGroup<pipelineLibraries>, 24},
    Group{
        "binding-tables",
        "binding tables with callable records, zero records, with and without data and with data of 0, short and long "
        "ones, at offsets and with strides, also after one with another stride, in command buffers that are recorded "
        "again; "
        "record offsets of instances beyond 2^8",
        "Shader Binding Table, Indexing Rules; VkStridedDeviceAddressRegionKHR; ShaderRecordBufferKHR; \"A zero shader "
        "group behaves as though it is a shader group consisting entirely of VK_SHADER_UNUSED_KHR\"",
        200, runGroup<bindingTables>, 30},
    Group{"pipeline-ray-flags",
          "ray flags of traceRayEXT at run time, specialized, literal, selected, computed, and of two instructions",
          "OpTraceRayKHR: Ray Flags, SBT Offset, SBT Stride, Miss Index; IncomingRayFlagsKHR", 150,
          runGroup<pipelineRayFlags>, 50},
    Group{"several-pipelines",
          "two or three pipelines with several tables in one command buffer, of which the first is destroyed; tables "
          "that are written between traces, with barriers of their buffer or of all memory",
          "vkCmdBindPipeline; vkCmdTraceRaysKHR; vkDestroyPipeline; VK_ACCESS_2_SHADER_READ_BIT, "
          "VK_ACCESS_2_SHADER_BINDING_TABLE_READ_BIT_KHR",
          80, runGroup<severalPipelines>, 20},
    Group{"indirect-traces", "pipelines whose rays are traced by indirect commands, with hit tables of several strides",
          "vkCmdTraceRaysIndirectKHR, vkCmdTraceRaysIndirect2KHR; VkTraceRaysIndirectCommand2KHR; Hit Shader Table",
          120, runGroup<indirectTraces>, 24},
};

} // namespace

std::span<const Group> pipelineGroups()
{
    return kPipelinesGroups;
}

std::span<const MakeCase> pipelineMakers()
{
    static constexpr std::array kMakers{pipelinePlans,    pipelineLibraries, bindingTables,
                                        pipelineRayFlags, severalPipelines,  indirectTraces};
    return kMakers;
}

} // namespace vellum::check
