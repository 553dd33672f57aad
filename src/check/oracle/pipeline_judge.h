// SPDX-License-Identifier: Apache-2.0
// Judges what the shaders of a ray tracing pipeline saw.
#pragma once

#include <string>

#include "check/gpu/pipeline_tracer.h"
#include "check/oracle/scene_build.h"

namespace vellum::check::oracle
{

// The hit groups of the pipeline, with and without any-hit and closest-hit shaders, and the hit records, which mix them
// with zero records. The records of triangles come first, then those of boxes: recordOffset.
extern const std::array<TracerGroup, 5> kHitGroups;
extern const std::array<std::optional<uint32_t>, 2 * kBoxRecords> kHitRecords;

// What a device does otherwise than the specification says, and is not reported.
// Of these members of Fault.
struct Tolerance {
    bool layerIntersectionShaders = false; // intersectionMaySee, intersectionMayRunCulled
    bool reportChangesAttributes = false;
};
Tolerance toleranceFor(const Device &gpu);

// What is wrong with the result of a ray whose hits, by allHits, are not unsure; empty: nothing.
std::string pipelineFault(const Scene &scene, const Ray &ray, const std::vector<Hit> &hits,
                          const PipelineResult &result, const Tolerance &tolerance);

} // namespace vellum::check::oracle
