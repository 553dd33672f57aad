// SPDX-License-Identifier: Apache-2.0
#include "check/groups/random_case.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "check/case/case.h"
#include "check/case/names.h"
#include "check/case/trace.h"
#include "check/groups/session.h"

namespace vellum::check
{
namespace
{

constexpr double kShrinkSeconds = 20;

using Kind = Step::Kind;

// Fault::InstanceBehindInvisible. The specification says that an inactive object is "considered invisible to all rays",
// and allows every mask.
void showBeforeOthers(std::vector<oracle::Instance> &instances)
{
    bool others = false;
    for (auto instance = instances.rbegin(); instance != instances.rend(); ++instance) {
        if (others) {
            instance->inactive = false;
            instance->mask |= instance->mask == 0 ? 1u : 0u;
        }
        others |= !instance->inactive && instance->mask != 0;
    }
}

// Fault::FirstVertexIgnored, FourthComponentTransformed, InactiveHideOthers
void avoidFaultsOfGeometry(oracle::Mesh &mesh, const DeviceLimits &limits)
{
    if (limits.has(Fault::FirstVertexIgnored))
        mesh.layout.firstVertex = 0;
    if (limits.has(Fault::FourthComponentTransformed) && vertexFormat(mesh.layout.vertexFormat).components == 4) {
        mesh.layout.transform.reset();
        mesh.layout.transformOffset = 0;
    }
    if (!limits.has(Fault::InactiveHideOthers))
        return;
    for (VkAabbPositionsKHR &box : mesh.boxes)
        if (std::isnan(box.minX))
            box = {box.maxX, box.maxY, box.maxZ, box.maxX, box.maxY, box.maxZ};
    for (size_t i = 0; i < mesh.vertices.size(); ++i)
        if (std::isnan(mesh.vertices[i][0]))
            std::fill_n(mesh.vertices.begin() + static_cast<ptrdiff_t>(i - i % 3), 3, Vec3{});
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

// On a device without ray queries, cases that are not about ray queries use pipelines.
void usePipelines(Case &c)
{
    const TracePlan &trace = c.trace;
    const bool plain = trace.stage == VK_SHADER_STAGE_COMPUTE_BIT && trace.query == TracePlan::Query::Plain &&
                       trace.mode == TracePlan::Mode::True && trace.otherEntry == OtherEntry::None &&
                       !trace.optimized && !trace.shaderObjects;
    const bool fits = std::ranges::all_of(
        c.scene.objects, [](const oracle::Object &o) { return o.meshes.size() <= oracle::kMostGeometries; });
    if (plain && fits)
        c.trace.method = TracePlan::Method::Pipeline;
}

// True if the device's limits allow the triangle in a micromap of these flags.
bool allowed(const oracle::MicromapTriangle &triangle, VkBuildMicromapFlagsEXT flags, const DeviceLimits &limits)
{
    if (triangle.format == kTwoState)
        return triangle.level <= limits.maxLevel2 && (flags & kLossy) == 0; // VUID-...-format-11713
    return triangle.level <= ((flags & kLossy) != 0 ? limits.maxLossyLevel : limits.maxLevel4);
}

VkBuildAccelerationStructureFlagsKHR randomFlags(Random &random, const DeviceLimits &limits)
{
    constexpr std::array<VkBuildAccelerationStructureFlagsKHR, 3> preferences{
        0, VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR,
        VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_BUILD_BIT_KHR};
    VkBuildAccelerationStructureFlagsKHR flags = preferences[below(random, preferences.size())];
    const auto maybe = [&](VkBuildAccelerationStructureFlagsKHR flag, uint32_t percent) {
        flags |= chance(random, percent) ? flag : 0;
    };
    maybe(VK_BUILD_ACCELERATION_STRUCTURE_LOW_MEMORY_BIT_KHR, 30);
    maybe(VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR, 20);
    maybe(VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR, 20);
    maybe(VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_DISABLE_OPACITY_MICROMAPS_EXT, 20);
    // VUID-VkAccelerationStructureBuildGeometryInfoKHR-flags-11558, -flags-11709
    if (limits.api == Api::Ext && chance(random, 30))
        flags |= kAllowDataUpdate;
    else
        maybe(kAllowMicromapUpdate, 20);
    if (limits.dataAccess)
        maybe(kAllowDataAccess, 20);
    return flags;
}

// sameSize: of the same levels and formats.
std::vector<oracle::MicromapTriangle> otherStates(Random &random, const oracle::SceneMicromap &micromap, bool sameSize,
                                                  const DeviceLimits &limits)
{
    if (sameSize) {
        std::vector<oracle::MicromapTriangle> triangles = micromap.triangles;
        for (oracle::MicromapTriangle &triangle : triangles)
            triangle = oracle::mixedTriangle(random, triangle.level, triangle.format);
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

// Ray flags with other flags of opacity, each as likely as the others.
uint32_t withOtherOpacity(Random &random, uint32_t flags)
{
    constexpr std::array kOpacity{0u, kRayOpaque, kRayNoOpaque, kRayCullOpaque, kRayCullNoOpaque};
    constexpr uint32_t kAny = kRayOpaque | kRayNoOpaque | kRayCullOpaque | kRayCullNoOpaque;
    return (flags & ~kAny) | kOpacity[below(random, kOpacity.size())] | (chance(random, 40) ? kRayForceTwoState : 0);
}

} // namespace

DeviceLimits limitsOf(const Device &gpu)
{
    return {.api = gpu.khr() ? Api::Khr : Api::Ext,
            .byteIndices = gpu.khr() && gpu.has(VK_EXT_INDEX_TYPE_UINT8_EXTENSION_NAME),
            .rayQueries = gpu.has(VK_KHR_RAY_QUERY_EXTENSION_NAME),
            .pipelines = gpu.has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME),
            .skipsPrimitives = skipsPrimitives(gpu),
            .hostCommands = gpu.hasMicromapHostCommands(),
            .indirectBuilds = gpu.hasIndirectBuilds(),
            .hostReset = gpu.hasHostQueryReset(),
            .maintenance = gpu.has(VK_KHR_RAY_TRACING_MAINTENANCE_1_EXTENSION_NAME),
            .maintenance6 = gpu.has("VK_KHR_maintenance6"),
            .shaderObjects = gpu.has("VK_EXT_shader_object"),
            .countedDraws = gpu.hasCountedDraws(),
            .chained = uint32_t{kChainFlagsFirst} |
                       (gpu.has(VK_EXT_PIPELINE_CREATION_FEEDBACK_EXTENSION_NAME) ? uint32_t{kChainFeedback} : 0) |
                       (gpu.has(VK_EXT_PIPELINE_ROBUSTNESS_EXTENSION_NAME) ? uint32_t{kChainRobustness} : 0),
            .dataAccess = gpu.has("VK_KHR_ray_tracing_position_fetch"),
            .maxLevel2 = std::max(gpu.maxLevel(kTwoState), kRequiredLevel),
            .maxLevel4 = std::max(gpu.maxLevel(kFourState), kRequiredLevel),
            .maxLossyLevel = std::max(gpu.maxLossyLevel(), kRequiredLevel),
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

void varyBuilds(Random &random, oracle::Scene &scene, const DeviceLimits &limits)
{
    const auto some = [&](uint32_t percent, uint32_t bits) {
        return chance(random, percent) ? below(random, bits + 1) : 0;
    };
    scene.topFlags = randomFlags(random, limits);
    for (oracle::SceneMicromap &micromap : scene.micromaps) {
        micromap.usage = some(50, allOf(kUsageNames));
        micromap.layout = some(50, allOf(kDataNames));
        micromap.onHost = limits.hostCommands && chance(random, 30);
    }
    for (oracle::Object &object : scene.objects) {
        object.flags = randomFlags(random, limits);
        for (oracle::Mesh &mesh : object.meshes) {
            if (!mesh.micromap)
                continue;
            mesh.micromap->usagePointers = chance(random, 30);
            mesh.micromap->usage = some(50, allOf(kUsageNames));
        }
    }
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
    for (oracle::Object &object : made.objects)
        for (oracle::Mesh &mesh : object.meshes)
            avoidFaultsOfGeometry(mesh, limits);
    if (limits.has(Fault::InstanceBehindInvisible))
        showBeforeOthers(made.instances);
    varyBuilds(random, made, limits);
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

void aimAt(Random &random, oracle::Scene &scene, const Vec3 &place, uint32_t level, uint32_t rays)
{
    for (uint32_t i = 0; i < rays; ++i) {
        Ray ray = rayDown(random);
        const auto [u, v] = microTriangleCentre(below(random, 1u << (2 * level)), level);
        ray.origin = {place[0] + static_cast<float>(u), place[1] + static_cast<float>(v), 3};
        scene.rays.push_back(ray);
    }
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

std::optional<std::pair<uint32_t, uint32_t>> makeFine(Random &random, oracle::Scene &scene, const DeviceLimits &limits)
{
    if (scene.micromaps.empty())
        return {};
    const uint32_t m = below(random, static_cast<uint32_t>(scene.micromaps.size()));
    oracle::SceneMicromap &micromap = scene.micromaps[m];
    if (micromap.triangles.empty())
        return {};
    const uint32_t t = below(random, static_cast<uint32_t>(micromap.triangles.size()));
    const uint32_t most = (micromap.flags & kLossy) != 0 ? limits.maxLossyLevel : limits.maxLevel4;
    const uint32_t level = std::min(most, 9 + below(random, 2));
    micromap.triangles[t] = patchyTriangle(random, level, std::min(level, 2u));
    return std::pair(m, t);
}

std::optional<Step> randomStep(Random &random, const oracle::Scene &scene, Kind kind, const DeviceLimits &limits)
{
    const auto objects = static_cast<uint32_t>(scene.objects.size());
    Step step{.kind = kind, .update = chance(random, 50)};
    step.outOfPlace = chance(random, 50) && (step.update || kind == Kind::UpdateObject);
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
                if (!scene.objects[o].hasBoxes())
                    able.emplace_back(o, m);
            }
        }
        if (able.empty() || scene.micromaps.empty())
            return {};
        std::tie(step.target, step.other) = able[below(random, static_cast<uint32_t>(able.size()))];
        const uint32_t triangles = scene.objects[step.target].meshes[step.other].triangles();
        if (!chance(random, 20))
            step.micromapUse = oracle::randomUse(random, scene, triangles, {.byteIndices = limits.byteIndices});
        step.update =
            step.update && oracle::isAlike(scene.objects[step.target].meshes[step.other].micromap, step.micromapUse);
        step.outOfPlace &= step.update;
        return step;
    }
    case Kind::UpdateTop:
        if (limits.has(Fault::InstanceBehindInvisible))
            return {};
        step.update = false;
        step.outOfPlace = chance(random, 50);
        step.exact = step.outOfPlace && chance(random, 50);
        step.instances = scene.instances;
        for (oracle::Instance &instance : step.instances) {
            const oracle::Instance before = instance;
            instance = oracle::randomInstance(random, objects, {});
            instance.inactive = before.inactive;
            if (chance(random, 50) ||
                scene.objects[instance.object].hasBoxes() != scene.objects[before.object].hasBoxes())
                instance.object = before.object;
        }
        return step;
    case Kind::RebuildTop:
        step.update = step.outOfPlace = false;
        for (size_t i = 1 + below(random, static_cast<uint32_t>(std::min<size_t>(scene.instances.size(), 8) + 3));
             i > 0; --i)
            step.instances.push_back(oracle::randomInstance(random, objects, {}));
        if (limits.has(Fault::InstanceBehindInvisible))
            showBeforeOthers(step.instances);
        return step;
    case Kind::ReplaceObject:
        step.update = step.outOfPlace = false;
        step.target = below(random, objects);
        step.other = below(random, objects);
        if (step.target == step.other || scene.objects[step.target].hasBoxes() != scene.objects[step.other].hasBoxes())
            return {};
        return step;
    case Kind::CloneTop:
    case Kind::CompactTop:
    case Kind::ReloadTop:
        return Step{.kind = kind,
                    .relocated = kind == Kind::ReloadTop && chance(random, 50),
                    .exact = kind == Kind::CloneTop && limits.maintenance && chance(random, 40)};
    default:
        step.exact = kind == Kind::CloneObject && limits.maintenance && chance(random, 40);
        step.relocated = kind == Kind::ReloadObject && chance(random, 50);
        step.structureFirst = step.relocated && chance(random, 50);
        step.mirrored = (kind == Kind::UpdateObject || kind == Kind::RebuildObject) && chance(random, 40);
        step.update &= kind == Kind::RebuildObjects;
        step.outOfPlace &= step.update || kind == Kind::UpdateObject;
        step.exact |= step.outOfPlace && chance(random, 50);
        step.target = below(random, objects);
        step.other = below(random, objects);
        if (kind == Kind::ReloadObject && !limits.serializesMicromaps() &&
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
        // An update may lack what earlier steps made of its structure.
        if (invalid(c).starts_with("steps["))
            c.steps.pop_back();
    }
    // In the order of their execution.
    std::ranges::stable_partition(c.steps, [](const Step &step) { return targetOf(step.kind) != Target::Top; });
    allowUpdates(c);
}

void allowUpdates(Case &c)
{
    for (oracle::Object &object : c.scene.objects) {
        if ((object.flags & kAllowDataUpdate) != 0 && !invalid(c).empty())
            object.flags ^= kAllowDataUpdate | kAllowMicromapUpdate;
    }
}

void setConstantFlags(Random &random, oracle::Scene &scene)
{
    const uint32_t flags = withOtherOpacity(random, scene.rays[0].flags);
    for (Ray &ray : scene.rays)
        ray.flags = flags;
}

void fixFlags(Random &random, Case &c)
{
    c.trace.flags = chance(random, 50) ? TracePlan::Flags::Specialized : TracePlan::Flags::Literal;
    setConstantFlags(random, c.scene);
}

void selectFlags(Random &random, Case &c, uint32_t percent)
{
    if (c.trace.flags != TracePlan::Flags::RunTime || !chance(random, percent))
        return;
    c.trace.flags = TracePlan::Flags::Selected;
    std::vector<Ray> &rays = c.scene.rays;
    const uint32_t first = withOtherOpacity(random, rays[0].flags);
    const uint32_t second = withOtherOpacity(random, rays[below(random, static_cast<uint32_t>(rays.size()))].flags);
    for (Ray &ray : rays)
        ray.flags = chance(random, 50) ? first : second;
}

void terminateSome(Random &random, oracle::Scene &scene)
{
    for (Ray &ray : scene.rays)
        if (chance(random, 15))
            ray.rule = kTerminate;
}

void makeConditional(Random &random, Case &c, const DeviceLimits &limits, uint32_t percent)
{
    if (!limits.has(Fault::ConditionalBuilds) && chance(random, percent))
        c.build.conditional = static_cast<Conditional>(1 + below(random, limits.addressCommands() ? 4 : 2));
}

// Micromaps with more triangles get smaller numbers.
void sortMicromaps(oracle::Scene &scene)
{
    std::vector<uint32_t> order(scene.micromaps.size()); // by new numbers
    std::iota(order.begin(), order.end(), 0u);
    std::ranges::stable_sort(order, std::greater(),
                             [&](uint32_t micromap) { return scene.micromaps[micromap].triangles.size(); });
    std::vector<oracle::SceneMicromap> sorted;
    std::vector<uint32_t> numbers(order.size());
    for (const uint32_t micromap : order) {
        numbers[micromap] = static_cast<uint32_t>(sorted.size());
        sorted.push_back(std::move(scene.micromaps[micromap]));
    }
    scene.micromaps = std::move(sorted);
    for (oracle::Object &object : scene.objects)
        for (oracle::Mesh &mesh : object.meshes)
            if (mesh.micromap && mesh.micromap->micromap)
                mesh.micromap->micromap = numbers[*mesh.micromap->micromap];
}

// Of a case without steps and queries yet.
void varyInputs(Random &random, Case &c)
{
    c.build.sharedInputs = chance(random, 30);
    c.build.aliasedInputs = chance(random, 25);
    c.build.lateInputs = c.memory == Memory::Apart && chance(random, 25);
    // A micromap begins with the data of the next one, which is then uploaded to no memory of its own.
    if (c.build.sharedInputs)
        sortMicromaps(c.scene);
    std::vector<oracle::SceneMicromap> &micromaps = c.scene.micromaps;
    for (size_t m = 1; c.build.sharedInputs && m < micromaps.size(); ++m) {
        const oracle::SceneMicromap &from = micromaps[m - 1];
        if (((from.flags ^ micromaps[m].flags) & kLossy) != 0 || chance(random, 30))
            continue;
        micromaps[m].layout = from.layout;
        micromaps[m].triangleStride = from.triangleStride;
        std::copy_n(from.triangles.begin(), micromaps[m].triangles.size(), micromaps[m].triangles.begin());
    }
}

Launch randomCommand(Random &random, const DeviceLimits &limits)
{
    return chance(random, 60)                               ? Launch::Direct
           : limits.addressCommands() && chance(random, 60) ? Launch::Indirect2
                                                            : Launch::Indirect;
}

void setRecords(Random &random, Case &c)
{
    uint32_t meshes = 1, stride = c.trace.pipeline.parameters.recordStride & 15;
    for (const oracle::Object &object : c.scene.objects)
        meshes = std::max(meshes, static_cast<uint32_t>(object.meshes.size()));
    for (const PipelinePlan &pipeline : c.trace.otherPipelines)
        stride = std::max(stride, pipeline.parameters.recordStride & 15);
    constexpr uint32_t kOffsets = 6;
    const uint32_t kind = below(random, 100);
    const uint32_t first = kind < 50   ? 0
                           : kind < 75 ? below(random, 40)
                           : kind < 90 ? 240 + below(random, 30)
                           : kind < 98 ? below(random, 5000)
                                       : 65530 + below(random, 10);
    const uint32_t reach = kOffsets + (meshes - 1) * stride;
    const bool boxesFirst = chance(random, 50);
    for (oracle::Instance &instance : c.scene.instances) {
        const bool boxes = c.scene.objects[instance.object].hasBoxes();
        instance.record = first + (boxes == boxesFirst ? 0 : reach) + below(random, kOffsets);
    }
}

void skipNothing(Case &c)
{
    changeIfValid(c, [](Case &changed) {
        for (Ray &ray : changed.scene.rays)
            ray.flags &= ~(kRaySkipTriangles | kRaySkipBoxes);
    });
}

Outcome runRandomCase(Session &session, std::string_view group, uint64_t seed, MakeCase make)
{
    Random random(static_cast<Random::result_type>(seed ^ seed >> 32));
    Case c = make(random, session.limits());
    c.group = group;
    c.seed = seed;
    if (!session.limits().rayQueries)
        usePipelines(c);
    if (session.limits().has(Fault::AddressWithConstantFlags))
        useDescriptors(c.trace);
    if (!session.limits().skipsPrimitives)
        skipNothing(c);
    if (const std::string broken = invalid(c); !broken.empty())
        throw std::logic_error("an invalid case: " + broken);
    if (session.onlyMakesCases)
        return {.reproducer = toJson(c)};
    return runAndShrink(session, c, kShrinkSeconds);
}

} // namespace vellum::check
