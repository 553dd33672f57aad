// SPDX-License-Identifier: Apache-2.0
#include "check/case/trace.h"

#include <algorithm>
#include <map>
#include <stdexcept>

#include "check/case/trace_pipelines.h"
#include "check/oracle/pipeline_judge.h"
#include "check/oracle/query_judge.h"

namespace vellum::check
{
namespace
{

using oracle::Hit;
using oracle::Hits;
using oracle::Scene;

bool consumesMicromaps(const TracePlan &plan)
{
    return plan.mode == TracePlan::Mode::True || plan.mode == TracePlan::Mode::SpecializedTrue;
}

// Whether an instance has geometry with VkAccelerationStructureTrianglesOpacityMicromap..., also with a null micromap.
bool hasMicromaps(const Scene &scene)
{
    return std::any_of(scene.instances.begin(), scene.instances.end(), [&](const oracle::Instance &instance) {
        const auto &meshes = scene.objects[instance.object].meshes;
        return !instance.inactive &&
               std::any_of(meshes.begin(), meshes.end(), [](const oracle::Mesh &m) { return m.micromap.has_value(); });
    });
}

} // namespace

std::optional<std::string> sceneRule(const Device &gpu, const TracePlan &plan, const Scene &scene)
{
    if (!hasMicromaps(scene))
        return {};
    // Both rules ask how structures were built. An instance that disables micromaps makes no difference.
    if (plan.method == TracePlan::Method::Pipeline && plan.withoutMicromaps)
        return "VUID-vkCmdTraceRaysKHR-micromap-11640: the pipeline lacks the micromap bit";
    if (plan.method == TracePlan::Method::Query && gpu.khr() && !consumesMicromaps(plan))
        return "VUID-vkCmdDispatch-micromap-11636: the execution mode OpacityMicromapIdKHR is false";
    return {};
}

// What traces a batch of rays, all with the same flags unless they are of run time, and judges them.
class PlannedTracer::Pipelines
{
public:
    Pipelines(Device &gpu, const TracePlan &plan) : gpu_(gpu), plan_(plan) {}

    void setPlan(const TracePlan &plan) { plan_ = plan; }

    std::vector<std::string> faults(const Structure &top, const Scene &scene, std::span<const Hits> hits,
                                    const Record &beside)
    {
        if (const auto rule = sceneRule(gpu_, plan_, scene))
            throw std::logic_error(*rule);
        std::vector<std::string> faults(scene.rays.size());
        const Record *first = &beside;
        for (const std::vector<size_t> &batch : batches(scene)) {
            std::vector<Ray> rays;
            for (const size_t i : batch)
                rays.push_back(scene.rays[i]);
            const auto judge = [&](size_t n, const auto &judgeHits) {
                const size_t i = batch[n];
                if (!hits[i].unsure)
                    faults[i] = judgeHits(hits[i].hits);
            };
            if (plan_.method == TracePlan::Method::Query)
                traceQueries(top, scene, rays, *first, judge);
            else
                tracePipeline(top, scene, rays, *first, judge);
            static const Record kNothing;
            first = &kNothing;
        }
        return faults;
    }

private:
    [[nodiscard]] std::vector<std::vector<size_t>> batches(const Scene &scene) const
    {
        std::map<uint32_t, std::vector<size_t>> groups;
        for (size_t i = 0; i < scene.rays.size(); ++i)
            groups[plan_.flags == TracePlan::Flags::RunTime ? 0 : scene.rays[i].flags].push_back(i);
        std::vector<std::vector<size_t>> batches;
        for (const auto &[flags, rays] : groups) {
            for (size_t at = 0; at < rays.size(); at += StageProgram::kMostRays) {
                const size_t end = std::min<size_t>(rays.size(), at + StageProgram::kMostRays);
                batches.emplace_back(rays.begin() + static_cast<ptrdiff_t>(at),
                                     rays.begin() + static_cast<ptrdiff_t>(end));
            }
        }
        return batches;
    }

    // The flags that a pipeline has for these rays.
    [[nodiscard]] uint32_t key(std::span<const Ray> rays) const
    {
        return plan_.flags == TracePlan::Flags::RunTime ? 0 : rays[0].flags;
    }

