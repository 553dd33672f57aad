// SPDX-License-Identifier: Apache-2.0
#include "check/case/trace_pipelines.h"

#include <array>
#include <stdexcept>

#include "check/case/trace.h"
#include "check/oracle/pipeline_fault.h"
#include "gpu/execution_mode.h"
#include "gpu/programs/pipeline_libraries.h"
#include "shaders/pipeline_traces_rchit.h"
#include "shaders/pipeline_traces_rchit_by_address.h"
#include "shaders/pipeline_traces_rchit_computed.h"
#include "shaders/pipeline_traces_rchit_computed_by_address.h"
#include "shaders/pipeline_traces_rchit_mixed.h"
#include "shaders/pipeline_traces_rchit_mixed_by_address.h"
#include "shaders/pipeline_traces_rchit_specialized.h"
#include "shaders/pipeline_traces_rchit_specialized_by_address.h"
#include "shaders/pipeline_traces_rgen.h"
#include "shaders/pipeline_traces_rgen_by_address.h"
#include "shaders/pipeline_traces_rgen_calls.h"
#include "shaders/pipeline_traces_rgen_computed.h"
#include "shaders/pipeline_traces_rgen_computed_by_address.h"
#include "shaders/pipeline_traces_rgen_mixed.h"
#include "shaders/pipeline_traces_rgen_mixed_by_address.h"
#include "shaders/pipeline_traces_rgen_specialized.h"
#include "shaders/pipeline_traces_rgen_specialized_by_address.h"
#include "shaders/pipeline_traces_rmiss.h"
#include "shaders/pipeline_traces_rmiss_by_address.h"
#include "shaders/pipeline_traces_rmiss_computed.h"
#include "shaders/pipeline_traces_rmiss_computed_by_address.h"
#include "shaders/pipeline_traces_rmiss_mixed.h"
#include "shaders/pipeline_traces_rmiss_mixed_by_address.h"
#include "shaders/pipeline_traces_rmiss_specialized.h"
#include "shaders/pipeline_traces_rmiss_specialized_by_address.h"
#include "shaders/tracer_comp.h"
#include "shaders/tracer_comp_again.h"
#include "shaders/tracer_comp_again_optimized.h"
#include "shaders/tracer_comp_again_specialized.h"
#include "shaders/tracer_comp_beside.h"
#include "shaders/tracer_comp_beside_optimized.h"
#include "shaders/tracer_comp_beside_specialized.h"
#include "shaders/tracer_comp_by_address.h"
#include "shaders/tracer_comp_carried.h"
#include "shaders/tracer_comp_carried_optimized.h"
#include "shaders/tracer_comp_carried_specialized.h"
#include "shaders/tracer_comp_getters.h"
#include "shaders/tracer_comp_getters_optimized.h"
#include "shaders/tracer_comp_getters_specialized.h"
#include "shaders/tracer_comp_in_array.h"
#include "shaders/tracer_comp_in_array_optimized.h"
#include "shaders/tracer_comp_in_array_specialized.h"
#include "shaders/tracer_comp_in_condition.h"
#include "shaders/tracer_comp_in_condition_optimized.h"
#include "shaders/tracer_comp_in_condition_specialized.h"
#include "shaders/tracer_comp_in_functions.h"
#include "shaders/tracer_comp_in_functions_optimized.h"
#include "shaders/tracer_comp_in_functions_specialized.h"
#include "shaders/tracer_comp_optimized.h"
#include "shaders/tracer_comp_sites.h"
#include "shaders/tracer_comp_sites_optimized.h"
#include "shaders/tracer_comp_sites_specialized.h"
#include "shaders/tracer_comp_specialized.h"
#include "shaders/tracer_comp_specialized_by_address.h"
#include "shaders/tracer_frag.h"
#include "shaders/tracer_frag_by_address.h"
#include "shaders/tracer_frag_specialized.h"
#include "shaders/tracer_frag_specialized_by_address.h"
#include "shaders/tracer_geom.h"
#include "shaders/tracer_geom_by_address.h"
#include "shaders/tracer_geom_specialized.h"
#include "shaders/tracer_geom_specialized_by_address.h"
#include "shaders/tracer_mesh.h"
#include "shaders/tracer_mesh_by_address.h"
#include "shaders/tracer_mesh_specialized.h"
#include "shaders/tracer_mesh_specialized_by_address.h"
#include "shaders/tracer_rahit.h"
#include "shaders/tracer_rahit_by_address.h"
#include "shaders/tracer_rahit_specialized.h"
#include "shaders/tracer_rahit_specialized_by_address.h"
#include "shaders/tracer_rcall.h"
#include "shaders/tracer_rcall_by_address.h"
#include "shaders/tracer_rcall_specialized.h"
#include "shaders/tracer_rcall_specialized_by_address.h"
#include "shaders/tracer_rchit.h"
#include "shaders/tracer_rchit_by_address.h"
#include "shaders/tracer_rchit_specialized.h"
#include "shaders/tracer_rchit_specialized_by_address.h"
#include "shaders/tracer_rgen.h"
#include "shaders/tracer_rgen_by_address.h"
#include "shaders/tracer_rgen_specialized.h"
#include "shaders/tracer_rgen_specialized_by_address.h"
#include "shaders/tracer_rint.h"
#include "shaders/tracer_rint_by_address.h"
#include "shaders/tracer_rint_specialized.h"
#include "shaders/tracer_rint_specialized_by_address.h"
#include "shaders/tracer_rmiss.h"
#include "shaders/tracer_rmiss_by_address.h"
#include "shaders/tracer_rmiss_specialized.h"
#include "shaders/tracer_rmiss_specialized_by_address.h"
#include "shaders/tracer_task.h"
#include "shaders/tracer_task_by_address.h"
#include "shaders/tracer_task_specialized.h"
#include "shaders/tracer_task_specialized_by_address.h"
#include "shaders/tracer_vert.h"
#include "shaders/tracer_vert_buffers.h"
#include "shaders/tracer_vert_by_address.h"
#include "shaders/tracer_vert_specialized.h"
#include "shaders/tracer_vert_specialized_by_address.h"

