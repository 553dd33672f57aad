// SPDX-License-Identifier: Apache-2.0
#include "check/case/lossy.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>

#include "check/case/names.h"
#include "check/oracle/pipeline_fault.h"
#include "check/oracle/scene_build.h"
#include "gpu/programs/stage_program.h"

namespace vellum::check
{
namespace
{

using oracle::Hits;
using oracle::LossyElement;
using oracle::LossyHit;
using oracle::Scene;

// Ray flags that distinguish the states of a triangle by whether it is a candidate. None of the rays commits a hit, so
// that every triangle on the ray is seen.
constexpr std::array kProbes{kRayNoOpaque, kRayNoOpaque | kRayForceTwoState, kRayCullOpaque};
using Seen = std::array<bool, kProbes.size()>;
constexpr std::array<Seen, 4> kSeenByState{
    {{false, false, false}, {true, true, false}, {true, false, true}, {true, true, true}}};

std::string describe(const LossyElement &at)
{
    return fmt::format("object {}, geometry {}, triangle {}, micro-triangle {}", at.object, at.geometry, at.primitive,
                       at.element);
}

std::string nameOfState(int state)
{
    return std::string(kStateNames[static_cast<size_t>(state)]);
}

void add(LossyStates &states, const LossyHit &hit, const Seen &seen)
{
    const auto state = std::ranges::find(kSeenByState, seen);
    if (state == kSeenByState.end()) {
        states.faults.emplace(hit.at, "the opacity of an element of a lossy micromap contradicts itself (" +
                                          describe(hit.at) + ")");
        return;
    }
    const int found = static_cast<int>(state - kSeenByState.begin());
    const auto [known, isNew] = states.states.emplace(hit.at, found);
    if (found != hit.state && found < 2)
        states.faults.emplace(hit.at, fmt::format("a lossy build makes a state a known one ({}: {} became {})",
                                                  describe(hit.at), nameOfState(hit.state), nameOfState(found)));
    else if (!isNew && known->second != found)
        states.faults.emplace(hit.at, fmt::format("an element of a lossy micromap has two states ({}: {} and {})",
                                                  describe(hit.at), nameOfState(known->second), nameOfState(found)));
}

template <class AnyTracer>
std::vector<Result> traceProbes(AnyTracer &tracer, const Structure &top, std::span<const Ray> rays)
{
    std::vector<Result> results;
    for (size_t at = 0; at < rays.size(); at += StageProgram::kMostRays) {
        const auto some = tracer.trace(
            top, rays.subspan(at, std::min<size_t>(rays.size() - at, StageProgram::kMostRays)), oracle::kCapacity);
        results.insert(results.end(), some.begin(), some.end());
    }
    return results;
}

// scene: what `top` and the probes are. Traces by ray queries if a pipeline must not trace the scene.
std::vector<Result> traceProbes(Device &gpu, const Structure &top, const Scene &scene, const TracePlan &trace)
{
    struct Kept {
        std::unique_ptr<Tracer> tracer;
        std::unique_ptr<PipelineTracer> pipeline;
    };
    const std::shared_ptr<Kept> kept = gpu.kept<Kept>();
    const TraceParameters &parameters = trace.pipeline.parameters;
    // Every record has an any-hit shader.
    const oracle::TracedBy by{.parameters = parameters,
                              .table = {.records = {oracle::HitRecord::Full}, .misses = trace.pipeline.table.misses}};
    if (trace.method == TracePlan::Method::Query || !oracle::tableRule(scene, by, false).empty()) {
        if (!kept->tracer)
            kept->tracer = std::make_unique<Tracer>(gpu);
        return traceProbes(*kept->tracer, top, scene.rays);
    }
    const PipelineTracerSetup setup{.groups = oracle::hitGroups(by.flags),
                                    .sbtOffset = parameters.recordOffset,
                                    .sbtStride = parameters.recordStride,
                                    .missIndex = parameters.missIndex};
    if (!kept->pipeline)
        kept->pipeline = std::make_unique<PipelineTracer>(gpu, setup);
    PipelineTracer tracer(*kept->pipeline, setup);
    tracer.setTable(oracle::tableOf(scene, by));
    return traceProbes(tracer, top, scene.rays);
}

} // namespace

LossyStates lossyStatesIn(Device &gpu, const BuiltCase &built, const Scene &scene, std::span<const Hits> hits,
                          const TracePlan &trace)
{
    // What BuiltCase::plainTop shows to the probes.
    Scene plain = scene;
    for (oracle::Instance &instance : plain.instances) {
        instance.flags = 0;
        instance.mask = 0xff;
    }
    plain.rays.clear();
    for (size_t i = 0; i < hits.size(); ++i) {
        if (hits[i].lossy.empty())
            continue;
        Ray ray = scene.rays[i];
        ray.cullMask = 0xff;
        ray.rule = kNever;
        ray.generate = 0;
        for (const uint32_t flags : kProbes) {
            ray.flags = flags;
            plain.rays.push_back(ray);
        }
    }
    const std::vector<Result> results = traceProbes(gpu, *built.plainTop(), plain, trace);
    LossyStates states;
    auto result = results.begin();
    for (const Hits &ray : hits) {
        if (ray.lossy.empty())
            continue;
        const std::span all(result, kProbes.size());
        result += kProbes.size();
        if (std::ranges::any_of(all, [](const Result &r) { return r.candidateCount > oracle::kCapacity; }))
            continue;
        for (const LossyHit &hit : ray.lossy) {
            Seen seen{};
            for (size_t p = 0; p < kProbes.size(); ++p)
                seen[p] = std::ranges::any_of(all[p].candidates, [&](const Candidate &c) {
                    return !c.box() && c.instance == hit.instance && c.geometry == hit.at.geometry &&
                           c.primitive == hit.at.primitive;
                });
            add(states, hit, seen);
        }
    }
    return states;
}

LossyStates lossyStatesOfTwin(Device &gpu, const Case &c, const oracle::Scene &scene, std::span<const Hits> hits)
{
    if (std::ranges::all_of(hits, [](const Hits &ray) { return ray.lossy.empty(); }))
        return {};
    Case plain{.scene = scene};
    for (uint32_t o = 0; o < scene.objects.size(); ++o)
        plain.scene.objects[o].flags = buildFlagsOf(c, o);
    // Behind another micromap and another structure, so that neither is the first that the device builds.
    oracle::Scene &to = plain.scene;
    to.micromaps.insert(to.micromaps.begin(), oracle::SceneMicromap(to.micromaps.front()));
    for (oracle::Object &object : to.objects)
        for (oracle::Mesh &mesh : object.meshes)
            if (mesh.micromap && mesh.micromap->micromap)
                ++*mesh.micromap->micromap;
    to.objects.insert(to.objects.begin(), oracle::Object(to.objects.front()));
    for (oracle::Instance &instance : to.instances)
        ++instance.object;
    Device &twin = gpu.twin();
    LossyStates states;
    {
        BuiltCase built(twin, plain);
        built.finish();
        states = lossyStatesIn(twin, built, scene, hits);
    }
    // Objects check their memory when they are destroyed.
    for (const std::string &fault : twin.takeFaults())
        gpu.fault(fault);
    return states;
}

std::vector<std::string> lossyFaults(const LossyStates &expected, const LossyStates &own, std::span<const Hits> hits)
{
    const auto faultAt = [&](const LossyElement &at) -> std::string {
        for (const LossyStates *const states : {&own, &expected})
            if (const auto fault = states->faults.find(at); fault != states->faults.end())
                return fault->second;
        const auto here = own.states.find(at), there = expected.states.find(at);
        if (here == own.states.end() || there == expected.states.end() || here->second == there->second)
            return {};
        return fmt::format("a lossy substitution is not that of an equal build on a second device ({}: {}, there {})",
                           describe(at), nameOfState(here->second), nameOfState(there->second));
    };
    std::vector<std::string> faults;
    for (const Hits &ray : hits) {
        std::string &fault = faults.emplace_back();
        for (const LossyHit &hit : ray.lossy) {
            if (fault.empty())
                fault = faultAt(hit.at);
        }
    }
    return faults;
}

} // namespace vellum::check
