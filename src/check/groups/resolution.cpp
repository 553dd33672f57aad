// SPDX-License-Identifier: Apache-2.0
// Groups about what rays meet: the opacity of a hit by micromap, geometry, instance and ray.
#include <array>

#include "check/case/trace.h"
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

// One object in one instance without a transform.
oracle::Scene rowScene(Random &random)
{
    oracle::Scene scene;
    // Rays meet the middle of micro-triangles, which is 8e-5 away from their edges at level 12.
    scene.edge = 4e-5f;
    scene.objects.resize(1);
    scene.instances = {instanceInPlace(random)};
    return scene;
}

// Adds a row of right-angled triangles in the plane z = 0, and rays that meet them at the centres of micro-triangles of
// that level.
void addRow(Random &random, oracle::Scene &scene, uint32_t triangles, uint32_t level, uint32_t raysOfEach)
{
    oracle::Mesh &mesh = scene.objects[0].meshes.emplace_back();
    mesh.opaque = chance(random, 50);
    const auto y = 1.5f * static_cast<float>(scene.objects[0].meshes.size() - 1);
    for (uint32_t t = 0; t < triangles; ++t) {
        const float x = 1.5f * static_cast<float>(t);
        appendTriangle(mesh.vertices, {x, y, 0});
        aimAt(random, scene, {x, y, 0}, level, raysOfEach);
    }
}

// A few triangles with fine micromaps of both formats, up to the limits of the device.
Case levels(Random &random, const DeviceLimits &limits)
{
    Case c{.scene = rowScene(random)};
    const bool two = chance(random, 50);
    const uint32_t most = two ? limits.maxLevel2 : limits.maxLevel4;
    const uint32_t level = chance(random, 20) ? most : below(random, std::min(most, 9u) + 1);
    const uint32_t triangles = level > 9 ? 1 : 4;
    oracle::SceneMicromap &micromap = c.scene.micromaps.emplace_back();
    constexpr std::array<VkBuildMicromapFlagsEXT, 4> flags{0, VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT,
                                                           VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT,
                                                           VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT};
    micromap.flags = flags[below(random, flags.size())];
    for (uint32_t i = 0; i < triangles; ++i) {
        const uint16_t format = i % 2 == (two ? 0u : 1u) ? kTwoState : kFourState;
        micromap.triangles.push_back(oracle::mixedTriangle(
            random, std::min(level, format == kTwoState ? limits.maxLevel2 : limits.maxLevel4), format));
    }
    addRow(random, c.scene, triangles, level, 48);
    oracle::MeshMicromap &use = c.scene.objects[0].meshes[0].micromap.emplace();
    use.micromap = 0;
    for (uint32_t i = 0; i < triangles; ++i)
        use.indices.push_back(static_cast<int32_t>(i));
    varyBuilds(random, c.scene, limits);
    return c;
}

// Every type of index with every special index, stride, offset and base, also of null micromaps.
Case indices(Random &random, const DeviceLimits &limits)
{
    Case c{.scene = rowScene(random)};
    // Many triangles, so that some have indices whose low bits are those of special indices of smaller types.
    oracle::SceneMicromap &micromap = c.scene.micromaps.emplace_back();
    const uint32_t count = chance(random, 50) ? 12 : 700;
    for (uint32_t i = 0; i < count; ++i)
        micromap.triangles.push_back(oracle::randomTriangle(random, count < 100 ? 3 : 1));
    for (uint32_t m = 0; m < 3; ++m) {
        const uint32_t triangles = 4 + below(random, 8);
        addRow(random, c.scene, triangles, 4, 4);
        std::optional<oracle::MeshMicromap> &use = c.scene.objects[0].meshes.back().micromap;
        if (chance(random, 85))
            use = oracle::randomUse(random, c.scene, triangles, {.byteIndices = limits.byteIndices});
        // 0xfc to 0xff are special in indices of 8 bits only.
        if (use && use->micromap && use->base < 100 && count > 600 && use->indexType != VK_INDEX_TYPE_NONE_KHR &&
            use->indexType != VK_INDEX_TYPE_UINT8_EXT) {
            for (int32_t &index : use->indices)
                index = index >= 0 && chance(random, 40) ? static_cast<int32_t>(0xfc + below(random, 4)) : index;
        }
    }
    varyBuilds(random, c.scene, limits);
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
    else if (chance(random, 40))
        fixFlags(random, c);
    selectFlags(random, c, 15);
    return c;
}