    template <class Traces>
    void run(Traces &tracer, const Structure &top, std::span<const Ray> rays, const Record &beside)
    {
        if constexpr (std::is_same_v<Traces, PipelineTracer>)
            tracer.setLaunch(plan_.launch, plan_.recordPadding);
        tracer.prepare(top, rays, oracle::kCapacity);
        tracer.clearResults();
        gpu_.submit([&](VkCommandBuffer commands) {
            barrier(commands);
            if (beside && !plan_.boundFirst)
                beside(commands);
            tracer.bind(commands);
            if constexpr (std::is_same_v<Traces, PipelineTracer>) {
                if (plan_.dynamicStackSize)
                    gpu_.vk().CmdSetRayTracingPipelineStackSizeKHR(commands, tracer.stackSize());
            }
            if (beside && plan_.boundFirst)
                beside(commands);
            tracer.dispatch(commands);
            barrier(commands);
        });
    }

    template <class Judge>
    void traceQueries(const Structure &top, const Scene &scene, std::span<const Ray> rays, const Record &beside,
                      const Judge &judge)
    {
        std::unique_ptr<Tracer> &tracer = queries_[key(rays)];
        if (!tracer)
            tracer = queryTracer(gpu_, plan_, key(rays));
        run(*tracer, top, rays, beside);
        const std::vector<Result> results = tracer->results();
        for (size_t i = 0; i < results.size(); ++i)
            judge(i, [&](const std::vector<Hit> &hits) { return queryFault(scene, rays[i], hits, results[i]); });
    }

    template <class Judge>
    void tracePipeline(const Structure &top, const Scene &scene, std::span<const Ray> rays, const Record &beside,
                       const Judge &judge)
    {
        std::unique_ptr<PipelineTracer> &tracer = rayPipelines_[key(rays)];
        if (!tracer)
            tracer = pipelineTracer(gpu_, plan_, key(rays));
        run(*tracer, top, rays, beside);
        const oracle::Tolerance tolerance = oracle::toleranceFor(gpu_);
        const std::vector<PipelineResult> results = tracer->results();
        for (size_t i = 0; i < results.size(); ++i)
            judge(i, [&](const std::vector<Hit> &hits) {
                return pipelineFault(scene, rays[i], hits, results[i], tolerance);
            });
    }

    Device &gpu_;
    TracePlan plan_;
    // By the rays' flags, or 0 if they are of run time.
    std::map<uint32_t, std::unique_ptr<Tracer>> queries_;
    std::map<uint32_t, std::unique_ptr<PipelineTracer>> rayPipelines_;
};

PlannedTracer::PlannedTracer(Device &gpu, const TracePlan &plan) : pipelines_(std::make_unique<Pipelines>(gpu, plan)) {}
PlannedTracer::~PlannedTracer() = default;

void PlannedTracer::setPlan(const TracePlan &plan)
{
    pipelines_->setPlan(plan);
}

std::vector<std::string> PlannedTracer::faults(const Structure &top, const Scene &scene, std::span<const Hits> hits,
                                               const Record &beside)
{
    return pipelines_->faults(top, scene, hits, beside);
}

std::vector<std::string> traceFaults(Device &gpu, const Structure &top, const Scene &scene, std::span<const Hits> hits,
                                     const TracePlan &plan, const PlannedTracer::Record &beside)
{
    constexpr size_t kMost = 12; // tracers that are kept
    struct Tracers {
        std::vector<std::pair<TracePlan, std::unique_ptr<PlannedTracer>>> all;
    };
    const std::shared_ptr<Tracers> tracers = gpu.kept<Tracers>();
    TracePlan pipelines = plan; // what pipelines depend on
    pipelines.besideBuild = pipelines.boundFirst = false;
    pipelines.launch = Launch::Direct;
    pipelines.recordPadding = 0;
    auto found = std::find_if(tracers->all.begin(), tracers->all.end(),
                              [&](const auto &kept) { return kept.first == pipelines; });
    if (found == tracers->all.end()) {
        if (tracers->all.size() == kMost)
            tracers->all.erase(tracers->all.begin());
        tracers->all.emplace_back(pipelines, std::make_unique<PlannedTracer>(gpu, pipelines));
        found = std::prev(tracers->all.end());
    }
    found->second->setPlan(plan);
    return found->second->faults(top, scene, hits, beside);
}

} // namespace vellum::check
