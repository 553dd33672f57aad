// SPDX-License-Identifier: Apache-2.0
// The pipelines that trace by a plan, and their modules.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "check/case/case.h"
#include "gpu/pipeline_tracer.h"

namespace vellum::check
{

// specialized: ray flags by specialization constant 0 instead of each ray's own. byAddress: the acceleration structure
// comes as a device address.
std::span<const uint32_t> queryModule(VkShaderStageFlagBits stage, bool specialized, bool byAddress);
// A compute shader with the query in that form. optimized: by spirv-opt, without specialized flags.
std::span<const uint32_t> queryModule(TracePlan::Query query, bool specialized, bool optimized);
// A vertex shader with flags of run time: TracePlan::vertexBuffers.
std::span<const uint32_t> vertexBufferModule();
// A ray generation shader with flags of run time, which executes callable shaders as well.
std::span<const uint32_t> callingModule();
// VK_SHADER_STAGE_RAYGEN_BIT_KHR, ..._CLOSEST_HIT_... or ..._MISS_.... Specialized and literal flags: by specialization
// constants 0 (flags) and 1 to 3 (TraceParameters); mixed ones: by constant 0.
std::span<const uint32_t> tracingModule(VkShaderStageFlagBits stage, TracePlan::Flags flags, bool byAddress);

// flags: of the rays, where they are not of run time.
std::unique_ptr<Tracer> queryTracer(Device &gpu, const TracePlan &plan, uint32_t flags);
// shared: traces by the pipeline of another tracer.
std::unique_ptr<PipelineTracer> pipelineTracer(Device &gpu, const TracePlan &plan, const PipelinePlan &pipeline,
                                               uint32_t flags, const PipelineTracer *shared = nullptr);

} // namespace vellum::check
