// SPDX-License-Identifier: Apache-2.0
#include "check/case/trace_pipelines.h"

#include "check/case/trace.h"
#include "check/case/tracing_modules.h"
#include "check/gpu/execution_mode.h"
#include "check/gpu/programs/pipeline_libraries.h"
#include "check/oracle/pipeline_judge.h"

namespace vellum::check
{
namespace
{

bool usesMicromaps(const Device &gpu)
{
    return gpu.options().micromaps && gpu.options().micromapFeature;
}

// A module of the plan: with what the ray flags of micromaps need, and literal flags.
std::vector<uint32_t> withFlags(const Device &gpu, const TracePlan &plan, std::span<const uint32_t> module,
                                uint32_t flags)
{
    std::vector<uint32_t> words(module.begin(), module.end());
    if (usesMicromaps(gpu))
        words = withMicromapFlag(words);
    return plan.flags == TracePlan::Flags::Literal ? withLiteral(words, 0, flags) : words;
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
    default: return Mode::Specialized;
    }
}

// The groups of the pipeline tracer: ray generation, miss, those of kHitGroups, and the relay. Ray generation and relay
// stay in the pipeline itself (Fault::RayGenerationInLibrary).
LibraryPlan libraryPlan(const TracePlan &plan)
{
    LibraryPlan out{.own = {0}};
    if (plan.recursion)
        out.own.push_back(2 + static_cast<uint32_t>(oracle::kHitGroups.size()));
    switch (plan.libraries) {
    case TracePlan::Libraries::Two: out.libraries = {{6, 2, 4}, {1, 3, 5}}; break;
    case TracePlan::Libraries::Three: out.libraries = {{3}, {5, 4}, {2, 6, 1}}; break;
    default: // Nested
        out.libraries = {{4, 1}, {2, 5}, {6, 3}};
        out.nested = true;
    }
    return out;
}

bool has(const Device &gpu, const char *extension, std::optional<std::string> &missing)
{
    if (!gpu.has(extension))
        missing = std::string(extension) + " is not supported";
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

std::optional<std::string> missingFor(const Device &gpu, const TracePlan &plan)
{
    const bool pipeline = plan.method == TracePlan::Method::Pipeline;
    std::optional<std::string> missing = missingStage(gpu, pipeline ? VK_SHADER_STAGE_RAYGEN_BIT_KHR : plan.stage);
    if (missing)
        return missing;
    if (plan.inlineModules && !gpu.has("VK_KHR_maintenance5") &&
        !gpu.has(VK_EXT_GRAPHICS_PIPELINE_LIBRARY_EXTENSION_NAME))
        return "neither VK_KHR_maintenance5 nor VK_EXT_graphics_pipeline_library is supported";
    if (!pipeline) {
        if (plan.mode != TracePlan::Mode::True && !(gpu.khr() && usesMicromaps(gpu)))
            return "the execution mode is part of VK_KHR_opacity_micromap";
        return {};
    }
    if (plan.libraries != TracePlan::Libraries::None && !has(gpu, VK_KHR_PIPELINE_LIBRARY_EXTENSION_NAME, missing))
        return missing;
    if (plan.flags2 && !has(gpu, "VK_KHR_maintenance5", missing))
        return missing;
    if (plan.launch == Launch::Indirect && !gpu.hasIndirectTraces())
        return "rayTracingPipelineTraceRaysIndirect is not supported";
    if (plan.launch == Launch::Indirect2 && !gpu.hasIndirectTraces2())
        return "rayTracingPipelineTraceRaysIndirect2 is not supported";
    if (plan.recursion && gpu.pipelineProperties().maxRayRecursionDepth < 2)
        return "maxRayRecursionDepth is 1";
    return {};
}

std::unique_ptr<Tracer> queryTracer(Device &gpu, const TracePlan &plan, uint32_t flags)
{
    std::vector<uint32_t> words =
        withFlags(gpu, plan,
                  plan.queryArray ? queryModuleInArray()
                                  : queryModule(plan.stage, plan.flags != TracePlan::Flags::RunTime, plan.byAddress),
                  flags);
    TracerSetup setup{
        .specializedFlags = specializedFlags(plan, flags), .inlineModule = plan.inlineModules, .stage = plan.stage};
    if (gpu.khr() && usesMicromaps(gpu)) {
        words = withMode(words, modeOf(plan), Tracer::kModeConstant);
        if (modeOf(plan) == Mode::Specialized)
            setup.specializedMode = plan.mode == TracePlan::Mode::SpecializedTrue ? VK_TRUE : VK_FALSE;
    }
    return std::make_unique<Tracer>(gpu, words, setup);
}

std::unique_ptr<PipelineTracer> pipelineTracer(Device &gpu, const TracePlan &plan, uint32_t flags)
{
    const std::vector<uint32_t> tracing =
        withFlags(gpu, plan,
                  tracingModule(plan.recursion ? VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR : VK_SHADER_STAGE_RAYGEN_BIT_KHR,
                                plan.flags != TracePlan::Flags::RunTime, plan.byAddress),
                  flags);
    PipelineTracerSetup setup{.specializedFlags = specializedFlags(plan, flags),
                              .groups = {oracle::kHitGroups.begin(), oracle::kHitGroups.end()},
                              .records = {oracle::kHitRecords.begin(), oracle::kHitRecords.end()},
                              .sbtStride = 1,
                              .flags2 = plan.flags2,
                              .inlineModules = plan.inlineModules,
                              .dynamicStackSize = plan.dynamicStackSize,
                              .unusedStage = plan.unusedStage};
    (plan.recursion ? setup.relay : setup.raygen) = tracing;
    if (plan.withoutMicromaps)
        setup.flags = VkPipelineCreateFlags{0};
    if (plan.libraries != TracePlan::Libraries::None)
        setup.make = [&plan](Device &device, const PipelineSetup &from) {
            return linked(device, from, libraryPlan(plan));
        };
    return std::make_unique<PipelineTracer>(gpu, setup);
}

} // namespace vellum::check
