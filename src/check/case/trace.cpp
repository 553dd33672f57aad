// SPDX-License-Identifier: Apache-2.0
#include "check/case/trace.h"

#include "check/oracle/pipeline_judge.h"
#include "check/oracle/query_judge.h"

namespace vellum::check
{

std::optional<std::string> missingFor(const Device &gpu, const TracePlan &plan)
{
    if (plan.method == TracePlan::Method::Pipeline && !gpu.has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        return "no ray tracing pipelines";
    return {};
}

std::vector<std::string> traceFaults(Device &gpu, const Structure &top, const oracle::Scene &scene,
                                     std::span<const oracle::Hits> hits, const TracePlan &plan,
                                     const std::function<void(VkCommandBuffer)> &beside)
{
    std::vector<std::string> faults(scene.rays.size());
    if (plan.method == TracePlan::Method::Query) {
        Tracer tracer(gpu);
        tracer.prepare(top, scene.rays, oracle::kCapacity);
        gpu.submit([&](VkCommandBuffer commands) {
            barrier(commands);
            if (plan.besideBuild)
                beside(commands);
            tracer.bind(commands);
            tracer.dispatch(commands);
            barrier(commands);
        });
        const std::vector<Result> results = tracer.results();
        for (size_t i = 0; i < faults.size(); ++i) {
            if (!hits[i].unsure)
                faults[i] = oracle::faultOf(scene, scene.rays[i], hits[i], [&](const std::vector<oracle::Hit> &h) {
                    return oracle::queryFault(scene.rays[i], h, results[i]);
                });
        }
    } else {
        PipelineTracer tracer(gpu, {.groups = {oracle::kHitGroups.begin(), oracle::kHitGroups.end()},
                                    .records = {oracle::kHitRecords.begin(), oracle::kHitRecords.end()},
                                    .sbtStride = 1});
        const std::vector<PipelineResult> results = tracer.trace(top, scene.rays, oracle::kCapacity);
        for (size_t i = 0; i < faults.size(); ++i) {
            if (!hits[i].unsure)
                faults[i] = oracle::faultOf(scene, scene.rays[i], hits[i], [&](const std::vector<oracle::Hit> &h) {
                    return oracle::pipelineFault(scene, scene.rays[i], h, results[i]);
                });
        }
    }
    return faults;
}

} // namespace vellum::check
