// SPDX-License-Identifier: Apache-2.0
// Ray tracing pipelines linked of libraries.
#pragma once

#include "check/gpu/pipeline_tracer.h"

namespace vellum::check
{

// How the groups of a pipeline are distributed; each library has some, with their stages.
struct LibraryPlan {
    std::vector<std::vector<uint32_t>> libraries; // in the order of linking
    std::vector<uint32_t> own;                    // groups of the pipeline itself
    bool nested = false;                          // all libraries are linked to one, which the pipeline links
};

// The groups and the stages that they need, of a larger setup.
PipelineSetup partOf(const PipelineSetup &from, std::span<const uint32_t> groups);

MadePipeline linked(Device &gpu, const PipelineSetup &from, const LibraryPlan &plan);

} // namespace vellum::check
