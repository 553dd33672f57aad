// SPDX-License-Identifier: Apache-2.0
// The pipelines that trace by a plan.
#pragma once

#include <memory>

#include "check/case/case.h"
#include "gpu/pipeline_tracer.h"

namespace vellum::check
{

// flags: of the rays, where they are not of run time.
std::unique_ptr<Tracer> queryTracer(Device &gpu, const TracePlan &plan, uint32_t flags);
// shared: traces by the pipeline of another tracer.
std::unique_ptr<PipelineTracer> pipelineTracer(Device &gpu, const TracePlan &plan, const PipelinePlan &pipeline,
                                               uint32_t flags, const PipelineTracer *shared = nullptr);

} // namespace vellum::check
