// SPDX-License-Identifier: Apache-2.0
#include "check/case/trace.h"

#include <algorithm>
#include <map>
#include <stdexcept>

#include "check/case/trace_pipelines.h"
#include "check/oracle/pipeline_fault.h"
#include "check/oracle/query_fault.h"
#include "shaders/plain_compute.h"

namespace vellum::check
{
namespace
{

using oracle::Hit;
using oracle::Hits;
using oracle::Scene;

// Returns whether an instance has geometry with VkAccelerationStructureTrianglesOpacityMicromap..., also with a null
// micromap.
bool hasMicromaps(const Scene &scene)
{
    return std::any_of(scene.instances.begin(), scene.instances.end(), [&](const oracle::Instance &instance) {
        const auto &meshes = scene.objects[instance.object].meshes;
        return !instance.inactive &&
               std::any_of(meshes.begin(), meshes.end(), [](const oracle::Mesh &m) { return m.micromap.has_value(); });
    });
}

// A callable shader adds the data of its record to the number of the ray.
std::string callableFault(uint32_t ray, uint32_t called, const oracle::TracedBy &by)
{
    const uint32_t record =
        by.table.content == RecordData::None ? kUnknownResult : by.data + 40 + ray % PipelineTracer::kCallables;
    return called == ray + record ? ""
                                  : "a callable shader reads another record (" + std::to_string(called - ray) +
                                        ", not " + std::to_string(record) + ")";
}

} // namespace

bool consumesMicromaps(const TracePlan &plan)
{
    return plan.mode == TracePlan::Mode::True || plan.mode == TracePlan::Mode::SpecializedTrue ||
           plan.mode == TracePlan::Mode::ComputedTrue;
}

std::optional<std::string> sceneRule(const Device &gpu, const TracePlan &plan, const Scene &scene)
{
    if (!hasMicromaps(scene))
        return {};
    // Both rules depend on how structures were built. An instance that disables micromaps makes no difference.
    if (plan.method == TracePlan::Method::Pipeline && plan.withoutMicromaps)
        return "VUID-vkCmdTraceRaysKHR-micromap-11640: the pipeline lacks the micromap bit";
    if (plan.method == TracePlan::Method::Query && gpu.khr() && !consumesMicromaps(plan))
        return "VUID-vkCmdDispatch-micromap-11636: the execution mode OpacityMicromapIdKHR is false";
    return {};
}

// Traces a batch of rays, all with the same flags unless they are of run time, and checks their results.
class PlannedTracer::Pipelines
{
public:
    Pipelines(Device &gpu, const TracePlan &plan) : gpu_(gpu) { setPlan(plan); }

    void setPlan(const TracePlan &plan)
    {
        plan_ = plan;
        pipelines_ = {plan.pipeline};
        pipelines_.insert(pipelines_.end(), plan.otherPipelines.begin(), plan.otherPipelines.end());
    }

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
            const auto check = [&](size_t n, const auto &faultOf) {
                const size_t i = batch[n];
                if (!hits[i].unsure && faults[i].empty())
                    faults[i] = faultOf(hits[i].hits);
            };
            if (plan_.method == TracePlan::Method::Query)
                traceQueries(top, scene, rays, *first, check);
            else
                tracePipelines(top, scene, rays, *first, check);
            static const Record kNothing;
            first = &kNothing;
        }
        return faults;
    }

