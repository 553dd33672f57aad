// SPDX-License-Identifier: Apache-2.0
// Shaders and pipelines that do not declare their use of micromaps, on a device that has them: a warning each once
// there is geometry with micromaps, and the setting that uses micromaps anyway.
#include "command_buffer/state_scene.h"
#include "gpu/copies.h"
#include "gpu/pipeline_tracer.h"
#include "harness/harness.h"
#include "harness/program/labels.h"
#include "pipelines/assumed_micromaps.h"
#include "shaders/pipeline_constant_080.h"
#include "shaders/query_raygen.h"
#include "shaders/tracer_comp.h"

namespace
{

const vt::Labels kForgottenMicromapsLabels{{"Assumed/ForgottenMicromaps.*", "one_api"},
                                           {"*ForgottenMicromaps.Pipelines*", "translated"}};

using namespace vt;

class ForgottenMicromaps : public testing::TestWithParam<bool>
{
protected:
    ForgottenMicromaps()
    {
        const AssumedMicromaps setting(GetParam()); // read when the instance is created
        gpu_.emplace(Options{.oldValidation = false, .api = Api::Khr, .declaresMode = false});
    }

    Gpu &gpu() { return *gpu_; }
    [[nodiscard]] size_t warnings(const char *id)
    {
        size_t count = 0;
        for (const Message &message : gpu().takeMessages())
            count += message.id == id ? 1u : 0u;
        return count;
    }
    // Builds geometry with micromaps.
    void useMicromaps()
    {
        const Patchwork patchwork(gpu());
        const Blas blas(gpu(), patchwork.geometries());
    }

private:
    std::optional<Gpu> gpu_;
};

TEST_P(ForgottenMicromaps, RayQueries)
{
    StateScene scene(gpu());
    gpu().submit([&](VkCommandBuffer commands) { scene.record(commands); });
    std::vector<Message> found = gpu().takeMessages();
    std::erase_if(found, [](const Message &message) { return message.id != "VELLUM-queries-without-micromaps"; });
    ASSERT_EQ(found.size(), GetParam() ? 0u : 1u);
    const std::string shader = "a shader (main, " + std::to_string(sizeof tracer_comp) + " bytes of SPIR-V) has";
    for (const Message &message : found)
        EXPECT_NE(message.text.find(shader), std::string::npos) << message.text;
    Tracer tracer(gpu(), tracer_comp); // the same code again
    EXPECT_EQ(warnings("VELLUM-queries-without-micromaps"), 0u);
    const std::vector<Result> results = tracer.trace(scene.tlas(), scene.rays());
    if (GetParam())
        return StateScene::expectRight(results);
    for (size_t i = 0; i < 4; ++i) {
        EXPECT_EQ(results[i].committed, uint32_t{kNone}) << "triangle " << i;
        EXPECT_EQ(results[i].candidateCount, 1u) << "triangle " << i;
    }
}

// The warning is about rays of pipelines, and comes once for a shader that traces them.
TEST_P(ForgottenMicromaps, Pipelines)
{
    if (!gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        GTEST_SKIP() << "no ray tracing pipelines";
    const auto expectWarnings = [&](const PipelineTracerSetup &setup, size_t count) {
        gpu().takeMessages();
        const PipelineTracer tracer(gpu(), setup);
        EXPECT_EQ(warnings("VELLUM-pipeline-without-micromaps"), GetParam() ? 0u : count);
    };
    useMicromaps();
    expectWarnings({.flags = kMicromapBit}, 0);
    expectWarnings({.flags = 0}, 1);
    expectWarnings({.flags = 0}, 0); // the same shaders again
    PipelineTracerSetup other{.flags = 0};
    other.raygen = pipeline_constant_080;
    expectWarnings(other, 1);
}

TEST_P(ForgottenMicromaps, PipelinesOfRayQueries)
{
    if (!gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        GTEST_SKIP() << "no ray tracing pipelines";
    useMicromaps();
    const Tracer tracer(gpu(), tracer_comp); // for its layout
    for (const VkPipelineCreateFlags flags : {VkPipelineCreateFlags{0}, kMicromapBit}) {
        gpu().takeMessages();
        PipelineSetup setup;
        setup.stages = {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, query_raygen}};
        setup.groups = {{.general = 0}};
        setup.layout = tracer.layout();
        setup.flags = flags;
        const RayPipeline pipeline(gpu(), setup);
        EXPECT_EQ(warnings("VELLUM-pipeline-without-micromaps"), 0u) << flags;
    }
}

// Programs that enable the feature, as all that there are, and never build a micromap.
TEST_P(ForgottenMicromaps, ApplicationsWithoutMicromapsGetNoWarning)
{
    const Tracer tracer(gpu(), tracer_comp);
    const bool pipelines = gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME);
    if (pipelines)
        const PipelineTracer traced(gpu(), {.flags = 0});
    const Blas plain(gpu(), {Geometry{.vertices = triangleRow(1)}});
    const auto expectWarnings = [&](size_t queries, size_t bits) {
        std::vector<Message> messages = gpu().takeMessages();
        const auto count = [&messages](const char *id) { return std::ranges::count(messages, id, &Message::id); };
        EXPECT_EQ(count("VELLUM-queries-without-micromaps"), GetParam() ? 0 : static_cast<ptrdiff_t>(queries));
        EXPECT_EQ(count("VELLUM-pipeline-without-micromaps"),
                  GetParam() || !pipelines ? 0 : static_cast<ptrdiff_t>(bits));
    };
    expectWarnings(0, 0);
    useMicromaps();
    expectWarnings(1, 1);
    useMicromaps();
    expectWarnings(0, 0);
    PipelineTracerSetup other{.flags = 0};
    other.raygen = pipeline_constant_080;
    if (pipelines)
        const PipelineTracer traced(gpu(), other);
    expectWarnings(0, 1);
}

INSTANTIATE_TEST_SUITE_P(Assumed, ForgottenMicromaps, testing::Bool());

} // namespace