oracle::Scene lossyRow(Random &random, const DeviceLimits &limits)
{
    oracle::Scene scene = rowScene(random);
    oracle::SceneMicromap &micromap = scene.micromaps.emplace_back();
    const uint32_t kind = below(random, 100);
    const uint32_t level = std::min(kind < 75   ? below(random, 7)
                                    : kind < 97 ? 7 + below(random, 3)
                                                : 10 + below(random, 3),
                                    limits.maxLossyLevel);
    const uint32_t triangles = level > 9 ? 1 : level > 6 ? 2 : 6;
    for (uint32_t i = 0; i < triangles; ++i)
        micromap.triangles.push_back(chance(random, 80) ? patchyTriangle(random, level, below(random, level + 1))
                                                        : oracle::mixedTriangle(random, level, kFourState));
    constexpr std::array<VkBuildMicromapFlagsEXT, 3> flags{0, VK_BUILD_MICROMAP_PREFER_FAST_TRACE_BIT_EXT,
                                                           VK_BUILD_MICROMAP_PREFER_FAST_BUILD_BIT_EXT};
    micromap.flags = kLossy | flags[below(random, flags.size())];
    if (chance(random, 60))
        micromap.flags |= VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
    addRow(random, scene, triangles, level, 48);
    scene.objects[0].meshes[0].micromap =
        oracle::randomUse(random, scene, triangles, {.byteIndices = limits.byteIndices});
    // Instances behind each other, so that rays meet several hits of which most are not known.
    for (uint32_t i = chance(random, 40) ? 5 + below(random, 3) : 1; i > 1; --i) {
        scene.instances.push_back(instanceInPlace(random));
        scene.instances.back().transform.matrix[2][3] = -0.5f * static_cast<float>(i);
        if (chance(random, 20))
            scene.instances.back().flags = kFlagTwoState;
    }
    return scene;
}

// Lossy micromaps that are built by every command, copied, and built again.
Case lossy(Random &random, const DeviceLimits &limits)
{
    Case c;
    const bool row = chance(random, 70);
    if (row) {
        c.scene = lossyRow(random, limits);
    } else {
        Limits scene = smallScene(limits);
        scene.lossy = true;
        c.scene = makeScene(random, scene, limits);
    }
    c.build.together = chance(random, 30);
    c.build.instancePointers = chance(random, 20);
    c.build.threads = c.build.together || chance(random, 70) ? 1 : 2 + below(random, 3);
    if (limits.indirectBuilds && chance(random, 20))
        c.build.structures = BuildCommand::Indirect;
    constexpr std::array memories{Memory::Apart, Memory::Apart, Memory::Packed, Memory::PackedToTheEnd};
    c.memory = memories[below(random, memories.size())];
    if (limits.pipelines && chance(random, 25))
        c.trace.method = TracePlan::Method::Pipeline;
    using Kind = Step::Kind;
    constexpr std::array steps{
        Kind::CloneMicromap,   Kind::CompactMicromap, Kind::ReloadMicromap, Kind::CloneMicromap,
        Kind::CompactMicromap, Kind::ReloadMicromap,  Kind::SetStates,      Kind::SetIndices,
        Kind::CloneObject,     Kind::CompactObject,   Kind::ReloadObject,   Kind::UpdateObject,
        Kind::RebuildObject,   Kind::MoveObject,      Kind::RenameObject,   Kind::RebuildObjects};
    addSteps(random, c, steps, chance(random, 30) ? 0 : 1 + below(random, 3), limits);
    for (Step &step : c.steps)
        step.mirrored &= !row; // its rays would miss
    c.build.single = c.steps.empty() && c.build.structures == BuildCommand::Device && chance(random, 30);
    return c;
}

OtherEntry otherEntry(Random &random, VkShaderStageFlagBits stage, uint32_t percent)
{
    if (!chance(random, percent))
        return OtherEntry::None;
    if (stage == VK_SHADER_STAGE_TASK_BIT_EXT || chance(random, 40))
        return OtherEntry::Empty;
    return chance(random, 50) ? OtherEntry::SharedBefore : OtherEntry::SharedAfter;
}

// In half of the cases with a specialized execution mode, it is computed from specialization constants.
void computeMode(Random &random, TracePlan::Mode &mode)
{
    using Mode = TracePlan::Mode;
    if ((mode == Mode::SpecializedTrue || mode == Mode::SpecializedFalse) && chance(random, 50))
        mode = mode == Mode::SpecializedTrue ? Mode::ComputedTrue : Mode::ComputedFalse;
}

