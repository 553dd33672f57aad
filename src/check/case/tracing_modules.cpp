// SPDX-License-Identifier: Apache-2.0
#include "check/case/tracing_modules.h"

#include <array>
#include <stdexcept>

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

} // namespace vellum::check
