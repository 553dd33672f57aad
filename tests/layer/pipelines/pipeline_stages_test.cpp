// SPDX-License-Identifier: Apache-2.0
// Rays traced from closest-hit and miss shaders, callable shaders between them, and ray queries in all of them.
#include "pipelines/pipeline_relay.h"

#include "harness/program/labels.h"
#include "shaders/pipeline_relay_any_hit.h"
#include "shaders/pipeline_relay_callable.h"
#include "shaders/pipeline_relay_closest_hit.h"
#include "shaders/pipeline_relay_miss.h"
#include "shaders/pipeline_relay_other_closest_hit.h"
#include "shaders/pipeline_relay_queries_any_hit.h"
#include "shaders/pipeline_relay_queries_closest_hit.h"
#include "shaders/pipeline_relay_queries_miss.h"
#include "shaders/pipeline_relay_queries_raygen.h"
#include "shaders/pipeline_relay_raygen.h"

namespace
{

const vt::Labels kPipelineStagesLabels{{"PipelineStages.*", "slow forcing"}};

using namespace vt;

constexpr uint32_t kDepth = 6;
constexpr std::array<uint32_t, 10> kFlags{0,     kRayOpaque, kRayNoOpaque, kRayCullOpaque, kRayCullNoOpaque,
                                          0x400, 0x401,      0x402,        0x440,          0x480};

struct Push {
    uint32_t depth, pad;
    VkDeviceAddress queryScene;
};

struct Relay {
    bool queries = false;
    bool anyHit = true;
    bool micromaps = true;  // the pipeline has the bit, and the traced scene micromaps
    bool others = false;    // there are groups of rays with another payload, and of any rays
    bool libraries = false; // all stages but the ray generation shader are in libraries, whose groups do not name them
};

class PipelineStages : public PipelineTest
{
protected:
    PipelineStages() : PipelineTest({.shared = true}) {}

    // The chain of ray `id` goes down a column each, with flags that change from ray to ray.
    static uint32_t columnOf(uint32_t id, uint32_t depth) { return (id * 5 + depth * 11) % Columns::kColumns; }
    static uint32_t flagsOf(uint32_t id, uint32_t depth, bool micromaps)
    {
        return kFlags[(id + depth * 3) % (micromaps ? kFlags.size() : 5)];
    }
    static uint32_t ruleOf(uint32_t id, uint32_t depth) { return (id + depth) % 3 == 0 ? kNever : kAlways; }

