// SPDX-License-Identifier: Apache-2.0
// VK_KHR_ray_tracing_position_fetch together with micromaps, in pipelines and in ray queries.
#include <random>

#include "check/oracle/outcome.h"
#include "command_buffer/compute_pipeline.h"
#include "gpu/pipeline_builder.h"
#include "harness/harness.h"

#include "harness/program/labels.h"
#include "shaders/pipeline_positions_any_hit.h"
#include "shaders/pipeline_positions_closest_hit.h"
#include "shaders/pipeline_positions_miss.h"
#include "shaders/pipeline_positions_raygen.h"
#include "shaders/query_positions.h"

namespace
{

const vt::Labels kPipelinePositionsLabels{{"PipelinePositions.*", "stacked forced forcing"},
                                          {"PipelinePositions.WithoutMicromaps", "inside"},
                                          {"PipelinePositionsWithoutLayer.*", "one_api"}};

using namespace vt;

constexpr VkBuildAccelerationStructureFlagsKHR kAllowDataAccess = 0x800;
constexpr uint32_t kTriangles = 40;

enum class By { Pipeline, PipelineWithoutAnyHit, Query };

struct Seen {
    std::array<float, 9> positions;
    uint32_t invocations, customIndex, flags;
};

class PipelinePositions : public PipelineTest
{
protected:
    explicit PipelinePositions(bool vellum = true)
        : PipelineTest({.vellum = vellum, .oldValidation = false, .micromaps = vellum, .newer = true})
    {
    }
    void SetUp() override
    {
        PipelineTest::SetUp();
        if (!IsSkipped() && !gpu().has("VK_KHR_ray_tracing_position_fetch"))
            GTEST_SKIP() << "no VK_KHR_ray_tracing_position_fetch";
    }

