// SPDX-License-Identifier: Apache-2.0
// Ray tracing pipelines linked of libraries.
#pragma once

#include "gpu/pipeline_tracer.h"

namespace vellum::gpu
{

// A library, or the pipeline: stages and groups of a larger setup. Its groups name stages of it and of its libraries,
// which "are treated as if they were defined as additional entries in pStages" (VkRayTracingPipelineCreateInfoKHR).
struct PipelinePart {
    std::vector<uint32_t> stages; // a stage may be in several parts, not twice in one
    std::vector<uint32_t> groups; // a group is in one part
    std::vector<uint32_t> libraries; // parts before this one, in the order of linking; a part is in one library
    bool micromapBit = false;        // of a library, where the pipeline lacks it

    bool operator==(const PipelinePart &) const = default;
};

// The groups and the stages that they need, of a larger setup.
PipelineSetup partOf(const PipelineSetup &from, std::span<const uint32_t> groups);

// The stages, or the groups, of a part and of its libraries, in the order of their indices.
std::vector<uint32_t> stagesOf(std::span<const PipelinePart> parts, const PipelinePart &part);
std::vector<uint32_t> groupsOf(std::span<const PipelinePart> parts, const PipelinePart &part);

// parts: the last one is the pipeline.
MadePipeline linked(Device &gpu, const PipelineSetup &from, std::span<const PipelinePart> parts);

} // namespace vellum::gpu
