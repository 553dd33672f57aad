// SPDX-License-Identifier: Apache-2.0
#include "check/groups/random_case.h"

#include <algorithm>

#include "check/case/json.h"
#include "check/case/step.h"
#include "check/groups/session.h"

namespace vellum::check
{
namespace
{

constexpr double kShrinkSeconds = 20;

using Kind = Step::Kind;

// Fault::InstanceBehindInvisible. The specification says that an inactive object is "considered invisible to all rays",
// and allows every mask.
void showBeforeOthers(oracle::Scene &scene)
{
    bool others = false;
    for (auto instance = scene.instances.rbegin(); instance != scene.instances.rend(); ++instance) {
        if (others) {
            instance->inactive = false;
            instance->mask |= instance->mask == 0 ? 1u : 0u;
        }
        others |= !instance->inactive && instance->mask != 0;
    }
}

// Fault::AddressWithConstantFlags
void useDescriptors(TracePlan &trace)
{
    constexpr VkShaderStageFlags kRayTracingStages =
        VK_SHADER_STAGE_RAYGEN_BIT_KHR | VK_SHADER_STAGE_MISS_BIT_KHR | VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR |
        VK_SHADER_STAGE_ANY_HIT_BIT_KHR | VK_SHADER_STAGE_INTERSECTION_BIT_KHR | VK_SHADER_STAGE_CALLABLE_BIT_KHR;
    trace.byAddress &= trace.method != TracePlan::Method::Query ||
                       (static_cast<VkShaderStageFlags>(trace.stage) & kRayTracingStages) == 0 ||
                       trace.flags == TracePlan::Flags::RunTime;
}

// Whether the device's limits allow the triangle in a micromap of these flags.
bool allowed(const oracle::MicromapTriangle &triangle, VkBuildMicromapFlagsEXT flags, const DeviceLimits &limits)
{
    if (triangle.format == kTwoState)
        return triangle.level <= limits.maxLevel2 && (flags & kLossy) == 0; // VUID-...-format-11713
    return triangle.level <= ((flags & kLossy) != 0 ? limits.maxLossyLevel : limits.maxLevel4);
}

// sameSize: of the same levels and formats.
std::vector<oracle::MicromapTriangle> otherStates(Random &random, const oracle::SceneMicromap &micromap, bool sameSize,
                                                  const DeviceLimits &limits)
{
    if (sameSize) {
        std::vector<oracle::MicromapTriangle> triangles = micromap.triangles;
        for (oracle::MicromapTriangle &triangle : triangles)
            for (uint8_t &state : triangle.states)
                state = static_cast<uint8_t>(below(random, triangle.format == kTwoState ? 2 : 4));
        return triangles;
    }
    std::vector<oracle::MicromapTriangle> triangles;
    uint32_t maxLevel = 0;
    for (const oracle::MicromapTriangle &old : micromap.triangles)
        maxLevel = std::max(maxLevel, old.level);
    while (triangles.size() < micromap.triangles.size()) {
        oracle::MicromapTriangle triangle = oracle::randomTriangle(random, maxLevel);
        if (allowed(triangle, micromap.flags, limits))
            triangles.push_back(std::move(triangle));
    }
    return triangles;
}

} // namespace

DeviceLimits limitsOf(const Device &gpu)
{
    return {.api = gpu.khr() ? Api::Khr : Api::Ext,
            .byteIndices = gpu.khr() && gpu.has(VK_EXT_INDEX_TYPE_UINT8_EXTENSION_NAME),
            .pipelines = gpu.has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME),
            .hostCommands = gpu.hasMicromapHostCommands(),
            .indirectBuilds = gpu.hasIndirectBuilds(),
            .maxLevel2 = gpu.maxLevel(kTwoState),
            .maxLevel4 = gpu.maxLevel(kFourState),
            .maxLossyLevel = gpu.maxLossyLevel(),
            .vertexFormats = gpu.vertexFormats(),
            .faults = gpu.knownFaults()};
}

Limits smallScene(const DeviceLimits &limits)
{
    return {.maxLevel = 5,
            .rays = 160,
            .byteIndices = limits.byteIndices,
            .objects = 3,
            .meshes = 3,
            .instances = 5,
            .triangles = 12,
            .unusual = 40,
            .formats = limits.vertexFormats};
}

oracle::Scene makeScene(Random &random, const Limits &scene, const DeviceLimits &limits)
{
    oracle::Scene made = oracle::randomScene(random, scene);
    for (oracle::SceneMicromap &micromap : made.micromaps) {
        for (oracle::MicromapTriangle &triangle : micromap.triangles) {
            while (!allowed(triangle, micromap.flags, limits))
                triangle = oracle::randomTriangle(random, scene.maxLevel);
        }
    }
    if (limits.has(Fault::InstanceBehindInvisible))
        showBeforeOthers(made);
    return made;
}

oracle::Instance instanceInPlace(Random &random)
{
    oracle::Instance instance;
    for (size_t i = 0; i < 3; ++i)
        instance.transform.matrix[i][i] = 1;
    instance.customIndex = below(random, 1u << 24);
    return instance;
}

