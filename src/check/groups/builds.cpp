// SPDX-License-Identifier: Apache-2.0
// Groups about builds: commands, threads, memory.
#include <array>
#include <cmath>

#include "check/case/trace.h"
#include "check/groups/random_case.h"

namespace vellum::check
{
namespace
{

// A ray at the middle of a micro-triangle; some instance has the object.
void aimAt(oracle::Scene &scene, const oracle::Instance &instance, const oracle::Mesh &mesh, uint32_t triangle,
           std::array<double, 2> place)
{
    const oracle::Corners corners = oracle::cornersOf(mesh, triangle);
    Ray ray;
    for (size_t i = 0; i < 3; ++i) {
        double point = double{instance.transform.matrix[i][3]};
        for (size_t k = 0; k < 3; ++k) {
            const double inObject =
                corners[0][k] + place[0] * (corners[1][k] - corners[0][k]) + place[1] * (corners[2][k] - corners[0][k]);
            point += double{instance.transform.matrix[i][k]} * inObject;
        }
        if (!std::isfinite(point)) // of an inactive triangle
            return;
        constexpr std::array<double, 3> kFrom{3.1, 4.7, 5.9};
        ray.origin[i] = static_cast<float>(point + kFrom[i]);
        ray.direction[i] = static_cast<float>(-kFrom[i]);
    }
    ray.tMax = 1000;
    scene.rays.push_back(ray);
}

// Rays at a micro-triangle of a micromap triangle, wherever it is.
void aimAtAll(oracle::Scene &scene, uint32_t micromap, uint32_t triangle, uint32_t microTriangle)
{
    constexpr size_t kMostRays = 400;
    const uint32_t level = scene.micromaps[micromap].triangles[triangle].level;
    for (const oracle::Instance &instance : scene.instances) {
        for (const oracle::Mesh &mesh : scene.objects[instance.object].meshes) {
            if (!mesh.micromap || mesh.micromap->micromap != micromap)
                continue;
            for (uint32_t t = 0; t < mesh.micromap->indices.size(); ++t) {
                const int32_t index = mesh.micromap->indexOf(t);
                if (index >= 0 && static_cast<uint32_t>(index) + mesh.micromap->base == triangle &&
                    scene.rays.size() < kMostRays)
                    aimAt(scene, instance, mesh, t, microTriangleCentre(microTriangle, level));
            }
        }
    }
}

// A triangle of 4 states whose data begins like that of a triangle of 2 states of the same level, and goes on with 0.
oracle::MicromapTriangle sameDataOfFourStates(const oracle::MicromapTriangle &two)
{
    oracle::MicromapTriangle four{.level = two.level, .format = kFourState};
    four.states.resize(two.states.size());
    for (size_t i = 0; i + 1 < two.states.size(); i += 2)
        four.states[i / 2] = static_cast<uint8_t>(two.states[i] | two.states[i + 1] << 1);
    return four;
}

// A place among that many micro-triangles: often one of the first or last, which devices read with others or alone.
uint32_t placeAmong(Random &random, uint32_t count)
{
    const uint32_t end = std::min(count, 128u);
    switch (below(random, 4)) {
    case 0: return below(random, end);
    case 1: return count - 1 - below(random, end);
    default: return below(random, count);
    }
}

// A triangle whose sub-triangles of some level have one state each, except a few, in which one or two micro-triangles
// have another one. Rays meet these.
void makeNearlyUniform(Random &random, oracle::Scene &scene, uint32_t micromap, uint32_t triangle, uint32_t maxLevel)
{
    const uint32_t level = 1 + below(random, maxLevel), nodeLevel = below(random, level);
    const uint32_t nodes = 1u << (2 * nodeLevel), size = 1u << (2 * (level - nodeLevel));
    oracle::MicromapTriangle &made = scene.micromaps[micromap].triangles[triangle];
    made = {.level = level, .format = chance(random, 50) ? kTwoState : kFourState};
    const uint32_t values = made.format == kTwoState ? 2 : 4;
    for (uint32_t node = 0; node < nodes; ++node)
        made.states.insert(made.states.end(), size,
                           static_cast<uint8_t>(below(random, chance(random, 70) ? 2 : values)));
    const uint32_t mixed = 1 + below(random, std::min(nodes, 4u));
    for (uint32_t i = 0; i < mixed; ++i) {
        const uint32_t node = below(random, nodes) * size;
        for (uint32_t k = 1 + below(random, 2); k > 0; --k) {
            const uint32_t place = node + below(random, size);
            uint8_t &state = made.states[place];
            state = static_cast<uint8_t>((state + 1 + below(random, values - 1)) % values);
            aimAtAll(scene, micromap, triangle, place);
        }
    }
}

void makeNearlyEqual(Random &random, oracle::Scene &scene, uint32_t micromap, uint32_t maxLevel)
{
    std::vector<oracle::MicromapTriangle> &triangles = scene.micromaps[micromap].triangles;
    for (uint32_t t = 0; t < triangles.size(); ++t) {
        if (t > 0 && chance(random, 15)) {
            triangles[t - 1] = oracle::mixedTriangle(random, kRequiredLevel, kTwoState);
            triangles[t] = sameDataOfFourStates(triangles[t - 1]);
            const uint32_t place = below(random, 1u << (2 * kRequiredLevel));
            aimAtAll(scene, micromap, t, place);
            aimAtAll(scene, micromap, t - 1, place);
            continue;
        }
        // Of this micromap or of one before it
        const uint32_t other = below(random, micromap + 1);
        const auto &from = scene.micromaps[other].triangles;
        const auto candidates = static_cast<uint32_t>(other == micromap ? t : from.size());
        if (candidates == 0 || chance(random, 20)) {
            if (chance(random, 50))
                makeNearlyUniform(random, scene, micromap, t, maxLevel);
            continue;
        }
        const uint32_t source = below(random, candidates);
        triangles[t] = from[source];
        if (chance(random, 15))
            continue;
        const uint32_t place = placeAmong(random, static_cast<uint32_t>(triangles[t].states.size()));
        uint8_t &state = triangles[t].states[place];
        state = static_cast<uint8_t>(state ^ (triangles[t].format == kTwoState ? 1 : 1 + below(random, 2)));
        aimAtAll(scene, micromap, t, place);
        aimAtAll(scene, other, source, place);
    }
}

// A micromap gets more triangles in front of those that it has, so that several workgroups build it.
void makeLong(Random &random, oracle::Scene &scene)
{
    if (scene.micromaps.empty())
        return;
    const uint32_t m = below(random, static_cast<uint32_t>(scene.micromaps.size()));
    oracle::SceneMicromap &micromap = scene.micromaps[m];
    if ((micromap.flags & kLossy) != 0)
        return;
    std::vector<oracle::MicromapTriangle> front(64 + below(random, 400));
    for (oracle::MicromapTriangle &triangle : front)
        triangle = oracle::randomTriangle(random, 1);
    micromap.triangles.insert(micromap.triangles.begin(), front.begin(), front.end());
    for (oracle::Object &object : scene.objects)
        for (oracle::Mesh &mesh : object.meshes)
            if (mesh.micromap && mesh.micromap->micromap == m)
                mesh.micromap->base += static_cast<uint32_t>(front.size());
}

Case builds(Random &random, const DeviceLimits &limits)
{
    Limits scene = smallScene(limits);
    scene.oddStrides = limits.oddStrides();
    Case c{.scene = makeScene(random, scene, limits)};
    if (chance(random, 15))
        makeLong(random, c.scene);
    c.build.together = chance(random, 60);
    c.build.mixed = c.build.together && limits.api == Api::Khr && chance(random, 50);
    if (limits.indirectBuilds && chance(random, 40)) {
        c.build.structures = BuildCommand::Indirect;
        c.build.spareTriangles = below(random, 4);
        c.build.spareInstances = below(random, 4);
    }
    c.build.instancePointers = chance(random, 50);
    c.build.skippedInstances = chance(random, 40) ? 1 + below(random, 5) : 0;
    c.build.otherTop = chance(random, 40);
    c.build.unrelated = chance(random, 40);
    c.build.secondary = chance(random, 30);
    c.build.twice = chance(random, 30);
    c.build.rerecorded = chance(random, 20);
    c.trace.secondary = chance(random, 30);
    c.trace.twice = chance(random, 20);
    varyInputs(random, c);
    return c;
}

// Geometry in all its forms, in structures that are built, updated and copied by all commands.
Case geometry(Random &random, const DeviceLimits &limits)
{
    using Kind = Step::Kind;
    Limits scene = smallScene(limits);
    scene.unusual = 95;
    Case c{.scene = makeScene(random, scene, limits)};
    c.build.together = chance(random, 40);
    c.build.instancePointers = chance(random, 30);
    c.build.geometryPointers = chance(random, 50);
    c.build.single = chance(random, 20);
    varyInputs(random, c);
    if (!c.build.single && limits.indirectBuilds && chance(random, 40)) {
        c.build.structures = BuildCommand::Indirect;
        c.build.spareTriangles = below(random, 4);
    }
    if (!c.build.single && chance(random, 60)) {
        constexpr std::array kinds{Kind::UpdateObject,  Kind::UpdateObject, Kind::CloneObject,  Kind::CompactObject,
                                   Kind::ReloadObject,  Kind::SetIndices,   Kind::SetStates,    Kind::RebuildObjects,
                                   Kind::CloneMicromap, Kind::ReloadTop,    Kind::RebuildObject};
        addSteps(random, c, kinds, 1 + below(random, 3), limits);
    }
    if (limits.pipelines && chance(random, 30))
        c.trace.method = TracePlan::Method::Pipeline;
    return c;
}

// Builds and rays in one command buffer, with nothing but barriers between.
Case single(Random &random, const DeviceLimits &limits)
{
    Case c{.scene = makeScene(random, smallScene(limits), limits)};
    c.build.single = true;
    c.build.instancePointers = chance(random, 30);
    c.build.backwards = chance(random, 40);
    c.trace.twice = chance(random, 20);
    varyInputs(random, c);
    return c;
}

// Micromaps most of whose triangles equal another one, or differ from it in one bit, or have stretches of one state
// with few others in them, and rays at these micro-triangles. Half of them are compacted, some as copies or as
// serialized.
Case nearlyEqual(Random &random, const DeviceLimits &limits)
{
    Limits small = smallScene(limits);
    small.maxLevel = 7;
    small.rays = 40;
    Case c{.scene = makeScene(random, small, limits)};
    c.build.together = chance(random, 50);
    for (uint32_t m = 0; m < c.scene.micromaps.size(); ++m)
        makeNearlyEqual(random, c.scene, m, small.maxLevel);
    using Kind = Step::Kind;
    for (uint32_t m = 0; m < c.scene.micromaps.size(); ++m) {
        if (!chance(random, 50))
            continue;
        c.scene.micromaps[m].flags |= VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT;
        const bool host = limits.hostCommands && chance(random, 20);
        if (chance(random, 20))
            c.steps.push_back(
                {.kind = chance(random, 50) ? Kind::CloneMicromap : Kind::ReloadMicromap, .target = m, .host = host});
        c.steps.push_back({.kind = Kind::CompactMicromap, .target = m, .host = host});
    }
    if (std::ranges::any_of(c.steps, &Step::host))
        buildableOnHost(c.scene);
    return c;
}

Case hostBuilds(Random &random, const DeviceLimits &limits)
{
    Case c = builds(random, limits);
    c.build.micromaps = BuildCommand::Host;
    c.build.deferred = chance(random, 40);
    buildableOnHost(c.scene);
    if (!chance(random, 20))
        return c;
    if (const auto fine = makeFine(random, c.scene, limits)) {
        const auto &[micromap, triangle] = *fine;
        const size_t count = c.scene.micromaps[micromap].triangles[triangle].states.size();
        for (uint32_t i = 0; i < 16; ++i)
            aimAtAll(c.scene, micromap, triangle, below(random, static_cast<uint32_t>(count)));
    }
    return c;
}

Case packed(Random &random, const DeviceLimits &limits)
{
    Case c = builds(random, limits);
    c.memory = Memory::Packed;
    c.build.lateInputs = false;
    return c;
}

Case generic(Random &random, const DeviceLimits &limits)
{
    Case c = builds(random, limits);
    c.memory = Memory::PackedToTheEnd;
    c.build.lateInputs = false;
    return c;
}

Case threads(Random &random, const DeviceLimits &limits)
{
    Limits scene = smallScene(limits);
    scene.objects = 6;
    Case c{.memory = Memory::Packed, .scene = makeScene(random, scene, limits)};
    c.build.threads = 2 + below(random, 3);
    c.trace.besideBuild = chance(random, 50);
    return c;
}

// Builds between what is bound and what it does, and within conditional rendering.
Case state(Random &random, const DeviceLimits &limits)
{
    using Kind = Step::Kind;
    Case c{.scene = makeScene(random, smallScene(limits), limits)};
    makeConditional(random, c, limits, 50);
    c.build.anotherThread = chance(random, 30);
    c.build.single = chance(random, 60);
    c.build.backwards = c.build.single && chance(random, 30);
    c.trace.boundFirst = true;
    c.trace.pipelineLast = chance(random, 30);
    c.trace.twice = chance(random, 20);
    c.trace.secondary = chance(random, 30);
    if (!c.build.single) {
        constexpr std::array kinds{Kind::CloneObject,     Kind::ReloadObject,   Kind::CloneMicromap,
                                   Kind::CompactMicromap, Kind::ReloadMicromap, Kind::SetIndices,
                                   Kind::CloneTop,        Kind::ReloadTop,      Kind::UpdateTop};
        c.trace.besideBuild = true;
        addSteps(random, c, kinds, 2, limits);
    }
    if (limits.pipelines && chance(random, 40))
        c.trace.method = TracePlan::Method::Pipeline;
    else if (!c.trace.secondary && chance(random, 30))
        c.trace.stage = kQueryStages[below(random, kQueryStages.size())];
    c.trace.maintenance6 = limits.maintenance6 && chance(random, 50);
    if (c.trace.method == TracePlan::Method::Query)
        c.trace.launch.command = randomCommand(random, limits);
    c.trace.vertexBuffers =
        limits.addressCommands() && c.trace.stage == VK_SHADER_STAGE_VERTEX_BIT && chance(random, 60);
    c.trace.dynamicStrides = c.trace.vertexBuffers && chance(random, 50);
    if (limits.shaderObjects && c.trace.method == TracePlan::Method::Query &&
        c.trace.stage == VK_SHADER_STAGE_COMPUTE_BIT && chance(random, 60)) {
        c.trace.shaderObjects = chance(random, 60);
        c.trace.rebound = chance(random, 70);
    }
    return c;
}

constexpr std::array kBuildsGroups{
    Group{
        "builds",
        "several micromaps and structures of all kinds by one command, in secondary command buffers, submitted twice; "
        "indirect builds, arrays of pointers, usage counts by pointers, of 0, repeated and in any order, strides of "
        "triangle arrays, with VK_EXT_opacity_micromap of any number of bytes; data with gaps and overlaps; inputs "
        "that "
        "are parts of others, that belong to two buffers, or that are written after the commands are recorded; command "
        "buffers that are recorded again",
        "vkCmdBuildAccelerationStructuresKHR, vkCmdBuildAccelerationStructuresIndirectKHR, vkCmdBuildMicromapsEXT; "
        "ppUsageCounts; triangleArrayStride; arrayOfPointers; \"Multiple elements with the same format and "
        "subdivisionLevel are allowed\"; VkMicromapTriangleKHR: dataOffset \"is a byte aligned value\"",
        200, runGroup<builds>, 200},
    Group{"nearly-equal",
          "micromap triangles that equal others or differ from them in one bit, or are of one state except for few "
          "micro-triangles, also compacted",
          "VkMicromapTriangleKHR: each triangle has the data at its dataOffset; "
          "VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT, COMPACT",
          200, runGroup<nearlyEqual>, 120},
    Group{"geometry",
          "vertices of all formats, strides, offsets, indices and transforms; geometries without triangles, degenerate "
          "and inactive triangles; many geometries; ppGeometries; NO_DUPLICATE_ANY_HIT_INVOCATION",
          "VkAccelerationStructureGeometryTrianglesDataKHR; VkAccelerationStructureGeometryAabbsDataKHR; "
          "VkAccelerationStructureBuildRangeInfoKHR; VkGeometryFlagBitsKHR; Inactive Primitives and Instances; "
          "Degenerate Primitives and Instances",
          300, runGroup<geometry>, 250},
    Group{"one-command-buffer",
          "builds of all kinds and the rays in one command buffer, or in three that are recorded in reverse order",
          "Acceleration Structure Build Synchronization: VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT, "
          "VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR",
          150, runGroup<single>, 120},
    Group{"host-builds", "micromaps that are built on the host, also deferred",
          "vkBuildMicromapsEXT; micromapHostCommands", 60, runGroup<hostBuilds>, 60},
    Group{
        "packed", "micromaps and structures side by side in one buffer: builds write nothing else",
        "VkAccelerationStructureBuildSizesInfoKHR and VkMicromapBuildSizesInfoEXT: sizes of memory and scratch memory",
        150, runGroup<packed>, 120},
    Group{"generic", "GENERIC structures that reach to the end of their buffer, beyond what is built in them",
          "VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR; VkAccelerationStructureCreateInfoKHR: size", 150,
          runGroup<generic>, 120},
    Group{"state",
          "what is bound before a build is still there after it, also by the commands of VK_KHR_maintenance6, a "
          "shader object after a pipeline, and vertex and index buffers by addresses; the pipeline alone after the "
          "build; builds within conditional rendering, and dispatches after them that it discards",
          "Command Buffer State: build and copy commands change no bound pipeline, descriptor set or push constants; "
          "vkCmdBindDescriptorSets2, vkCmdPushConstants2; vkCmdBindShadersEXT; vkCmdBindVertexBuffers3KHR, "
          "vkCmdBindIndexBuffer3KHR, vkCmdBeginConditionalRendering2EXT; "
          "Conditional Rendering: discards draws, dispatches and clears only, \"Other rendering commands remain "
          "unaffected\", and is \"active\" until vkCmdEndConditionalRenderingEXT",
          120, runGroup<state>, 50},
    Group{"threads", "builds recorded on several threads and submitted to all queues; rays concurrent with a build",
          "Threading Behavior; Acceleration Structure Build Synchronization", 100, runGroup<threads>, 100},
};

} // namespace

std::span<const Group> buildGroups()
{
    return kBuildsGroups;
}

std::span<const MakeCase> buildMakers()
{
    static constexpr std::array kMakers{builds, geometry, single, hostBuilds, packed, generic, threads, state, state};
    return kMakers;
}

} // namespace vellum::check
