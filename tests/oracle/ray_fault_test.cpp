// SPDX-License-Identifier: Apache-2.0
// The checks of rays (pipeline_fault.h, query_fault.h) find each change to a correct result.
#include "check/oracle/pipeline_fault.h"
#include "check/oracle/query_fault.h"
#include "compare_scenes.h"

namespace
{

using namespace vellum::check::oracle;

// A change of a result, where there is something to change; false: nothing was changed.
template <class R>
struct Change {
    const char *name;
    std::function<bool(R &)> apply;
};

template <class R>
std::vector<Change<R>> changes()
{
    constexpr auto hit = [](const R &r) { return r.committed == vt::kTriangle; };
    return {
        {"committed", [=](R &r) { return hit(r) && (r.committed = vt::kNone, true); }},
        {"instance", [=](R &r) { return hit(r) && (++r.instance, true); }},
        {"geometry", [=](R &r) { return hit(r) && (++r.geometry, true); }},
        {"primitive", [=](R &r) { return hit(r) && (++r.primitive, true); }},
        {"custom index", [=](R &r) { return hit(r) && (r.customIndex ^= 1, true); }},
        {"t", [=](R &r) { return hit(r) && (r.t += 0.01f, true); }},
        {"u",
         [=](R &r) {
             if constexpr (requires { r.visits; }) { // Fault::ReportChangesAttributes
                 if (!r.visits.empty())
                     return false;
             }
             return hit(r) && (r.u += 0.01f, true);
         }},
        {"flags", [=](R &r) { return hit(r) && (r.flags ^= vt::kRayForceTwoState, true); }},
        {"tMin", [=](R &r) { return hit(r) && (r.tMin += 0.01f, true); }},
        {"candidate of another triangle",
         [](R &r) { return !r.candidates.empty() && !r.candidates[0].box() && (++r.candidates[0].primitive, true); }},
    };
}

// Makes one change of every kind that a ray allows, and expects each to be found. Unchanged results are correct.
template <class R>
void expectFound(const Scene &scene, const std::vector<R> &results,
                 const std::function<std::string(const vt::Ray &, const std::vector<Hit> &, const R &)> &faultOf)
{
    std::vector<Change<R>> all = changes<R>();
    if constexpr (std::is_same_v<R, vt::Result>) {
        // The record and the hit group decide in pipelines whether a hit has candidates.
        all.push_back({"no candidates", [](R &r) {
                           return r.candidates.size() == 1 && !r.candidates[0].box() && r.committed == vt::kNone &&
                                  (r.candidates.clear(), true);
                       }});
    } else {
        all.push_back({"hit kind", [](R &r) { return r.committed == vt::kTriangle && (r.hitKind ^= 1, true); }});
        all.push_back({"record", [](R &r) { return r.committed != vt::kUnknownResult && (++r.record, true); }});
        all.push_back({"payload", [](R &r) { return std::exchange(r.intact, false); }});
    }
    std::map<std::string, uint32_t> made;
    for (size_t i = 0; i < results.size(); ++i) {
        const Hits hits = allHits(scene, scene.rays[i]);
        if (hits.unsure)
            continue;
        ASSERT_EQ(faultOf(scene.rays[i], hits.hits, results[i]), "") << "ray " << i;
        for (const Change<R> &change : all) {
            R changed = results[i];
            if (!change.apply(changed))
                continue;
            ++made[change.name];
            const std::string fault = faultOf(scene.rays[i], hits.hits, changed);
            EXPECT_NE(fault, "") << "ray " << i << ": " << change.name;
            EXPECT_EQ(causeOf(fault).find_first_of("0123456789#"), std::string::npos) << fault;
        }
    }
    EXPECT_EQ(made.size(), all.size());
    for (const auto &[name, count] : made)
        EXPECT_GE(count, 5u) << name;
}

class RayFaults : public vt::GpuTest
{
protected:
    RayFaults()
    {
        // A scene in which rays meet boxes and several triangles, some of geometries that promise one invocation. That
        // of seed 10 crashes lavapipe 26.1.6, without the layer as well.
        Random random(setting("VELLUM_ORACLE_SEED", 13));
        scene_ = randomScene(random, {.rays = 400});
        bool promise = false;
        for (Object &object : scene_.objects)
            for (Mesh &mesh : object.meshes)
                mesh.noDuplicates = std::exchange(promise, !promise);
        built_ = build(gpu(), scene_);
    }

