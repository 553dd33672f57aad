// SPDX-License-Identifier: Apache-2.0
// Groups about what is done with micromaps and structures: copies, updates, serialization.
#include <algorithm>
#include <array>

#include "check/case/case.h"
#include "check/groups/random_case.h"

namespace vellum::check
{
namespace
{

using Kind = Step::Kind;

// A scene whose micromaps and top level may be compacted.
Case withSteps(Random &random, const DeviceLimits &limits, std::span<const Kind> kinds, uint32_t most)
{
    constexpr std::array memories{Memory::Apart, Memory::Packed, Memory::PackedToTheEnd};
    Limits scene = smallScene(limits);
    if (chance(random, 30))
        scene.objects = 6;
    Case c{.memory = memories[below(random, 3)], .scene = makeScene(random, scene, limits)};
    c.build.together = chance(random, 30);
    c.build.mixed = c.build.together && limits.api == Api::Khr && chance(random, 60);
    c.build.unrelated = chance(random, 25);
    c.build.secondary = chance(random, 20);
    c.build.twice = chance(random, 20);
    c.build.rerecorded = chance(random, 15);
    for (oracle::SceneMicromap &micromap : c.scene.micromaps)
        micromap.flags |= chance(random, 60) ? VkBuildMicromapFlagsEXT{VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT} : 0u;
    addSteps(random, c, kinds, 1 + below(random, most), limits);
    if (limits.pipelines && chance(random, 20)) {
        c.trace.method = TracePlan::Method::Pipeline;
        // With constant flags, other shaders decide, some by what a copy knows of boxes alone.
        if (chance(random, 50))
            fixFlags(random, c);
    }
    return c;
}

// Constant ray flags cull boxes that are not opaque, in hit groups without any-hit shaders.
void copyBoxes(Case &c)
{
    if (c.trace.method != TracePlan::Method::Pipeline || c.trace.flags == TracePlan::Flags::RunTime)
        return;
    for (uint32_t o = 0; o < c.scene.objects.size(); ++o)
        if (c.scene.objects[o].hasBoxes())
            c.steps.insert(c.steps.begin(), {.kind = Kind::CloneObject, .target = o});
    c.trace.pipeline.table.records = {oracle::HitRecord::WithoutAnyHit};
    for (Ray &ray : c.scene.rays)
        ray.flags = (ray.flags & ~(kRayOpaque | kRayNoOpaque | kRayCullOpaque | kRaySkipBoxes)) | kRayCullNoOpaque;
}

// A micromap without triangles, for meshes whose indices are all special.
void addEmptyMicromap(Random &random, Case &c)
{
    const auto number = static_cast<uint32_t>(c.scene.micromaps.size());
    oracle::SceneMicromap micromap;
    micromap.flags = chance(random, 50) ? VkBuildMicromapFlagsEXT{VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT} : 0u;
    c.steps.insert(c.steps.begin(),
                   {.kind = micromap.flags != 0 ? Kind::CompactMicromap : Kind::CloneMicromap, .target = number});
    c.scene.micromaps.push_back(std::move(micromap));
    for (oracle::Object &object : c.scene.objects) {
        for (oracle::Mesh &mesh : object.meshes) {
            if (object.hasBoxes() || mesh.micromap)
                continue;
            oracle::MeshMicromap use{.micromap = number, .indexType = VK_INDEX_TYPE_UINT16};
            for (uint32_t i = 0; i < mesh.triangles(); ++i)
                use.indices.push_back(-1 - static_cast<int32_t>(below(random, 4)));
            mesh.micromap = std::move(use);
        }
    }
}

Case copies(Random &random, const DeviceLimits &limits)
{
    constexpr std::array kinds{Kind::CloneObject,   Kind::CompactObject,   Kind::MoveObject, Kind::RenameObject,
                               Kind::CloneMicromap, Kind::CompactMicromap, Kind::CloneTop,   Kind::CompactTop};
    Case c = withSteps(random, limits, kinds, 5);
    copyBoxes(c);
    if (chance(random, 15))
        addEmptyMicromap(random, c);
    return c;
}

Case serialization(Random &random, const DeviceLimits &limits)
{
    constexpr std::array kinds{Kind::ReloadObject, Kind::ReloadMicromap, Kind::ReloadMicromap, Kind::ReloadTop};
    Case c = withSteps(random, limits, kinds, 3);
    // Micromaps with data of the same size, whose states differ.
    if (!c.scene.micromaps.empty() && chance(random, 40)) {
        const auto longest =
            std::ranges::max(c.scene.micromaps, {}, [](const auto &micromap) { return micromap.triangles.size(); });
        // Invalid where a step gives a micromap states of the size of before.
        changeIfValid(c, [&](Case &changed) {
            for (oracle::SceneMicromap &micromap : changed.scene.micromaps) {
                micromap.triangles = longest.triangles;
                for (oracle::MicromapTriangle &triangle : micromap.triangles)
                    triangle = oracle::mixedTriangle(random, triangle.level, triangle.format);
            }
        });
    }
    return c;
}

Case updates(Random &random, const DeviceLimits &limits)
{
    // Updates, and between them what an updated structure may have come from
    constexpr std::array kinds{Kind::UpdateObject,  Kind::UpdateObject,  Kind::UpdateObject,   Kind::SetStates,
                               Kind::SetStates,     Kind::SetIndices,    Kind::SetIndices,     Kind::UpdateTop,
                               Kind::UpdateTop,     Kind::RebuildObject, Kind::RebuildObjects, Kind::CloneObject,
                               Kind::CompactObject, Kind::ReloadObject,  Kind::CloneMicromap,  Kind::CompactMicromap,
                               Kind::CloneTop,      Kind::CompactTop,    Kind::ReloadTop};
    Case c = withSteps(random, limits, kinds, 6);
    for (Step &step : c.steps) {
        if (targetOf(step.kind) != Target::Micromap || step.update || !chance(random, 50))
            continue;
        step.update = true;
        allowUpdates(c);
        step.update = invalid(c).empty();
    }
    return c;
}

Case sequences(Random &random, const DeviceLimits &limits)
{
    std::array<Kind, static_cast<size_t>(Kind::Count)> kinds{};
    for (size_t i = 0; i < kinds.size(); ++i)
        kinds[i] = static_cast<Kind>(i);
    Case c = withSteps(random, limits, kinds, 10);
    c.build.instancePointers = chance(random, 30);
    c.trace.besideBuild = chance(random, 30);
    c.build.secondDevice = chance(random, 20);
    return c;
}

// Many objects, of which some have no micromaps, are built again by one command, between others that stay.
Case rebuilds(Random &random, const DeviceLimits &limits)
{
    Limits scene = smallScene(limits);
    scene.objects = 8;
    scene.instances = 12;
    scene.meshes = 1;
    Case c{.memory = chance(random, 50) ? Memory::Packed : Memory::Apart, .scene = makeScene(random, scene, limits)};
    c.build.unrelated = chance(random, 40);
    const uint32_t parity = below(random, 2);
    for (size_t o = parity; o < c.scene.objects.size(); o += 2) {
        if (chance(random, 60))
            c.scene.objects[o].meshes[0].micromap.reset();
    }
    c.steps = {
        {.kind = Kind::RebuildObjects, .target = std::min(parity, static_cast<uint32_t>(c.scene.objects.size()) - 1)}};
    constexpr std::array kinds{Kind::RebuildObjects, Kind::RebuildObject, Kind::CloneObject, Kind::UpdateObject,
                               Kind::ReplaceObject,  Kind::SetIndices,    Kind::RebuildTop,  Kind::ReplaceObject};
    addSteps(random, c, kinds, below(random, 5), limits);
    return c;
}

// Micromaps by host commands, mixed with those of the device.
Case hostCopies(Random &random, const DeviceLimits &limits)
{
    constexpr std::array kinds{Kind::CloneMicromap, Kind::CompactMicromap, Kind::ReloadMicromap, Kind::SetStates};
    Case c = withSteps(random, limits, kinds, 4);
    if (chance(random, 50))
        c.build.micromaps = BuildCommand::Host;
    buildableOnHost(c.scene);
    for (Step &step : c.steps) {
        step.host = chance(random, 75);
        step.deferred = step.host && chance(random, 40);
    }
    return c;
}

constexpr std::array kObjectsGroups{
    Group{"copies", "clones and compacted copies of micromaps, some without triangles, bottom and top level structures",
          "vkCmdCopyAccelerationStructureKHR, vkCmdCopyMicromapEXT: CLONE, COMPACT; "
          "VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR, VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT",
          200, runGroup<copies>, 200},
    Group{"serialization",
          "serialized and deserialized, into fresh memory and over another content, with the addresses of copies in "
          "the data; version data",
          "vkCmdCopyAccelerationStructureToMemoryKHR, vkCmdCopyMemoryToAccelerationStructureKHR, "
          "vkCmdCopyMicromapToMemoryEXT, vkCmdCopyMemoryToMicromapEXT; SERIALIZATION_SIZE queries; "
          "vkGetDeviceAccelerationStructureCompatibilityKHR, vkGetDeviceMicromapCompatibilityEXT",
          150, runGroup<serialization>, 120},
    Group{"host-copies", "micromaps that are copied, serialized, deserialized and queried on the host, also deferred",
          "vkCopyMicromapEXT, vkCopyMicromapToMemoryEXT, vkCopyMemoryToMicromapEXT, vkWriteMicromapsPropertiesEXT; "
          "Deferred Host Operations; micromapHostCommands",
          120, runGroup<hostCopies>, 120},
    Group{"updates",
          "updates in place and to another structure, as large as its source or as queried, with other states, "
          "indices, positions and instances and with the "
          "same data, after copies, compaction and deserialization",
          "VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_OPACITY_MICROMAP_UPDATE_BIT_KHR: \"the micromaps associated with the "
          "acceleration structure can change on update\"; Acceleration Structure Update Rules: "
          "ALLOW_OPACITY_MICROMAP_DATA_UPDATE; srcAccelerationStructure other than dstAccelerationStructure",
          200, runGroup<updates>, 160},
    Group{"rebuilds",
          "structures that are built again by one command, between others that stay, with other geometries, without "
          "micromaps, with other instances",
          "vkCmdBuildAccelerationStructuresKHR: each of pInfos names the structure that is built", 80,
          runGroup<rebuilds>, 80},
    Group{"sequences",
          "up to ten steps of all kinds, and rays concurrent with a build; the same on a second device in between",
          "all sections that the groups copies, serialization and updates name", 250, runGroup<sequences>, 160},
};

} // namespace

std::span<const Group> objectGroups()
{
    return kObjectsGroups;
}

std::span<const MakeCase> objectMakers()
{
    static constexpr std::array kMakers{copies, serialization, updates, sequences, sequences, rebuilds, hostCopies};
    return kMakers;
}

} // namespace vellum::check
