// SPDX-License-Identifier: Apache-2.0
#include "check/case/tracing_modules.h"

#include <array>
#include <stdexcept>

#include "shaders/pipeline_traces_rchit.h"
#include "shaders/pipeline_traces_rchit_by_address.h"
#include "shaders/pipeline_traces_rchit_specialized.h"
#include "shaders/pipeline_traces_rchit_specialized_by_address.h"
#include "shaders/pipeline_traces_rgen.h"
#include "shaders/pipeline_traces_rgen_by_address.h"
#include "shaders/pipeline_traces_rgen_specialized.h"
#include "shaders/pipeline_traces_rgen_specialized_by_address.h"
#include "shaders/tracer_comp.h"
#include "shaders/tracer_comp_by_address.h"
#include "shaders/tracer_comp_in_array.h"
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
const std::array<Variants, 2> kTracing{{
    VARIANTS(VK_SHADER_STAGE_RAYGEN_BIT_KHR, pipeline_traces_rgen),
    VARIANTS(VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, pipeline_traces_rchit),
}};
#undef VARIANTS

std::span<const uint32_t> variantOf(std::span<const Variants> modules, VkShaderStageFlagBits stage, bool specialized,
                                    bool byAddress)
{
    for (const Variants &variants : modules) {
        if (variants.stage == stage)
            return variants.words[(specialized ? 1u : 0u) + (byAddress ? 2u : 0u)];
    }
    throw std::runtime_error("rays are not traced from this stage");
}

} // namespace

std::span<const uint32_t> queryModule(VkShaderStageFlagBits stage, bool specialized, bool byAddress)
{
    return variantOf(kQueries, stage, specialized, byAddress);
}

std::span<const uint32_t> queryModuleInArray()
{
    return tracer_comp_in_array;
}

std::span<const uint32_t> tracingModule(VkShaderStageFlagBits stage, bool specialized, bool byAddress)
{
    return variantOf(kTracing, stage, specialized, byAddress);
}

} // namespace vellum::check