    std::vector<vt::Result> tracedByQueries() { return vt::Tracer(gpu()).trace(*built_.scene, scene_.rays, kCapacity); }
    std::vector<vt::PipelineResult> tracedByPipelines()
    {
        vt::PipelineTracer tracer(gpu(), {.groups = {kHitGroups.begin(), kHitGroups.end()},
                                          .records = {kHitRecords.begin(), kHitRecords.end()},
                                          .sbtStride = 1});
        return tracer.trace(*built_.scene, scene_.rays, kCapacity);
    }
    auto faultOfQuery()
    {
        return [this](const vt::Ray &ray, const std::vector<Hit> &hits, const vt::Result &result) {
            return queryFault(scene_, ray, hits, result);
        };
    }
    auto faultOfPipeline()
    {
        return [this](const vt::Ray &ray, const std::vector<Hit> &hits, const vt::PipelineResult &result) {
            return pipelineFault(scene_, ray, hits, result, toleranceFor(gpu()));
        };
    }
    Scene scene_;
    Built built_;
};

TEST_F(RayFaults, FindsChangedResultsOfQueries)
{
    expectFound<vt::Result>(scene_, tracedByQueries(), faultOfQuery());
}

TEST_F(RayFaults, FindsChangedResultsOfPipelines)
{
    if (!gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        GTEST_SKIP() << "no ray tracing pipelines";
    expectFound<vt::PipelineResult>(scene_, tracedByPipelines(), faultOfPipeline());
}

// The same results on a device that reports candidates in another order, or repeats them.
template <class R>
R otherwise(const R &result, bool again)
{
    std::vector<size_t> order;
    for (size_t i = 0; i < result.candidates.size(); ++i)
        order.insert(order.end(), again ? 2 : 1, i);
    // Sorted from the farthest to the nearest, no candidate is beyond a confirmed hit.
    if (!again)
        std::ranges::stable_sort(order, std::greater{}, [&](size_t i) { return result.candidates[i].t; });
    R other = result;
    other.candidates.clear();
    for (const size_t i : order)
        other.candidates.push_back(result.candidates[i]);
    other.candidateCount = static_cast<uint32_t>(order.size());
    if constexpr (requires { other.notes; }) {
        other.notes.clear();
        for (const size_t i : order)
            other.notes.push_back(result.notes[i]);
    }
    return other;
}

// Expects that the result is accepted, unless a geometry has VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR.
template <class R>
void expectAllowed(const Scene &scene, const std::vector<R> &results,
                   const std::function<std::string(const vt::Ray &, const std::vector<Hit> &, const R &)> &faultOf)
{
    uint32_t reordered = 0, repeated = 0, promised = 0;
    for (size_t i = 0; i < results.size(); ++i) {
        const Hits hits = allHits(scene, scene.rays[i]);
        if (hits.unsure || results[i].candidates.empty())
            continue;
        const R sorted = otherwise(results[i], false);
        EXPECT_EQ(faultOf(scene.rays[i], hits.hits, sorted), "") << "ray " << i;
        reordered += sorted.candidates.front().primitive != results[i].candidates.front().primitive ? 1u : 0u;
        const bool once = std::ranges::any_of(results[i].candidates, [&](const vt::Candidate &c) {
            return !c.box() && scene.objects[scene.instances[c.instance].object].meshes[c.geometry].noDuplicates;
        });
        EXPECT_EQ(faultOf(scene.rays[i], hits.hits, otherwise(results[i], true)) != "", once) << "ray " << i;
        ++(once ? promised : repeated);
    }
    EXPECT_GE(std::min({reordered, repeated, promised}), 5u) << reordered << ' ' << repeated << ' ' << promised;
}

TEST_F(RayFaults, AllowsOtherCandidatesOfQueries)
{
    expectAllowed<vt::Result>(scene_, tracedByQueries(), faultOfQuery());
}

TEST_F(RayFaults, AllowsOtherCandidatesOfPipelines)
{
    if (!gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        GTEST_SKIP() << "no ray tracing pipelines";
    expectAllowed<vt::PipelineResult>(scene_, tracedByPipelines(), faultOfPipeline());
}

// Deviations that are tolerated where Vellum's layer emulates are faults elsewhere.
TEST_F(RayFaults, ToleratesNothingOnOtherDevices)
{
    if (!gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        GTEST_SKIP() << "no ray tracing pipelines";
    vt::PipelineTracer tracer(gpu(), {.groups = {kHitGroups.begin(), kHitGroups.end()},
                                      .records = {kHitRecords.begin(), kHitRecords.end()},
                                      .sbtStride = 1});
    const auto results = tracer.trace(*built_.scene, scene_.rays, kCapacity);
    Tolerance strict = toleranceFor(gpu());
    EXPECT_TRUE(std::exchange(strict.layerIntersectionShaders, false));
    uint32_t tried = 0;
    for (size_t i = 0; i < results.size(); ++i) {
        const vt::Ray &ray = scene_.rays[i];
        const Hits hits = allHits(scene_, ray);
        vt::PipelineResult changed = results[i];
        if (hits.unsure || changed.visits.empty() || (ray.flags & vt::kRayForceTwoState) == 0)
            continue;
        changed.visits[0].flags = ray.flags & ~(vt::kRayOpaque | vt::kRayCullNoOpaque | vt::kRayForceTwoState);
        ++tried;
        EXPECT_EQ(pipelineFault(scene_, ray, hits.hits, changed, toleranceFor(gpu())), "") << "ray " << i;
        EXPECT_NE(pipelineFault(scene_, ray, hits.hits, changed, strict), "") << "ray " << i;
    }
    EXPECT_GE(tried, 3u);
}

} // namespace
