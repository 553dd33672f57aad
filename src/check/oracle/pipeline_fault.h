// SPDX-License-Identifier: Apache-2.0
// Checks what the shaders of a ray tracing pipeline observed.
#pragma once

#include <string>

#include "check/oracle/scene_build.h"
#include "gpu/pipeline_tracer.h"

namespace vellum::check::oracle
{

// The hit groups of the pipeline, for triangles and for boxes, each with and without any-hit and closest-hit shaders.
extern const std::array<TracerGroup, 8> kHitGroups;
// The groups of a pipeline with such create flags: NO_NULL_... flags allow no groups without these shaders.
std::vector<TracerGroup> hitGroups(VkPipelineCreateFlags flags);

// The content of a hit record: a group for triangles, or for boxes where those reach it, or nothing.
enum class HitRecord { Full, WithoutAnyHit, WithoutClosestHit, WithoutBoth, Null };

struct TablePlan {
    // Record i is element i modulo their number. Empty: a mixture.
    std::vector<HitRecord> records;
    std::optional<uint32_t> length; // hit records; nothing: as many as the scene reaches
    uint32_t misses = 1;            // miss records
    bool nullMiss = false;          // the miss record of the rays is zero
    RecordData content = RecordData::Word;
    std::optional<uint32_t> zeroData; // the first word of this hit record's data is 0
    TableLayout layout;

    bool operator==(const TablePlan &) const = default;
};

// The pipeline and the table that trace rays.
struct TracedBy {
    VkPipelineCreateFlags flags = 0; // besides the micromap bit
    TraceParameters parameters{.recordStride = 1};
    TablePlan table;
    uint32_t data = 0; // TracerTable::data
};

// The table for a scene, which breaks no rule.
TracerTable tableOf(const Scene &scene, const TracedBy &by);
// The valid usage that tracing the scene would break; empty: none. relay: a closest-hit shader traces the rays, whose
// record is behind the table.
std::string tableRule(const Scene &scene, const TracedBy &by, bool relay);

// The hit records of the mixture for scenes without record offsets of their own, by the groups that they name.
extern const std::array<std::optional<uint32_t>, 2 * kBoxRecords> kHitRecords;

// Deviations of a device from the specification that are not reported, by members of Fault.
struct Tolerance {
    bool layerIntersectionShaders = false; // intersectionMaySee, intersectionMayRunCulled
    bool reportChangesAttributes = false;
};
Tolerance toleranceFor(const Device &gpu);

// The fault of the result of a ray whose hits, by allHits, are not unsure; empty: none.
std::string pipelineFault(const Scene &scene, const Ray &ray, const std::vector<Hit> &hits,
                          const PipelineResult &result, const Tolerance &tolerance, const TracedBy &by = {});

} // namespace vellum::check::oracle