private:
    [[nodiscard]] std::vector<std::vector<size_t>> batches(const Scene &scene) const
    {
        std::map<uint32_t, std::vector<size_t>> groups;
        std::vector<uint32_t> different; // flags, of which a shader selects one of each two
        for (size_t i = 0; i < scene.rays.size(); ++i) {
            const uint32_t flags = scene.rays[i].flags;
            const auto found = std::ranges::find(different, flags);
            const auto number = static_cast<uint32_t>(found - different.begin());
            if (found == different.end())
                different.push_back(flags);
            groups[isConstant() ? flags : isSelected() ? number / 2 : 0].push_back(i);
        }
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

    // Returns whether all rays of a pipeline have the same flags.
    [[nodiscard]] bool isConstant() const
    {
        return plan_.flags == TracePlan::Flags::Specialized || plan_.flags == TracePlan::Flags::Literal;
    }
    [[nodiscard]] bool isSelected() const { return plan_.flags == TracePlan::Flags::Selected; }
    // The flags that a pipeline has for these rays: queryTracer.
    [[nodiscard]] uint32_t key(std::span<const Ray> rays) const
    {
        if (isSelected()) {
            const auto other = std::ranges::find_if(rays, [&](const Ray &ray) { return ray.flags != rays[0].flags; });
            return rays[0].flags | (other == rays.end() ? rays[0] : *other).flags << 16;
        }
        return isConstant() || plan_.flags == TracePlan::Flags::Mixed ? rays[0].flags : 0;
    }

    // Makes structures that earlier submissions have built visible to rays, and nothing else.
    static void structuresBarrier(VkCommandBuffer commands)
    {
        const auto built = vkInit<VkMemoryBarrier>({.srcAccessMask = VK_ACCESS_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
                                                    .dstAccessMask = VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR});
        vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                             VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 1, &built, 0, nullptr, 0, nullptr);
    }

    // Makes what shaders have written visible to the host, and to nothing else.
    static void resultsBarrier(VkCommandBuffer commands)
    {
        const auto written = vkInit<VkMemoryBarrier>(
            {.srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT, .dstAccessMask = VK_ACCESS_HOST_READ_BIT});
        vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &written,
                             0, nullptr, 0, nullptr);
    }

    // Traces by tracers that are prepared.
    template <class Traces>
    void run(std::span<Traces *const> tracers, const Record &beside)
    {
        for (Traces *const tracer : tracers)
            tracer->clearResults();
        const auto bindProgram = [&](VkCommandBuffer commands, const Traces &tracer) {
            if constexpr (std::is_same_v<Traces, Tracer>) {
                if (plan_.rebound)
                    programBefore(tracer).bind(commands);
            }
            tracer.bindProgram(commands);
            if constexpr (std::is_same_v<Traces, PipelineTracer>) {
                if (plan_.dynamicStackSize)
                    gpu_.vk().CmdSetRayTracingPipelineStackSizeKHR(commands, tracer.stackSize());
            }
        };
        gpu_.submit(
            [&](VkCommandBuffer commands) {
                // What the host has written, such as tables, needs no barrier.
                if (plan_.rerecorded && gpu_.options().memory != gpu::Memory::DeviceLocal)
                    structuresBarrier(commands);
                else
                    barrier(commands);
                if (beside && !plan_.boundFirst)
                    beside(commands);
                if (!plan_.pipelineLast)
                    bindProgram(commands, *tracers.front());
                tracers.front()->bindSet(commands, plan_.maintenance6);
                if (beside && plan_.boundFirst)
                    beside(commands);
                if (plan_.pipelineLast)
                    bindProgram(commands, *tracers.front());
                for (Traces *const tracer : tracers) {
                    if (tracer != tracers.front()) {
                        bindProgram(commands, *tracer);
                        tracer->bindSet(commands, plan_.maintenance6);
                    }
                    tracer->dispatch(commands);
                }
                if (plan_.rerecorded)
                    resultsBarrier(commands);
                else
                    barrier(commands);
            },
            {.secondary = plan_.secondary, .times = plan_.twice ? 2u : 1u, .rerecorded = plan_.rerecorded});
    }

    // TracePlan::rebound: a pipeline where shader objects trace, a shader object where a pipeline does.
    const StageProgram &programBefore(const Tracer &tracer)
    {
        if (!programBefore_)
            programBefore_ =
                makeStageProgram(gpu_, tracer.layout(),
                                 {.words = plain_compute,
                                  .objectLayout = plan_.shaderObjects ? VK_NULL_HANDLE : tracer.setLayout(),
                                  .pushSize = sizeof(uint32_t)});
        return *programBefore_;
    }

    template <class Check>
    void traceQueries(const Structure &top, const Scene &scene, std::span<const Ray> rays, const Record &beside,
                      const Check &check)
    {
        std::unique_ptr<Tracer> &tracer = queries_[key(rays)];
        if (!tracer)
            tracer = queryTracer(gpu_, plan_, key(rays));
        LaunchPlan launch = plan_.launch;
        launch.height = launch.depth = 1;
        tracer->setLaunch(launch);
        tracer->prepare(top, rays, oracle::kCapacity);
        Tracer *const one = tracer.get();
        run(std::span(&one, 1), beside);
        const std::vector<Result> results = tracer->results();
        for (size_t i = 0; i < results.size(); ++i)
            check(i, [&](const std::vector<Hit> &hits) { return queryFault(scene, rays[i], hits, results[i]); });
    }

    struct PipelineTrace {
        size_t pipeline, table;
        oracle::TracedBy by;
    };
    // Every table of every pipeline, from the pipeline `first` on.
    [[nodiscard]] std::vector<PipelineTrace> pipelineTraces(size_t first) const
    {
        std::vector<PipelineTrace> traces;
        for (size_t p = first; p < pipelines_.size(); ++p) {
            for (size_t t = 0; t <= pipelines_[p].otherTables.size(); ++t)
                traces.push_back({p,
                                  t,
                                  {pipelines_[p].flags, pipelines_[p].parameters,
                                   t == 0 ? pipelines_[p].table : pipelines_[p].otherTables[t - 1],
                                   static_cast<uint32_t>(p * 16 + t) << 20}});
            if (const auto zero = traces.back().by.table.zeroData)
                traces.back().by.data = 0u - PipelineTracer::kFirstHitData - *zero;
        }
        return traces;
    }
    PipelineTracer &tracerFor(const PipelineTrace &trace, uint32_t flags)
    {
        auto &tracers = rayPipelines_[{flags, trace.pipeline}];
        while (tracers.size() <= trace.table)
            tracers.push_back(pipelineTracer(gpu_, plan_, pipelines_[trace.pipeline], flags,
                                             tracers.empty() ? nullptr : tracers[0].get()));
        return *tracers[trace.table];
    }

    // TracePlan::tablesInPlace: a buffer for each pipeline, for the copies of its tables.
    std::vector<Buffer> buffersForTables(std::span<const PipelineTrace> traces,
                                         std::span<PipelineTracer *const> tracers) const
    {
        std::vector<VkDeviceSize> bytes(plan_.tablesInPlace ? pipelines_.size() : 0);
        for (size_t k = 0; !bytes.empty() && k < traces.size(); ++k)
            bytes[traces[k].pipeline] = std::max(bytes[traces[k].pipeline], tracers[k]->table().bytes());
        std::vector<Buffer> buffers;
        for (const VkDeviceSize size : bytes)
            buffers.push_back(BindingTable::bufferForCopies(gpu_, std::max<VkDeviceSize>(size, 4)));
        return buffers;
    }

    template <class Check>
    void tracePipelines(const Structure &top, const Scene &scene, std::span<const Ray> rays, const Record &beside,
                        const Check &check)
    {
        tracePipelines(top, scene, rays, beside, check, 0);
        if (!plan_.firstDestroyed)
            return;
        rayPipelines_.erase({key(rays), 0});
        tracePipelines(top, scene, rays, {}, check, 1);
    }

    template <class Check>
    void tracePipelines(const Structure &top, const Scene &scene, std::span<const Ray> rays, const Record &beside,
                        const Check &check, size_t first)
    {
        const std::vector<PipelineTrace> traces = pipelineTraces(first);
        std::vector<PipelineTracer *> tracers;
        for (const PipelineTrace &trace : traces) {
            PipelineTracer &tracer = *tracers.emplace_back(&tracerFor(trace, key(rays)));
            tracer.setTable(oracle::tableOf(scene, trace.by));
            tracer.setLaunch(plan_.launch);
        }
        const std::vector<Buffer> copies = buffersForTables(traces, tracers);
        for (size_t k = 0; k < traces.size(); ++k)
            tracers[k]->prepare(top, rays, oracle::kCapacity,
                                plan_.tablesInPlace ? &copies[traces[k].pipeline] : nullptr, plan_.tableBarrier);
        run(std::span<PipelineTracer *const>(tracers), beside);
        const oracle::Tolerance tolerance = oracle::toleranceFor(gpu_);
        for (size_t k = 0; k < traces.size(); ++k) {
            const std::vector<PipelineResult> results = tracers[k]->results();
            for (size_t i = 0; i < results.size(); ++i)
                check(i, [&](const std::vector<Hit> &hits) {
                    std::string fault = pipelineFault(scene, rays[i], hits, results[i], tolerance, traces[k].by);
                    if (fault.empty() && plan_.callables)
                        fault = callableFault(static_cast<uint32_t>(i), results[i].called, traces[k].by);
                    if (!fault.empty() && traces.size() > 1)
                        fault += " (pipeline " + std::to_string(traces[k].pipeline) + ", table " +
                                 std::to_string(traces[k].table) +
                                 (first > 0 ? ", after the first pipeline was destroyed)" : ")");
                    return fault;
                });
        }
    }

    Device &gpu_;
    TracePlan plan_;
    // By the constant flags of rays, or 0.
    std::map<uint32_t, std::unique_ptr<Tracer>> queries_;
    std::unique_ptr<StageProgram> programBefore_;
    // By the flags and the number of the pipeline: one for each table.
    std::map<std::pair<uint32_t, size_t>, std::vector<std::unique_ptr<PipelineTracer>>> rayPipelines_;
    std::vector<PipelinePlan> pipelines_;
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
    TracePlan pipelines = plan; // the members that pipelines depend on
    pipelines.besideBuild = pipelines.boundFirst = pipelines.pipelineLast = false;
    pipelines.maintenance6 = pipelines.secondary = pipelines.twice = pipelines.rebound = false;
    pipelines.rerecorded = false;
    pipelines.launch = {};
    pipelines.firstDestroyed = pipelines.tablesInPlace = false;
    pipelines.tableBarrier = 0;
    const auto withoutTables = [](PipelinePlan &pipeline) {
        pipeline.table = {};
        pipeline.otherTables.clear();
    };
    withoutTables(pipelines.pipeline);
    std::ranges::for_each(pipelines.otherPipelines, withoutTables);
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