// Ray queries in every stage, with ray flags and execution mode from everywhere.
Case stages(Random &random, const DeviceLimits &limits)
{
    Limits scene = smallScene(limits);
    scene.rays = 48;
    Case c{.scene = makeScene(random, scene, limits)};
    c.trace.stage = kQueryStages[below(random, kQueryStages.size())];
    c.trace.byAddress = chance(random, 40);
    c.trace.inlineModules = chance(random, 30);
    c.trace.mode =
        limits.api == Api::Khr && chance(random, 50) ? TracePlan::Mode::SpecializedTrue : TracePlan::Mode::True;
    if (chance(random, 40))
        fixFlags(random, c);
    c.trace.otherEntry = otherEntry(random, c.trace.stage, 25);
    c.trace.signedFlags = chance(random, 15);
    c.trace.launch.command = randomCommand(random, limits);
    c.trace.launch.offset = chance(random, 50) ? below(random, 70) : 0;
    selectFlags(random, c, 30);
    computeMode(random, c.trace.mode);
    if (c.trace.launch.command != Launch::Direct && limits.countedDraws && chance(random, 50))
        changeIfValid(c, [](Case &changed) { changed.trace.launch.counted = true; }); // it is a draw
    // One of many stages, so that few cases would have it.
    c.trace.vertexBuffers = limits.addressCommands() && chance(random, 12);
    if (c.trace.vertexBuffers) {
        c.trace.stage = VK_SHADER_STAGE_VERTEX_BIT;
        c.trace.byAddress = false;
        c.trace.flags = TracePlan::Flags::RunTime;
        c.trace.otherEntry = OtherEntry::None;
        c.trace.dynamicStrides = chance(random, 50);
    }
    return c;
}

// Adds triangles behind each other, which micromaps make transparent, except the last ones; and rays through all of
// them.
void addStack(Random &random, oracle::Scene &scene)
{
    constexpr float kAside = 40, kDistance = 0.0625f;
    const auto micromap = static_cast<uint32_t>(scene.micromaps.size());
    scene.micromaps.push_back({.triangles = {{.level = 1, .format = kTwoState, .states = {0, 0, 0, 0}}}});
    oracle::Instance instance = instanceInPlace(random);
    instance.object = static_cast<uint32_t>(scene.objects.size());
    scene.instances.push_back(instance);
    oracle::Mesh &mesh = scene.objects.emplace_back().meshes.emplace_back();
    mesh.opaque = chance(random, 50);
    mesh.micromap = {.micromap = micromap, .indexType = VK_INDEX_TYPE_UINT16};
    const uint32_t count = 2 + below(random, 70);
    for (uint32_t i = 0; i < count; ++i) {
        appendTriangle(mesh.vertices, {kAside, kAside, -kDistance * static_cast<float>(i)});
        mesh.micromap->indices.push_back(i + 2 < count ? 0 : -1 - static_cast<int32_t>(below(random, 4)));
    }
    aimAt(random, scene, {kAside, kAside, 0}, 1, 8);
}

// Ray queries in other forms than one variable that is used once, and in shader objects.
Case queryObjects(Random &random, const DeviceLimits &limits)
{
    Case c = queries(random, limits);
    constexpr std::array forms{TracePlan::Query::Plain,     TracePlan::Query::Array,   TracePlan::Query::Functions,
                               TracePlan::Query::Again,     TracePlan::Query::Sites,   TracePlan::Query::Getters,
                               TracePlan::Query::Condition, TracePlan::Query::Carried, TracePlan::Query::Beside};
    c.trace.query = forms[below(random, forms.size())];
    c.trace.optimized = chance(random, 40);
    c.trace.shaderObjects = (c.trace.query == TracePlan::Query::Plain && !c.trace.optimized) || chance(random, 20);
    c.trace.signedFlags = chance(random, 25);
    c.trace.maintenance6 = limits.maintenance6 && chance(random, 20);
    if (chance(random, 25))
        addStack(random, c.scene);
    // In an array and beside another one, the other query has constant flags, which differ then.
    const bool two = c.trace.query == TracePlan::Query::Array || c.trace.query == TracePlan::Query::Beside;
    if (!c.trace.optimized && chance(random, two ? 80 : 30)) {
        fixFlags(random, c);
        if (two && chance(random, 40)) // the only flag in which the two then differ
            for (Ray &ray : c.scene.rays)
                ray.flags =
                    (ray.flags & ~(kRayOpaque | kRayNoOpaque | kRayCullOpaque | kRayForceTwoState)) | kRayCullNoOpaque;
    }
    terminateSome(random, c.scene);
    setRecords(random, c);
    selectFlags(random, c, 35);
    return c;
}

