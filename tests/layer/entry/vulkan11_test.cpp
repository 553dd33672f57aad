// SPDX-License-Identifier: Apache-2.0
// A program of Vulkan 1.1, the oldest version with emulation. Validation, below the layer, reports shaders and commands
// of the layer that are newer than the instance, or that need features which the program has not enabled.
#include <cstdlib>

#include "command_buffer/state_scene.h"
#include "pipelines/pipeline_scene.h"

namespace
{

using namespace vt;

class Vulkan11 : public testing::Test
{
protected:
    Vulkan11()
    {
        setenv("VELLUM_TEST_VULKAN", "1.1", 1);
        gpu_.emplace(Options{});
    }
    ~Vulkan11() override
    {
        gpu_.reset();
        unsetenv("VELLUM_TEST_VULKAN");
    }
    void TearDown() override
    {
        for (const Message &message : gpu_->takeUnexpectedMessages())
            ADD_FAILURE() << message.id << ": " << message.text;
    }
    Gpu &gpu() { return *gpu_; }

private:
    std::optional<Gpu> gpu_;
};

TEST_F(Vulkan11, BuildsAndRayQueries)
{
    StateScene scene(gpu());
    gpu().submit([&](VkCommandBuffer commands) { scene.record(commands); });
    scene.expectRight();
}

// The general build, which uses every pass but those of lossy builds.
TEST_F(Vulkan11, CompactedMicromaps)
{
    MicromapInput input;
    for (uint8_t state = 0; state < 4; ++state)
        input.add(5, kFourState, std::vector<uint8_t>(1024, state));
    Micromap micromap(gpu(), input, VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT);
    micromap.build();
    Geometry geometry{.vertices = triangleRow(4)};
    geometry.micromap = Attachment{&micromap};
    const Blas blas(gpu(), {geometry});
    Tlas tlas(gpu());
    tlas.build(std::vector{instance(blas, {}, 321)});
    Tracer tracer(gpu());
    StateScene::expectRight(tracer.trace(tlas, StateScene::rays()));
}

TEST_F(Vulkan11, Pipelines)
{
    if (!gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        GTEST_SKIP() << "no ray tracing pipelines";
    const PipelineScene scene(gpu());
    for (const bool anyHit : {true, false}) {
        PipelineTracerSetup setup;
        setup.groups = {{.anyHit = anyHit}, {.box = true, .anyHit = anyHit}};
        PipelineTracer tracer(gpu(), setup);
        for (const uint32_t flags : opacityRayFlags())
            scene.expect(tracer, flags, {.triangleAnyHit = anyHit, .boxAnyHit = anyHit});
    }
}

} // namespace