Ray rayDown(Random &random)
{
    Ray ray = oracle::randomRay(random, {});
    ray.origin = {0, 0, 3};
    ray.direction = {0, 0, -1};
    ray.tMin = 0;
    ray.tMax = 10;
    ray.cullMask = 0xff;
    ray.generate = 0;
    ray.flags &= ~(kRayCullBack | kRayCullFront | kRaySkipTriangles);
    return ray;
}

oracle::MicromapTriangle patchyTriangle(Random &random, uint32_t level, uint32_t least)
{
    oracle::MicromapTriangle triangle{.level = level, .format = kFourState};
    const size_t count = size_t{1} << (2 * level);
    while (triangle.states.size() < count) {
        // 4^n states of the curve from a multiple of 4^n on are a sub-triangle.
        uint32_t n = least + below(random, level + 1 - least);
        while (triangle.states.size() % (size_t{1} << (2 * n)) != 0)
            --n;
        triangle.states.insert(triangle.states.end(), size_t{1} << (2 * n), static_cast<uint8_t>(below(random, 4)));
    }
    return triangle;
}

std::optional<Step> randomStep(Random &random, const oracle::Scene &scene, Kind kind, const DeviceLimits &limits)
{
    Step step{.kind = kind, .update = chance(random, 50)};
    switch (kind) {
    case Kind::CloneMicromap:
    case Kind::CompactMicromap:
    case Kind::ReloadMicromap:
    case Kind::SetStates: {
        std::vector<uint32_t> able;
        for (uint32_t i = 0; i < scene.micromaps.size(); ++i) {
            if (kind != Kind::CompactMicromap ||
                (scene.micromaps[i].flags & VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT) != 0)
                able.push_back(i);
        }
        if (able.empty())
            return {};
        step.target = able[below(random, static_cast<uint32_t>(able.size()))];
        step.inPlace = (kind == Kind::SetStates || kind == Kind::ReloadMicromap) && chance(random, 50);
        if (kind == Kind::SetStates ||
            ((kind == Kind::CloneMicromap || (kind == Kind::ReloadMicromap && step.inPlace)) && chance(random, 70)))
            step.states =
                otherStates(random, scene.micromaps[step.target], step.inPlace || kind != Kind::SetStates, limits);
        return step;
    }
    case Kind::SetIndices: {
        std::vector<std::pair<uint32_t, uint32_t>> able;
        for (uint32_t o = 0; o < scene.objects.size(); ++o) {
            for (uint32_t m = 0; m < scene.objects[o].meshes.size(); ++m) {
                if (scene.objects[o].meshes[m].micromap)
                    able.emplace_back(o, m);
            }
        }
        if (able.empty() || scene.micromaps.empty())
            return {};
        std::tie(step.target, step.other) = able[below(random, static_cast<uint32_t>(able.size()))];
        const uint32_t triangles = scene.objects[step.target].meshes[step.other].triangles();
        step.micromapUse = oracle::randomUse(random, scene, triangles, {.byteIndices = limits.byteIndices});
        step.update =
            step.update && oracle::isAlike(scene.objects[step.target].meshes[step.other].micromap, step.micromapUse);
        return step;
    }
    case Kind::UpdateTop:
        step.update = false;
        step.instances = scene.instances;
        for (oracle::Instance &instance : step.instances) {
            const bool inactive = instance.inactive;
            const uint32_t object = instance.object;
            instance = oracle::randomInstance(random, 1, {});
            instance.inactive = inactive;
            instance.object = object;
        }
        if (limits.has(Fault::InstanceBehindInvisible))
            return {};
        return step;
    case Kind::CloneTop:
    case Kind::CompactTop:
    case Kind::ReloadTop: return Step{.kind = kind};
    default:
        step.target = below(random, static_cast<uint32_t>(scene.objects.size()));
        step.other = below(random, static_cast<uint32_t>(scene.objects.size()));
        if (kind == Kind::ReloadObject && limits.api == Api::Khr && limits.has(Fault::LayerSerializedStructures) &&
            std::ranges::any_of(scene.objects[step.target].meshes,
                                [](const oracle::Mesh &mesh) { return mesh.micromap.has_value(); }))
            return {};
        return step;
    }
}

void addSteps(Random &random, Case &c, std::span<const Kind> kinds, uint32_t count, const DeviceLimits &limits)
{
    for (uint32_t i = 0; i < count; ++i) {
        const Kind kind = kinds[below(random, static_cast<uint32_t>(kinds.size()))];
        if (std::optional<Step> step = randomStep(random, sceneAfter(c), kind, limits))
            c.steps.push_back(std::move(*step));
    }
    // In the order in which they are carried out.
    std::ranges::stable_partition(c.steps, [](const Step &step) { return targetOf(step.kind) != Target::Top; });
}

Outcome runRandomCase(Session &session, std::string_view group, uint64_t seed, MakeCase make)
{
    Random random(static_cast<Random::result_type>(seed ^ seed >> 32));
    Case c = make(random, session.limits());
    c.group = group;
    c.seed = seed;
    if (session.limits().has(Fault::AddressWithConstantFlags))
        useDescriptors(c.trace);
    if (session.onlyMakesCases)
        return {.reproducer = toJson(c)};
    return runAndShrink(session, c, kShrinkSeconds);
}

} // namespace vellum::check