    void expect(By by, bool micromaps)
    {
        const bool anyHit = by != By::PipelineWithoutAnyHit; // or what a query does with candidates
        std::mt19937 random(77);
        const auto offset = [&random] { return static_cast<float>(random() % 1000) / 10000.0f; };
        MicromapInput input;
        for (uint8_t state = 0; state < 4; ++state)
            input.add(3, kFourState, std::vector<uint8_t>(64, state));
        std::unique_ptr<Micromap> micromap;
        Geometry geometry;
        Attachment attachment;
        attachment.indexType = VK_INDEX_TYPE_UINT32;
        std::vector<std::array<float, 4>> origins;
        for (uint32_t i = 0; i < kTriangles; ++i) {
            const float x = 1.5f * static_cast<float>(i);
            for (const Vec3 &corner : {Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{0, 1, 0}})
                geometry.vertices.push_back({x + corner[0] + offset(), corner[1] + offset(), offset()});
            attachment.indices.push_back(static_cast<int32_t>(i % 4));
            origins.push_back({x + 0.35f, 0.35f + 5, 1 + 7, 0});
        }
        if (micromaps) {
            micromap = std::make_unique<Micromap>(gpu(), std::move(input));
            micromap->build();
            attachment.micromap = micromap.get();
            geometry.micromap = attachment;
        }
        const Blas blas(gpu(), {geometry}, kAllowDataAccess);
        const Tlas tlas(gpu(), {instance(blas, {0, 5, 7}, 0x123456)}); // positions are the object's

        constexpr VkPushConstantRange kCompute{VK_SHADER_STAGE_COMPUTE_BIT, 0, 4};
        const PipelineResources resources(gpu(), 2, 4, std::span(&kCompute, 1));
        const ComputePipeline query(gpu(), resources.layout(), query_positions, 0);
        const RayPipeline pipeline(
            gpu(), {.stages = {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, pipeline_positions_raygen},
                               {VK_SHADER_STAGE_MISS_BIT_KHR, pipeline_positions_miss},
                               {VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, pipeline_positions_closest_hit},
                               {VK_SHADER_STAGE_ANY_HIT_BIT_KHR, pipeline_positions_any_hit}},
                    .groups = {{.general = 0}, {.general = 1}, {.closestHit = 2, .anyHit = anyHit ? 3 : kUnused}},
                    .layout = resources.layout(),
                    .flags = micromaps ? kMicromapBit : 0});
        const BindingTable table(gpu(), pipeline, {.miss = {{1, {}}}, .hit = {{2, {}}}});
        const Buffer origin =
            gpu().upload(std::span<const std::array<float, 4>>(origins), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
        for (const uint32_t flags : {0u, kRayOpaque, kRayNoOpaque, kRayCullOpaque, kRayCullNoOpaque}) {
            const Buffer seen(gpu(), sizeof(Seen) * 2 * kTriangles, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
            resources.write(tlas.handle(), std::array<const Buffer *, 2>{&seen, &origin});
            gpu().submit([&](VkCommandBuffer commands) {
                const auto point =
                    by == By::Query ? VK_PIPELINE_BIND_POINT_COMPUTE : VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR;
                vkCmdBindPipeline(commands, point, by == By::Query ? query.handle() : pipeline.handle());
                resources.bind(commands, point);
                vkCmdPushConstants(commands, resources.layout(),
                                   PipelineResources::kStages | VK_SHADER_STAGE_COMPUTE_BIT, 0, 4, &flags);
                if (by == By::Query)
                    vkCmdDispatch(commands, kTriangles, 1, 1);
                else
                    table.trace(commands, kTriangles);
                barrier(commands);
            });
            for (uint32_t i = 0; i < kTriangles; ++i) {
                SCOPED_TRACE(testing::Message() << "triangle " << i << " ray flags " << flags);
                const Outcome outcome = outcomeOf(micromaps ? static_cast<int>(i % 4) : kNoMicromap, false, 0, flags);
                const bool isCandidate = outcome == Outcome::NonOpaque && anyHit;
                const bool hit = outcome == Outcome::NonOpaque || outcome == Outcome::Opaque;
                expectSeen(seen.as<Seen>()[2 * i], isCandidate, flags, &geometry.vertices[3 * i]);
                expectSeen(seen.as<Seen>()[2 * i + 1], hit, flags, &geometry.vertices[3 * i]);
                if (HasFailure())
                    return;
            }
        }
    }

private:
    static void expectSeen(const Seen &seen, bool expected, uint32_t flags, const Vec3 *vertices)
    {
        ASSERT_EQ(seen.invocations, expected ? 1u : 0u);
        if (!expected)
            return;
        EXPECT_EQ(seen.customIndex, 0x123456u);
        EXPECT_EQ(seen.flags, flags);
        for (size_t i = 0; i < 9; ++i)
            EXPECT_FLOAT_EQ(seen.positions[i], vertices[i / 3][i % 3]);
    }
};

class PipelinePositionsWithoutLayer : public PipelinePositions
{
protected:
    PipelinePositionsWithoutLayer() : PipelinePositions(false) {}
};

TEST_F(PipelinePositionsWithoutLayer, WithAndWithoutAnyHit)
{
    expect(By::Pipeline, false);
    expect(By::PipelineWithoutAnyHit, false);
}

TEST_F(PipelinePositionsWithoutLayer, Query)
{
    expect(By::Query, false);
}

TEST_F(PipelinePositions, Micromaps)
{
    expect(By::Pipeline, true);
}

TEST_F(PipelinePositions, MicromapsWithoutAnyHit)
{
    expect(By::PipelineWithoutAnyHit, true);
}

TEST_F(PipelinePositions, MicromapsInAQuery)
{
    expect(By::Query, true);
}

TEST_F(PipelinePositions, WithoutMicromaps)
{
    expect(By::Pipeline, false);
    expect(By::PipelineWithoutAnyHit, false);
    expect(By::Query, false);
}

} // namespace
