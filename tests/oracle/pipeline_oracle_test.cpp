// SPDX-License-Identifier: Apache-2.0
// Random scenes, traced by a ray tracing pipeline through the layer and by the oracle, compared ray by ray: the
// invocations of any-hit and intersection shaders, and the hit that stays. The binding table mixes hit groups with and
// without any-hit and closest-hit shaders, and zero records.
#include "check/oracle/pipeline_fault.h"
#include "compare_scenes.h"
#include "gpu/pipeline_tracer.h"

namespace
{

using namespace vellum::check::oracle;

void comparePipelines(vt::Gpu &gpu, const Limits &limits, uint32_t scenes, uint64_t minimum)
{
    vt::PipelineTracer tracer(gpu, {.groups = {kHitGroups.begin(), kHitGroups.end()},
                                    .records = {kHitRecords.begin(), kHitRecords.end()},
                                    .sbtStride = 1});
    compareScenes(gpu, limits, scenes, minimum, [&](const Scene &scene, std::span<const Hits> hits) {
        const Built built = build(gpu, scene);
        const std::vector<vt::PipelineResult> results = tracer.trace(*built.scene, scene.rays, kCapacity);
        std::vector<Traced> traced;
        for (size_t i = 0; i < results.size(); ++i) {
            const std::string fault = pipelineFault(scene, scene.rays[i], hits[i].hits, results[i], toleranceFor(gpu));
            traced.push_back({fault, results[i].candidateCount, results[i].committed != vt::kNone});
        }
        return traced;
    });
}

class PipelineOracle : public vt::PipelineTest
{
};

class PipelineOracleWithoutLayer : public vt::PipelineTest
{
protected:
    PipelineOracleWithoutLayer() : PipelineTest({.vellum = false, .validation = false, .micromaps = false}) {}
};

// Checks that oracle and driver agree without Vellum.
TEST_F(PipelineOracleWithoutLayer, PlainScenes)
{
    comparePipelines(gpu(), {.micromaps = false}, 40, 20000);
}

TEST_F(PipelineOracle, RandomScenes)
{
    comparePipelines(gpu(), {}, 400, 200000);
}

// Fewer and finer: micromaps up to level 9.
TEST_F(PipelineOracle, FineMicromaps)
{
    comparePipelines(gpu(), {.maxLevel = 9, .rays = 400}, 20, 1000);
}

TEST_F(PipelineOracle, PlainScenes)
{
    comparePipelines(gpu(), {.micromaps = false}, 40, 20000);
}

} // namespace
