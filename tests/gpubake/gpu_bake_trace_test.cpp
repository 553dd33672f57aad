// SPDX-License-Identifier: Apache-2.0
// A texture's bake and a micromap build in one command buffer, without a readback, and rays that meet the result.
#include <array>

#include "bake_cases.h"
#include "gpu/tracer.h"
#include "gpu_bake_run.h"
#include "harness/harness.h"

namespace
{

using namespace vt;
using namespace vellum;

class GpuBakeTrace : public GpuBakeTest
{
protected:
    // Baked into the output, built, and traced at the middle of each micro-triangle: the hits are those of the states.
    void check(const AlphaTexture &texture, const std::vector<TriangleUvs> &triangles, const GpuBakeOptions &options,
               const GpuBakeOutput &output)
    {
        const AlphaImage image(gpu(), std::span(&texture, 1), AlphaImage::Format::Float);
        BakeJob job(gpu(), runner_.baker(), image, Mesh::of(triangles), options);
        job.setOutput(output, micromapInputUsage(gpu()));

        // A micromap for the usage counts of the output. What it was created with is not what it is built from.
        MicromapInput input;
        for (const VkMicromapUsageEXT &usage : GpuBaker::usage(output, options.format)) {
            const std::vector<uint8_t> none(microTriangleCount(usage.subdivisionLevel));
            for (uint32_t i = 0; i < usage.count; ++i)
                input.add(usage.subdivisionLevel, static_cast<uint16_t>(usage.format), none);
        }
        vt::Micromap micromap(gpu(), input);
        VkMicromapBuildInfoEXT info = micromap.buildInfo();
        info.data.deviceAddress = job.output().data;
        info.triangleArray.deviceAddress = job.output().records;
        bool recorded = false;
        gpu().submit([&](VkCommandBuffer commands) {
            recorded = job.record(commands);
            barrier(commands);
            recordMicromapBuilds(gpu(), commands, std::array{MicromapBuild{info, micromap.handle()}});
            barrier(commands);
        });
        ASSERT_TRUE(recorded);
        const GpuBaked baked = job.read();

        Geometry geometry;
        geometry.vertices = triangleRow(static_cast<uint32_t>(triangles.size()));
        Attachment attachment;
        attachment.micromap = &micromap;
        attachment.indexType = VK_INDEX_TYPE_UINT32;
        attachment.indices = baked.indices;
        geometry.micromap = attachment;
        const Blas blas(gpu(), {geometry});
        const Tlas tlas(gpu(), {instance(blas, {}, 0)});
        std::vector<Ray> rays;
        std::vector<State> states;
        for (uint32_t t = 0; t < triangles.size(); ++t) {
            const uint32_t level =
                baked.indices[t] < 0 ? 2 : baked.records[static_cast<size_t>(baked.indices[t])].subdivisionLevel;
            for (uint32_t i = 0; i < microTriangleCount(level); ++i) {
                const auto [u, v] = microTriangleCentre(i, level);
                Ray ray;
                ray.origin = {1.5f * static_cast<float>(t) + static_cast<float>(u), static_cast<float>(v), 1};
                rays.push_back(ray);
                states.push_back(baked.stateOf(t, i));
            }
        }
        Tracer tracer(gpu());
        const std::vector<Result> results = tracer.trace(tlas, rays);
        std::array<size_t, 4> seen{};
        for (size_t i = 0; i < rays.size(); ++i) {
            const State state = states[i];
            ++seen[static_cast<size_t>(state)];
            const bool unknown = state == State::UnknownOpaque || state == State::UnknownTransparent;
            ASSERT_EQ(results[i].committed, state == State::Opaque ? kTriangle : kNone) << i;
            ASSERT_EQ(results[i].candidateCount, unknown ? 1u : 0u) << i;
        }
        for (const size_t count : seen)
            EXPECT_GT(count, 0u);
    }
};

} // namespace

TEST_F(GpuBakeTrace, HitsAreThoseOfTheStates)
{
    test::TestRandom random(21);
    const AlphaTexture texture = test::smoothTexture(random, 61, 47);
    std::vector<TriangleUvs> triangles;
    for (int i = 0; i < 10; ++i)
        for (const TriangleUvs &uvs : test::randomTriangles(random, 61, 47))
            triangles.push_back(uvs);
    GpuBakeOptions options;
    options.level = 3;
    GpuBakeOutput output;
    output.triangles[3] = 40; // more than needed
    check(texture, triangles, options, output);
    output.triangles[3] = 5; // less
    check(texture, triangles, options, output);
    options.automatic = true;
    options.level = 4;
    options.texelsPerEdge = 3;
    for (uint32_t level = 0; level <= 4; ++level)
        output.triangles[level] = 30;
    check(texture, triangles, options, output);
}