// Shaders without the execution mode, where structures have no micromaps, and with it where the constant says so; also
// in modules with another entry point.
Case executionMode(Random &random, const DeviceLimits &limits)
{
    Limits scene = smallScene(limits);
    scene.rays = 64;
    constexpr std::array modes{TracePlan::Mode::False, TracePlan::Mode::SpecializedFalse,
                               TracePlan::Mode::SpecializedTrue};
    const TracePlan::Mode mode = modes[below(random, modes.size())];
    scene.micromaps = mode == TracePlan::Mode::SpecializedTrue;
    Case c{.scene = makeScene(random, scene, limits), .trace = {.mode = mode}};
    if (chance(random, 40))
        fixFlags(random, c);
    c.trace.otherEntry = otherEntry(random, c.trace.stage, 40);
    selectFlags(random, c, 20);
    computeMode(random, c.trace.mode);
    return c;
}

constexpr std::array kResolutionGroups{
    Group{"resolution-query", "random scenes, by ray queries in compute shaders", kRayOpacity, 400, runGroup<queries>,
          250},
    Group{"resolution-pipeline",
          "random scenes, by ray tracing pipelines whose hit groups have and lack any-hit and closest-hit shaders, and "
          "by "
          "null records",
          kRayOpacity, 200, runGroup<pipelines>, 200},
    Group{"plain", "random scenes without micromaps: whether oracle and driver agree at all",
          "Ray Traversal; Ray Intersection Culling", 60, runGroup<plain>, 30},
    Group{"levels", "subdivision levels up to the limits of the device, of both formats in one micromap",
          "Opacity Micromap: the curve by which micro-triangles are numbered; maxOpacity2StateSubdivisionLevel and "
          "maxOpacity4StateSubdivisionLevel; VkMicromapTriangleKHR: subdivisionLevel and format of each triangle",
          150, runGroup<levels>, 60},
    Group{"indices", "special and other indices of every type, stride and offset, with a base triangle, null micromaps",
          "VkAccelerationStructureTrianglesOpacityMicromapKHR: \"a triangle in the micromap is fetched at index "
          "reinterpret_cast<indexType>(indexBuffer + indexStride * geomTriangleIndex) + baseTriangle\"; \"If the index "
          "fetched from indexbuffer is negative then it is a special value\"; VK_EXT_opacity_micromap: \"the unsigned "
          "cast "
          "of one of the values from VkOpacityMicromapSpecialIndexEXT\"",
          300, runGroup<indices>, 250},
    Group{"flags", "one object in instances with different flags, which force two states or disable micromaps",
          "VkGeometryInstanceFlagBitsKHR: FORCE_OPACITY_MICROMAP_2_STATE, DISABLE_OPACITY_MICROMAPS; the ray flag "
          "ForceOpacityMicromap2StateEXT",
          200, runGroup<flags>, 150},
    Group{
        "lossy",
        "lossy builds, copies and updates: a state may become unknown, and nothing else; it is the same as in an equal "
        "build on a second device, for ray queries and pipelines",
        "Ray Opacity Micromap: \"the implementation may substitute any element's state value with "
        "VK_OPACITY_MICROMAP_SPECIAL_INDEX_FULLY_UNKNOWN_TRANSPARENT_KHR or "
        "VK_OPACITY_MICROMAP_SPECIAL_INDEX_FULLY_UNKNOWN_OPAQUE_KHR\"; \"The implementation, on an identically created "
        "instance and device, must perform any lossy substitutions invariantly with respect to acceleration structures "
        "and micromaps constructed with an equivalent shape and data\"",
        150, runGroup<lossy>, 80},
    Group{"stages",
          "ray queries in every stage, with ray flags of run time, specialized, literal and selected ones, by direct "
          "and indirect commands, also of VK_KHR_device_address_commands",
          "OpRayQueryInitializeKHR in each stage; OpExecutionModeId OpacityMicromapIdKHR with a specialization "
          "constant, or with an OpSpecConstantOp",
          200, runGroup<stages>, 30},
    Group{"query-objects",
          "ray queries in arrays, as parameters of functions, initialized again or in two places, terminated, in loops "
          "that carry values; in modules that were optimized, with signed ray flags, and in shader objects",
          "OpTypeRayQueryKHR; OpRayQueryInitializeKHR: each ray query has flags and candidates of its own; "
          "OpRayQueryTerminateKHR; VK_EXT_shader_object",
          150, runGroup<queryObjects>, 56},
    Group{"execution-mode",
          "ray queries with and without the execution mode OpacityMicromapIdKHR, also specialized, computed from "
          "specialization constants, and of another entry point that calls the same function",
          "SPV_KHR_opacity_micromap: OpacityMicromapIdKHR; VUID-vkCmdDispatch-micromap-11636", 60,
          runGroup<executionMode>, 30},
};

} // namespace

std::span<const Group> resolutionGroups()
{
    return kResolutionGroups;
}

std::span<const MakeCase> queryMakers()
{
    static constexpr std::array kMakers{queries, flags, stages, stages, queryObjects};
    return kMakers;
}

} // namespace vellum::check