    void expect(const Relay &relay)
    {
        const Columns columns(gpu(), 4, kAlways);
        const PlainColumns plain(gpu());
        const PipelineResources resources(gpu(), 2, sizeof(Push));
        PipelineSetup setup;
        const auto pick = [&relay](auto &with, auto &without) {
            return relay.queries ? std::span<const uint32_t>(with) : std::span<const uint32_t>(without);
        };
        setup.stages = {
            {VK_SHADER_STAGE_RAYGEN_BIT_KHR, pick(pipeline_relay_queries_raygen, pipeline_relay_raygen)},
            {VK_SHADER_STAGE_MISS_BIT_KHR, pick(pipeline_relay_queries_miss, pipeline_relay_miss)},
            {VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, pick(pipeline_relay_queries_closest_hit, pipeline_relay_closest_hit)},
            {VK_SHADER_STAGE_ANY_HIT_BIT_KHR, pick(pipeline_relay_queries_any_hit, pipeline_relay_any_hit)},
            {VK_SHADER_STAGE_CALLABLE_BIT_KHR, pipeline_relay_callable},
        };
        setup.groups = {{.general = 0},
                        {.general = 1},
                        {.closestHit = 2, .anyHit = relay.anyHit ? 3 : kUnused},
                        {.general = 4},
                        {.general = 4}};
        if (relay.others) {
            setup.stages.push_back({VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, pipeline_relay_other_closest_hit});
            setup.groups.insert(setup.groups.end(), {{.closestHit = 5}, {}});
        }
        setup.layout = resources.layout();
        setup.recursion = kDepth;
        setup.flags = relay.micromaps ? kMicromapBit : 0;
        std::vector<RayPipeline> libraries;
        if (relay.libraries) {
            setup.payloadSize = 256;
            for (const size_t first : {1u, 3u}) { // two libraries, each with an unused group
                PipelineSetup library = setup;
                library.flags |= VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
                const auto begin = setup.stages.begin() + static_cast<ptrdiff_t>(first);
                library.stages.assign(begin, first == 1 ? begin + 2 : setup.stages.end());
                library.groups = {{}};
                setup.libraries.push_back(libraries.emplace_back(gpu(), library).handle());
            }
            setup.stages.resize(1);
        }
        const RayPipeline pipeline(gpu(), setup);
        const BindingTable table(
            gpu(), pipeline, {.raygen = {0, {}}, .miss = {{1, {}}}, .hit = {{2, {}}}, .callable = {{3, {}}, {4, {}}}});

        std::vector<Ray> rays;
        for (uint32_t id = 0; id < Columns::kColumns; ++id) {
            for (uint32_t depth = 0; depth < kDepth; ++depth) {
                rays.push_back(columns.rays()[columnOf(id, depth)]);
                rays.back().flags = flagsOf(id, depth, relay.micromaps);
                rays.back().rule = ruleOf(id, depth);
            }
        }
        const Buffer rayBuffer = gpu().upload(std::span<const Ray>(rays), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
        const Buffer steps(gpu(), rays.size() * sizeof(RelayStep), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
        const Tlas &traced = relay.micromaps ? columns.scene() : plain.scene();
        resources.write(traced.handle(), std::array<const Buffer *, 2>{&rayBuffer, &steps});
        gpu().submit([&](VkCommandBuffer commands) {
            barrier(commands);
            vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, pipeline.handle());
            resources.bind(commands);
            const Push push{kDepth, 0, columns.scene().address()};
            vkCmdPushConstants(commands, resources.layout(), PipelineResources::kStages, 0, sizeof(push), &push);
            table.trace(commands, Columns::kColumns);
            barrier(commands);
        });
        for (uint32_t id = 0; id < Columns::kColumns && !HasFailure(); ++id) {
            for (uint32_t depth = 0; depth < kDepth; ++depth) {
                SCOPED_TRACE(testing::Message() << "ray " << id << " depth " << depth << std::hex << " flags 0x"
                                                << flagsOf(id, depth, relay.micromaps));
                expectStep(relay, columns, id, depth, steps.as<RelayStep>()[id * kDepth + depth]);
            }
        }
    }

private:
    static void expectStep(const Relay &relay, const Columns &columns, uint32_t id, uint32_t depth,
                           const RelayStep &step)
    {
        const uint32_t column = columnOf(id, depth);
        const uint32_t flags = flagsOf(id, depth, relay.micromaps);
        const bool confirming = ruleOf(id, depth) == kAlways;
        uint32_t nearest = columns.nearest(column, confirming || !relay.anyHit, flags);
        uint32_t least = 0, most = relay.anyHit ? columns.nonOpaque(column, flags) : 0;
        if (!relay.micromaps) {
            const Outcome outcome = outcomeOf(kNoMicromap, false, 0, flags);
            const bool hit =
                outcome == Outcome::Opaque || (outcome == Outcome::NonOpaque && (confirming || !relay.anyHit));
            nearest = hit ? 0 : Columns::kLayers;
            most = outcome == Outcome::NonOpaque && relay.anyHit ? 2 : 0;
        } else if (relay.anyHit) {
            least = nearest == Columns::kLayers ? most : 0;
        }
        EXPECT_EQ(step.stage, nearest == Columns::kLayers ? 1u : 2u);
        if (step.stage == 2 && nearest != Columns::kLayers) {
            const uint32_t customIndex = relay.micromaps ? 4242 : PlainColumns::kCustomIndex;
            EXPECT_EQ(step.customIndex, customIndex);
            EXPECT_EQ(step.customIndexAfter, customIndex);
            EXPECT_FLOAT_EQ(step.t, 1 + static_cast<float>(nearest));
            EXPECT_EQ(step.primitive, column * (relay.micromaps ? Columns::kLayers : 2) + nearest);
        }
        EXPECT_EQ(step.flags, flags);
        EXPECT_EQ(step.flagsAfter, flags);
        EXPECT_GE(step.candidates, least);
        EXPECT_LE(step.candidates, most);
        EXPECT_EQ(step.bad, 0u);
        EXPECT_EQ(step.callable, (id + depth + 5) * 2);
        EXPECT_EQ(step.below, kDepth - 1 - depth);
        if (!relay.queries)
            return;
        const uint32_t layer = columns.nearest(column, confirming, flags);
        EXPECT_EQ(step.anyHitQueries, step.candidates);
        if (step.candidates > 0) {
            EXPECT_EQ(step.anyHitCommitted, layer == Columns::kLayers ? kNone : kTriangle);
            if (layer != Columns::kLayers) {
                EXPECT_EQ(step.anyHitCustomIndex, 4242u);
                EXPECT_FLOAT_EQ(step.anyHitT, 1 + static_cast<float>(layer));
            }
        }
        EXPECT_EQ(step.queryCommitted, layer == Columns::kLayers ? kNone : kTriangle);
        EXPECT_EQ(step.queryFlags, flags);
        EXPECT_LE(step.queryCandidates, columns.nonOpaque(column, flags));
        if (layer != Columns::kLayers) {
            EXPECT_EQ(step.queryCustomIndex, 4242u);
            EXPECT_FLOAT_EQ(step.queryT, 1 + static_cast<float>(layer));
        } else {
            EXPECT_EQ(step.queryCandidates, columns.nonOpaque(column, flags));
        }
    }
};

TEST_F(PipelineStages, RaysFromEveryStage)
{
    expect({});
}

TEST_F(PipelineStages, WithoutAnyHit)
{
    expect({.anyHit = false});
}

// Where ray flags are passed in payloads, the layer's any-hit shader of each group has the payload type of its rays:
// the mock driver checks this (layers/spy_pipelines.cpp).
TEST_F(PipelineStages, PayloadsOfSeveralTypes)
{
    expect({.others = true});
    expect({.anyHit = false, .others = true});
}

// The pipeline's groups name them nevertheless.
TEST_F(PipelineStages, InLibraries)
{
    if (!gpu().has(VK_KHR_PIPELINE_LIBRARY_EXTENSION_NAME))
        GTEST_SKIP() << "no pipeline libraries";
    for (const bool anyHit : {true, false}) {
        for (const bool micromaps : {true, false})
            expect({.anyHit = anyHit, .micromaps = micromaps, .others = true, .libraries = true});
    }
}

TEST_F(PipelineStages, QueriesInEveryStage)
{
    expect({.queries = true});
}

TEST_F(PipelineStages, QueriesInEveryStageWithoutAnyHit)
{
    expect({.queries = true, .anyHit = false});
}

// "This flag has no effect on using opacity micromaps with ray queries."
TEST_F(PipelineStages, QueriesInAPipelineWithoutTheBit)
{
    expect({.queries = true, .micromaps = false});
    expect({.queries = true, .anyHit = false, .micromaps = false});
}

TEST_F(PipelineStages, WithoutTheBit)
{
    expect({.micromaps = false});
    expect({.anyHit = false, .micromaps = false});
}

} // namespace
