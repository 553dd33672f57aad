// SPDX-License-Identifier: Apache-2.0
// Traces the rays of a scene by every kind of plan, and compares what they hit with the expected hits.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "check/case/case.h"
#include "check/oracle/cpu_trace.h"

namespace vellum::check
{

inline constexpr std::array kQueryStages{
    VK_SHADER_STAGE_COMPUTE_BIT,     VK_SHADER_STAGE_VERTEX_BIT,           VK_SHADER_STAGE_GEOMETRY_BIT,
    VK_SHADER_STAGE_FRAGMENT_BIT,    VK_SHADER_STAGE_TASK_BIT_EXT,         VK_SHADER_STAGE_MESH_BIT_EXT,
    VK_SHADER_STAGE_RAYGEN_BIT_KHR,  VK_SHADER_STAGE_MISS_BIT_KHR,         VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR,
    VK_SHADER_STAGE_ANY_HIT_BIT_KHR, VK_SHADER_STAGE_INTERSECTION_BIT_KHR, VK_SHADER_STAGE_CALLABLE_BIT_KHR,
};

// The stages of kTracerStageNames that a group of kTracerGroupNames may name: with pipeline flags, groups have shaders
// that they lack otherwise.
std::vector<uint32_t> stagesOfGroup(uint32_t group);

// The feature that the device lacks; nothing: it can trace by the plan.
std::optional<std::string> missingFor(const Device &gpu, const TracePlan &plan);

// Returns whether rays may skip triangles or boxes: "If the rayTraversalPrimitiveCulling or rayQuery features are
// enabled, the SkipTrianglesKHR and SkipAABBsKHR ray flags can be specified" (Ray Primitive Culling).
bool skipsPrimitives(const Device &gpu);

// Returns whether the ray queries of the plan have the execution mode OpacityMicromapIdKHR.
bool consumesMicromaps(const TracePlan &plan);

// The valid usage that tracing the scene by the plan would break: shaders that do not use micromaps may not trace
// structures that have some.
std::optional<std::string> sceneRule(const Device &gpu, const TracePlan &plan, const oracle::Scene &scene);

// The pipelines of a plan. The device must outlive it, and lack nothing for the plan.
class PlannedTracer
{
public:
    using Record = std::function<void(VkCommandBuffer)>;

    PlannedTracer(Device &gpu, const TracePlan &plan);
    PlannedTracer(const PlannedTracer &) = delete;
    PlannedTracer &operator=(const PlannedTracer &) = delete;
    ~PlannedTracer();

    // Sets another plan, of the same pipelines.
    void setPlan(const TracePlan &plan);

    // The fault of each ray of the scene, whose top level is `top`; empty: none, or the ray is unsure. hits: allHits of
    // each. beside: recorded once, in a submission that traces, without a barrier between.
    std::vector<std::string> faults(const Structure &top, const oracle::Scene &scene,
                                    std::span<const oracle::Hits> hits, const Record &beside = {});

private:
    class Pipelines;
    std::unique_ptr<Pipelines> pipelines_;
};

// Traces with the tracer of the plan that the device keeps.
std::vector<std::string> traceFaults(Device &gpu, const Structure &top, const oracle::Scene &scene,
                                     std::span<const oracle::Hits> hits, const TracePlan &plan,
                                     const PlannedTracer::Record &beside);

} // namespace vellum::check
