// SPDX-License-Identifier: Apache-2.0
// The causes by which failures are put together.
#include "check/oracle/pipeline_fault.h"
#include "check/oracle/query_fault.h"

#include <gtest/gtest.h>

namespace
{

using namespace vellum::check;

const std::string kNotMet = "a triangle is not met";
const std::string kMet = "a triangle is met that should not be";
const std::string kOpacity = "wrong opacity of a triangle";

// A ray that meets a triangle.
struct Aimed {
    Aimed(bool opaque, bool micromap, uint32_t flags = 0)
    {
        scene.objects.resize(1);
        oracle::Mesh &mesh = scene.objects[0].meshes.emplace_back();
        mesh.opaque = opaque;
        mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
        if (micromap)
            mesh.micromap = oracle::MeshMicromap{.indices = {opaque ? -2 : -4}};
        oracle::Instance &instance = scene.instances.emplace_back();
        for (size_t i = 0; i < 3; ++i)
            instance.transform.matrix[i][i] = 1;
        ray = {.origin = {0.25f, 0.25f, 3}, .flags = flags};
        hits = oracle::allHits(scene, ray);
        result.flags = pipeline.flags = ray.flags;
        pipeline.intact = true;
        pipeline.invocations = 1;
        pipeline.record = 50;
    }
    std::string queryCause() { return oracle::causeOf(oracle::queryFault(scene, ray, hits.hits, result)); }
    std::string pipelineCause() { return oracle::causeOf(oracle::pipelineFault(scene, ray, hits.hits, pipeline, {})); }
    void addCandidate()
    {
        const auto hit = oracle::hitOf(scene, ray, 0, 0, 0);
        ASSERT_TRUE(hit);
        result.candidateCount = pipeline.candidateCount = 1;
        result.candidates = pipeline.candidates = {{.bits = hit->frontFace ? 4u : 0u,
                                                    .t = 3,
                                                    .u = static_cast<float>(hit->u),
                                                    .v = static_cast<float>(hit->v)}};
        pipeline.notes.resize(1);
    }

    oracle::Scene scene;
    Ray ray;
    oracle::Hits hits;
    Result result{};
    PipelineResult pipeline{};
};

} // namespace

TEST(Causes, ATriangleIsNotMet)
{
    for (const bool opaque : {false, true}) {
        EXPECT_EQ(Aimed(opaque, false).queryCause(), kNotMet) << opaque;
        EXPECT_EQ(Aimed(opaque, false).pipelineCause(), kNotMet) << opaque;
        EXPECT_EQ(Aimed(opaque, true).queryCause(), kOpacity) << opaque;
        EXPECT_EQ(Aimed(opaque, true).pipelineCause(), kOpacity) << opaque;
    }
}

TEST(Causes, ATriangleIsMetThatShouldNotBe)
{
    for (const bool micromap : {false, true}) {
        Aimed culled(false, micromap, kRayCullNoOpaque);
        ASSERT_TRUE(culled.hits.hits.empty());
        culled.addCandidate();
        EXPECT_EQ(culled.queryCause(), micromap ? kOpacity : kMet);
        EXPECT_EQ(culled.pipelineCause(), micromap ? kOpacity : kMet);
    }
}

TEST(Causes, AnotherOpacity)
{
    Aimed opaque(true, false);
    opaque.addCandidate();
    EXPECT_EQ(opaque.queryCause(), kOpacity);
    EXPECT_EQ(opaque.pipelineCause(), kOpacity);
    // A triangle that is committed although its any-hit shader ignores it is to be met.
    Aimed nonOpaque(false, false);
    const oracle::Hit &hit = nonOpaque.hits.hits.at(0);
    nonOpaque.pipeline.committed = kTriangle;
    nonOpaque.pipeline.t = static_cast<float>(hit.t);
    nonOpaque.pipeline.u = static_cast<float>(hit.u);
    nonOpaque.pipeline.v = static_cast<float>(hit.v);
    nonOpaque.pipeline.hitKind = hit.frontFace ? kHitKindFront : kHitKindBack;
    nonOpaque.pipeline.record = 100;
    EXPECT_EQ(nonOpaque.pipelineCause(), kOpacity);
}