namespace vellum::check
{
namespace
{

struct Variants {
    VkShaderStageFlagBits stage;
    // Plain, with specialized flags, by address, with both.
    std::array<std::span<const uint32_t>, 4> words;
};

#define VARIANTS(stage, name)                                                                                          \
    {                                                                                                                  \
        stage,                                                                                                         \
        {                                                                                                              \
            name, name##_specialized, name##_by_address, name##_specialized_by_address                                 \
        }                                                                                                              \
    }
const std::array<Variants, 12> kQueries{{
    VARIANTS(VK_SHADER_STAGE_COMPUTE_BIT, tracer_comp),
    VARIANTS(VK_SHADER_STAGE_VERTEX_BIT, tracer_vert),
    VARIANTS(VK_SHADER_STAGE_GEOMETRY_BIT, tracer_geom),
    VARIANTS(VK_SHADER_STAGE_FRAGMENT_BIT, tracer_frag),
    VARIANTS(VK_SHADER_STAGE_TASK_BIT_EXT, tracer_task),
    VARIANTS(VK_SHADER_STAGE_MESH_BIT_EXT, tracer_mesh),
    VARIANTS(VK_SHADER_STAGE_RAYGEN_BIT_KHR, tracer_rgen),
    VARIANTS(VK_SHADER_STAGE_MISS_BIT_KHR, tracer_rmiss),
    VARIANTS(VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, tracer_rchit),
    VARIANTS(VK_SHADER_STAGE_ANY_HIT_BIT_KHR, tracer_rahit),
    VARIANTS(VK_SHADER_STAGE_INTERSECTION_BIT_KHR, tracer_rint),
    VARIANTS(VK_SHADER_STAGE_CALLABLE_BIT_KHR, tracer_rcall),
}};
#undef VARIANTS

// As compiled, with specialized flags, optimized.
using Forms = std::array<std::span<const uint32_t>, 3>;
#define FORMS(name)                                                                                                    \
    {                                                                                                                  \
        name, name##_specialized, name##_optimized                                                                     \
    }

// The modules for each source of flags: by a descriptor, by address.
struct Tracing {
    VkShaderStageFlagBits stage;
    std::array<std::span<const uint32_t>, 2> plain, specialized, mixed, computed;
};
#define TRACING(stage, name)                                                                                           \
    {                                                                                                                  \
        stage, {name, name##_by_address}, {name##_specialized, name##_specialized_by_address},                         \
            {name##_mixed, name##_mixed_by_address},                                                                   \
        {                                                                                                              \
            name##_computed, name##_computed_by_address                                                                \
        }                                                                                                              \
    }
const std::array<Tracing, 3> kTracing{{
    TRACING(VK_SHADER_STAGE_RAYGEN_BIT_KHR, pipeline_traces_rgen),
    TRACING(VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, pipeline_traces_rchit),
    TRACING(VK_SHADER_STAGE_MISS_BIT_KHR, pipeline_traces_rmiss),
}};
#undef TRACING

template <class Modules>
const typename Modules::value_type &ofStage(const Modules &modules, VkShaderStageFlagBits stage)
{
    for (const auto &variants : modules)
        if (variants.stage == stage)
            return variants;
    throw std::runtime_error("rays are not traced from this stage");
}

} // namespace

std::span<const uint32_t> vertexBufferModule()
{
    return tracer_vert_buffers;
}

std::span<const uint32_t> callingModule()
{
    return pipeline_traces_rgen_calls;
}

std::span<const uint32_t> queryModule(VkShaderStageFlagBits stage, bool specialized, bool byAddress)
{
    return ofStage(kQueries, stage).words[(specialized ? 1u : 0u) + (byAddress ? 2u : 0u)];
}

std::span<const uint32_t> queryModule(TracePlan::Query query, bool specialized, bool optimized)
{
    const auto of = [&](const Forms &forms) { return specialized ? forms[1] : forms[optimized ? 2 : 0]; };
    switch (query) {
    case TracePlan::Query::Array: return of(FORMS(tracer_comp_in_array));
    case TracePlan::Query::Functions: return of(FORMS(tracer_comp_in_functions));
    case TracePlan::Query::Again: return of(FORMS(tracer_comp_again));
    case TracePlan::Query::Sites: return of(FORMS(tracer_comp_sites));
    case TracePlan::Query::Getters: return of(FORMS(tracer_comp_getters));
    case TracePlan::Query::Condition: return of(FORMS(tracer_comp_in_condition));
    case TracePlan::Query::Carried: return of(FORMS(tracer_comp_carried));
    case TracePlan::Query::Beside: return of(FORMS(tracer_comp_beside));
    default: return of(FORMS(tracer_comp));
    }
}
#undef FORMS

std::span<const uint32_t> tracingModule(VkShaderStageFlagBits stage, TracePlan::Flags flags, bool byAddress)
{
    const Tracing &modules = ofStage(kTracing, stage);
    const size_t i = byAddress ? 1 : 0;
    switch (flags) {
    case TracePlan::Flags::RunTime:
    case TracePlan::Flags::Selected: return modules.plain[i];
    case TracePlan::Flags::Mixed: return modules.mixed[i];
    case TracePlan::Flags::Computed: return modules.computed[i];
    default: return modules.specialized[i];
    }
}

namespace
{

bool usesMicromaps(const Device &gpu)
{
    return gpu.options().micromaps && gpu.options().micromapFeature;
}

// A module of the plan: with what the ray flags of micromaps need, literal constants, and selected or signed ray flags.
std::vector<uint32_t> completed(const Device &gpu, const TracePlan &plan, std::span<const uint32_t> module,
                                uint32_t flags, std::span<const uint32_t> literals)
{
    std::vector<uint32_t> words(module.begin(), module.end());
    if (usesMicromaps(gpu))
        words = withMicromapFlag(words);
    if (skipsPrimitives(gpu))
        words = withPrimitiveCulling(words);
    for (uint32_t i = 0; i < literals.size(); ++i)
        words = withLiteral(words, i, literals[i]);
    if (plan.flags == TracePlan::Flags::Selected)
        words = withSelectedFlags(words, flags & 0xffff, flags >> 16);
    if (plan.signedFlags)
        words = withSignedFlags(words);
    return words;
}

std::optional<uint32_t> specializedFlags(const TracePlan &plan, uint32_t flags)
{
    return plan.flags == TracePlan::Flags::Specialized ? std::optional(flags) : std::nullopt;
}

Mode modeOf(const TracePlan &plan)
{
    switch (plan.mode) {
    case TracePlan::Mode::True: return Mode::True;
    case TracePlan::Mode::False: return Mode::False;
    case TracePlan::Mode::ComputedTrue:
    case TracePlan::Mode::ComputedFalse: return Mode::Computed;
    default: return Mode::Specialized;
    }
}

bool has(const Device &gpu, const char *extension, std::optional<std::string> &missing)
{
    if (!gpu.has(extension))
        missing = std::string(extension) + " is not supported";
    return !missing;
}

// Of commands that trace rays.
bool hasLaunch(const Device &gpu, Launch command, std::optional<std::string> &missing)
{
    if (command == Launch::Indirect && !gpu.hasIndirectTraces())
        missing = "rayTracingPipelineTraceRaysIndirect is not supported";
    if (command == Launch::Indirect2 && !gpu.hasIndirectTraces2())
        missing = "rayTracingPipelineTraceRaysIndirect2 is not supported";
    return !missing;
}

std::optional<std::string> missingStage(const Device &gpu, VkShaderStageFlagBits stage)
{
    VkPhysicalDeviceFeatures features{};
    vkGetPhysicalDeviceFeatures(gpu.physical(), &features);
    std::optional<std::string> missing;
    const auto needs = [&missing](VkBool32 feature, const char *name) {
        if (feature == VK_FALSE && !missing)
            missing = std::string(name) + " is not supported";
    };
    switch (stage) {
    case VK_SHADER_STAGE_COMPUTE_BIT: break;
    case VK_SHADER_STAGE_FRAGMENT_BIT: needs(features.fragmentStoresAndAtomics, "fragmentStoresAndAtomics"); break;
    case VK_SHADER_STAGE_TASK_BIT_EXT:
    case VK_SHADER_STAGE_MESH_BIT_EXT: has(gpu, VK_EXT_MESH_SHADER_EXTENSION_NAME, missing); [[fallthrough]];
    case VK_SHADER_STAGE_GEOMETRY_BIT:
        if (stage == VK_SHADER_STAGE_GEOMETRY_BIT)
            needs(features.geometryShader, "geometryShader");
        [[fallthrough]];
    case VK_SHADER_STAGE_VERTEX_BIT:
        needs(features.vertexPipelineStoresAndAtomics, "vertexPipelineStoresAndAtomics");
        break;
    default: has(gpu, VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME, missing);
    }
    return missing;
}

} // namespace

bool skipsPrimitives(const Device &gpu)
{
    return gpu.hasPrimitiveCulling() || gpu.has(VK_KHR_RAY_QUERY_EXTENSION_NAME);
}

std::vector<uint32_t> stagesOfGroup(uint32_t group)
{
    switch (group) {
    case 0: return {0};
    case 1: return {1};
    case 2:
    case 3:
    case 4:
    case 5: return {2, 3};
    case 6:
    case 7:
    case 8:
    case 9: return {2, 3, 4, 5};
    case 10:
    case 11: return {6, 7};
    case 12: return {6, 7, 8};
    case 13: return {9};
    default: return {10};
    }
}

std::optional<std::string> missingFor(const Device &gpu, const TracePlan &plan)
{
    const bool pipeline = plan.method == TracePlan::Method::Pipeline;
    std::optional<std::string> missing = missingStage(gpu, pipeline ? VK_SHADER_STAGE_RAYGEN_BIT_KHR : plan.stage);
    if (missing)
        return missing;
    if (plan.inlineModules && !gpu.has("VK_KHR_maintenance5") &&
        !gpu.has(VK_EXT_GRAPHICS_PIPELINE_LIBRARY_EXTENSION_NAME))
        return "neither VK_KHR_maintenance5 nor VK_EXT_graphics_pipeline_library is supported";
    if (plan.maintenance6 && !has(gpu, "VK_KHR_maintenance6", missing))
        return missing;
    if (!pipeline) {
        if (!has(gpu, VK_KHR_RAY_QUERY_EXTENSION_NAME, missing))
            return missing;
        if ((plan.shaderObjects || plan.rebound) && !has(gpu, "VK_EXT_shader_object", missing))
            return missing;
        const bool traces = pushStages(plan.stage) == PipelineResources::kStages;
        if ((plan.vertexBuffers || (plan.launch.command == Launch::Indirect2 && !traces)) &&
            !has(gpu, VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME, missing))
            return missing;
        if (traces && !hasLaunch(gpu, plan.launch.command, missing))
            return missing;
        if (plan.launch.counted && !gpu.hasCountedDraws())
            return "drawIndirectCount is not supported";
        if (plan.mode != TracePlan::Mode::True && !(gpu.khr() && usesMicromaps(gpu)))
            return "the execution mode is part of VK_KHR_opacity_micromap";
        return {};
    }
    std::vector<PipelinePlan> pipelines = plan.otherPipelines;
    pipelines.push_back(plan.pipeline);
    for (const PipelinePlan &each : pipelines) {
        if (!each.parts.empty() && !has(gpu, VK_KHR_PIPELINE_LIBRARY_EXTENSION_NAME, missing))
            return missing;
        constexpr VkPipelineCreateFlags kSkip =
            VK_PIPELINE_CREATE_RAY_TRACING_SKIP_TRIANGLES_BIT_KHR | VK_PIPELINE_CREATE_RAY_TRACING_SKIP_AABBS_BIT_KHR;
        if ((each.flags & kSkip) != 0 && !gpu.hasPrimitiveCulling())
            return "rayTraversalPrimitiveCulling is not supported";
    }
    if (plan.flags2 && !has(gpu, "VK_KHR_maintenance5", missing))
        return missing;
    if ((plan.chained & kChainFeedback) != 0 && !has(gpu, VK_EXT_PIPELINE_CREATION_FEEDBACK_EXTENSION_NAME, missing))
        return missing;
    if ((plan.chained & kChainRobustness) != 0 && !has(gpu, VK_EXT_PIPELINE_ROBUSTNESS_EXTENSION_NAME, missing))
        return missing;
    if ((plan.tableBarrier & kBarrierForTables) != 0 &&
        !has(gpu, VK_KHR_RAY_TRACING_MAINTENANCE_1_EXTENSION_NAME, missing))
        return missing;
    if (!hasLaunch(gpu, plan.launch.command, missing))
        return missing;
    if (plan.from != TracePlan::From::RayGeneration && gpu.pipelineProperties().maxRayRecursionDepth < 2)
        return "maxRayRecursionDepth is 1";
    return {};
}

std::unique_ptr<Tracer> queryTracer(Device &gpu, const TracePlan &plan, uint32_t flags)
{
    const bool constant = plan.flags == TracePlan::Flags::Specialized || plan.flags == TracePlan::Flags::Literal;
    const std::span<const uint32_t> module = plan.vertexBuffers ? vertexBufferModule()
                                             : plan.query != TracePlan::Query::Plain || plan.optimized
                                                 ? queryModule(plan.query, constant, plan.optimized)
                                                 : queryModule(plan.stage, constant, plan.byAddress);
    const std::array literals{flags};
    std::vector<uint32_t> words =
        completed(gpu, plan, module, flags, std::span(literals).first(plan.flags == TracePlan::Flags::Literal ? 1 : 0));
    TracerSetup setup{.specializedFlags = specializedFlags(plan, flags),
                      .inlineModule = plan.inlineModules,
                      .stage = plan.stage,
                      .shaderObject = plan.shaderObjects,
                      .vertexBuffers = plan.vertexBuffers,
                      .dynamicStrides = plan.dynamicStrides};
    if (gpu.khr() && usesMicromaps(gpu)) {
        words = withMode(words, modeOf(plan), Tracer::kModeConstant);
        if (modeOf(plan) == Mode::Specialized)
            setup.specializedMode = plan.mode == TracePlan::Mode::SpecializedTrue ? VK_TRUE : VK_FALSE;
        if (modeOf(plan) == Mode::Computed) {
            setup.specializedMode = VK_TRUE;
            setup.specializedOther = plan.mode == TracePlan::Mode::ComputedTrue ? VK_FALSE : VK_TRUE;
        }
    }
    if (plan.otherEntry != OtherEntry::None)
        words = withOtherEntry(words,
                               !gpu.khr() || !usesMicromaps(gpu) ? Mode::Absent
                               : consumesMicromaps(plan)         ? Mode::False
                                                                 : Mode::True,
                               plan.otherEntry);
    return std::make_unique<Tracer>(gpu, words, setup);
}

std::unique_ptr<PipelineTracer> pipelineTracer(Device &gpu, const TracePlan &plan, const PipelinePlan &pipeline,
                                               uint32_t flags, const PipelineTracer *shared)
{
    const bool relay = plan.from != TracePlan::From::RayGeneration;
    const bool relayMisses = plan.from == TracePlan::From::Miss;
    const TraceParameters &parameters = pipeline.parameters;
    PipelineTracerSetup setup{
        .relayStage = relayMisses ? VK_SHADER_STAGE_MISS_BIT_KHR : VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR,
        .specializedFlags = specializedFlags(plan, flags),
        .specializedParameters = plan.flags == TracePlan::Flags::Specialized,
        .groups = oracle::hitGroups(pipeline.flags),
        .attributes = plan.attributes,
        .sbtOffset = parameters.recordOffset,
        .sbtStride = parameters.recordStride,
        .missIndex = parameters.missIndex,
        .flags2 = plan.flags2,
        .chained = plan.chained,
        .inlineModules = plan.inlineModules,
        .dynamicStackSize = plan.dynamicStackSize,
        .unusedStage = plan.unusedStage,
        .creation = plan.creation,
        .callables = plan.callables,
        .decoys = !pipeline.parts.empty(),
    };
    // A miss shader that traces has the first miss record.
    const std::array literals{flags, parameters.recordOffset, parameters.recordStride,
                              parameters.missIndex + (relayMisses ? 1 : 0)};
    const size_t literal = plan.flags == TracePlan::Flags::Literal ? 4 : plan.flags == TracePlan::Flags::Mixed ? 1 : 0;
    const std::vector<uint32_t> tracing =
        completed(gpu, plan,
                  plan.callables ? callingModule()
                                 : tracingModule(relay ? setup.relayStage : VK_SHADER_STAGE_RAYGEN_BIT_KHR, plan.flags,
                                                 plan.byAddress),
                  flags, std::span(literals).first(literal));
    (relay ? setup.relay : setup.raygen) = tracing;
    setup.flags = pipeline.flags;
    if (usesMicromaps(gpu) && !plan.withoutMicromaps)
        *setup.flags |= kMicromapBit;
    if (!pipeline.parts.empty())
        setup.make = [&pipeline](Device &device, const PipelineSetup &from) {
            return linked(device, from, pipeline.parts);
        };
    return shared != nullptr ? std::make_unique<PipelineTracer>(*shared, setup)
                             : std::make_unique<PipelineTracer>(gpu, setup);
}

} // namespace vellum::check
