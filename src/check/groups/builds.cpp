// SPDX-License-Identifier: Apache-2.0
// Groups about builds: commands, threads, memory.
#include <array>

#include "check/case/trace.h"
#include "check/groups/random_case.h"

namespace vellum::check
{
namespace
{

Case builds(Random &random, const DeviceLimits &limits)
{
    Case c{.scene = makeScene(random, smallScene(limits), limits)};
    c.build.together = chance(random, 60);
    if (limits.indirectBuilds && chance(random, 40)) {
        c.build.structures = BuildCommand::Indirect;
        c.build.spareTriangles = below(random, 4);
        c.build.spareInstances = below(random, 4);
    }
    c.build.instancePointers = chance(random, 50);
    return c;
}

// Geometry in all its forms, in structures that are built, updated and copied in all ways.
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
    if (!c.build.single && limits.indirectBuilds && chance(random, 40)) {
        c.build.structures = BuildCommand::Indirect;
        c.build.spareTriangles = below(random, 4);
    }
    if (!c.build.single && chance(random, 60)) {
        constexpr std::array kinds{Kind::UpdateObject,  Kind::UpdateObject, Kind::CloneObject, Kind::CompactObject,
                                   Kind::ReloadObject,  Kind::SetIndices,   Kind::SetStates,   Kind::RebuildObjects,
                                   Kind::CloneMicromap, Kind::ReloadTop};
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
    return c;
}

Case hostBuilds(Random &random, const DeviceLimits &limits)
{
    Case c = builds(random, limits);
    c.build.micromaps = BuildCommand::Host;
    return c;
}

Case packed(Random &random, const DeviceLimits &limits)
{
    Case c = builds(random, limits);
    c.memory = Memory::Packed;
    return c;
}

Case generic(Random &random, const DeviceLimits &limits)
{
    Case c = builds(random, limits);
    c.memory = Memory::PackedToTheEnd;
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
    c.build.conditional = chance(random, 50);
    c.build.single = chance(random, 60);
    c.trace.boundFirst = true;
    if (!c.build.single) {
        constexpr std::array kinds{Kind::CloneObject,     Kind::ReloadObject,   Kind::CloneMicromap,
                                   Kind::CompactMicromap, Kind::ReloadMicromap, Kind::SetIndices,
                                   Kind::CloneTop,        Kind::ReloadTop,      Kind::UpdateTop};
        c.trace.besideBuild = true;
        addSteps(random, c, kinds, 2, limits);
    }
    if (limits.pipelines && chance(random, 40))
        c.trace.method = TracePlan::Method::Pipeline;
    else if (chance(random, 30))
        c.trace.stage = kQueryStages[below(random, kQueryStages.size())];
    return c;
}

constexpr std::array kGroups{
    Group{"builds",
          "several micromaps and structures by one command, indirect builds, arrays of pointers, usage counts by "
          "pointers, strides of triangle arrays",
          "vkCmdBuildAccelerationStructuresKHR, vkCmdBuildAccelerationStructuresIndirectKHR, vkCmdBuildMicromapsEXT; "
          "ppUsageCounts; triangleArrayStride; arrayOfPointers",
          200, runGroup<builds>},
    Group{"geometry",
          "vertices of all formats, strides, offsets, indices and transforms; geometries without triangles, degenerate "
          "and inactive triangles; many geometries; ppGeometries; NO_DUPLICATE_ANY_HIT_INVOCATION",
          "VkAccelerationStructureGeometryTrianglesDataKHR; VkAccelerationStructureGeometryAabbsDataKHR; "
          "VkAccelerationStructureBuildRangeInfoKHR; VkGeometryFlagBitsKHR; Inactive Primitives and Instances; "
          "Degenerate Primitives and Instances",
          300, runGroup<geometry>},
    Group{"one-command-buffer", "builds of all kinds and the rays in one command buffer",
          "Acceleration Structure Build Synchronization: VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT, "
          "VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR",
          150, runGroup<single>},
    Group{"host-builds", "micromaps that are built on the host", "vkBuildMicromapsEXT; micromapHostCommands", 60,
          runGroup<hostBuilds>},
    Group{
        "packed", "micromaps and structures side by side in one buffer: builds write nothing else",
        "VkAccelerationStructureBuildSizesInfoKHR and VkMicromapBuildSizesInfoEXT: sizes of memory and scratch memory",
        150, runGroup<packed>},
    Group{"generic", "GENERIC structures that reach to the end of their buffer, beyond what is built in them",
          "VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR; VkAccelerationStructureCreateInfoKHR: size", 150,
          runGroup<generic>},
    Group{"state", "what is bound before a build is still there after it; builds within conditional rendering",
          "Command Buffer State: build and copy commands change no bound pipeline, descriptor set or push constants; "
          "Conditional Rendering: discards draws, dispatches and clears only",
          120, runGroup<state>},
    Group{"threads", "builds recorded on several threads and submitted to all queues; rays beside a build",
          "Threading Behavior; Acceleration Structure Build Synchronization", 100, runGroup<threads>},
};

} // namespace

std::span<const Group> buildGroups()
{
    return kGroups;
}

} // namespace vellum::check
