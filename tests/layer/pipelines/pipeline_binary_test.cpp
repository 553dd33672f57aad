// VK_KHR_pipeline_binary: pipelines that are made of what an earlier one was made into, without their code. The driver
// (layers/cache_trait.cpp) tells where such a pipeline is not the one that was captured.
#include "commands/compute_pipeline.h"
#include "commands/state_scene.h"
#include "pipelines/pipeline_binaries.h"
#include "pipelines/pipeline_scene.h"

#include "shaders/empty.h"
#include "shaders/pipeline_constant_080.h"
#include "shaders/tracer_comp.h"

namespace
{

using namespace vt;
Options cachingDriver()
{
    return {.oldValidation = false, .traits = "caching", .newer = true};
}

class PipelineBinaries : public PipelineSceneTest
{
protected:
    explicit PipelineBinaries(const Options &options = cachingDriver()) : PipelineSceneTest(options) {}

    VkComputePipelineCreateInfo computeInfo(VkPipelineLayout layout, VkShaderModule module, const void *next)
    {
        VkComputePipelineCreateInfo info{};
        info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
        info.pNext = next;
        info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
        info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
        info.stage.module = module;
        info.stage.pName = "main";
        info.layout = layout;
        return info;
    }
    std::vector<std::uint8_t> keyOf(Gpu &gpu, VkPipelineLayout layout, std::span<const std::uint32_t> words)
    {
        const VkShaderModule module = gpu.shader(words);
        const VkComputePipelineCreateInfo info = computeInfo(layout, module, nullptr);
        std::vector<std::uint8_t> key = Binaries(gpu).key(&info);
        vkDestroyShaderModule(gpu.device(), module, nullptr);
        return key;
    }
    static Kept kept(Gpu &gpu, VkPipelineLayout layout, std::span<const std::uint32_t> words)
    {
        const ComputePipeline pipeline(gpu, layout, words, kCaptureData);
        Binaries binaries(gpu);
        return binaries.keep(binaries.from(pipeline.handle()));
    }

    enum class Way { Pipeline, Data, Cache };
    // The pipeline of a setup, made of what an earlier one was made into, without code.
    VkPipeline remade(const PipelineSetup &setup, Way way)
    {
        const PipelineFlags2 capture{.flags = kCaptureData | setup.flags};
        PipelineInfo info(gpu(), setup);
        info.get().pNext = &capture;
        VkPipeline first = VK_NULL_HANDLE;
        VT_CHECK(gpu().vk().CreateRayTracingPipelinesKHR(gpu().device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info.get(),
                                                         nullptr, &first));
        Binaries binaries(gpu());
        newer::PipelineBinary binary = way == Way::Cache ? binaries.fromCache(&info.get()) : binaries.from(first);
        if (way == Way::Data)
            binary = binaries.from(binaries.keep(binary));
        vkDestroyPipeline(gpu().device(), first, nullptr);
        const PipelineFlags2 flags{.flags = setup.flags};
        const OfBinary made(binary, &flags);
        std::vector<VkPipelineShaderStageCreateInfo> stages(info.get().pStages,
                                                            info.get().pStages + info.get().stageCount);
        for (VkPipelineShaderStageCreateInfo &stage : stages)
            stage.module = VK_NULL_HANDLE;
        VkRayTracingPipelineCreateInfoKHR own = info.get();
        own.pNext = &made.info;
        own.pStages = stages.data();
        VkPipeline pipeline = VK_NULL_HANDLE;
        VT_CHECK(gpu().vk().CreateRayTracingPipelinesKHR(gpu().device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &own,
                                                         nullptr, &pipeline));
        return pipeline;
    }
    PipelineTracerSetup remadeSetup(Way way)
    {
        PipelineTracerSetup setup;
        setup.make = [this, way](Gpu &g, const PipelineSetup &from) {
            return MadePipeline{RayPipeline(g, remade(from, way)), {}};
        };
        return setup;
    }
};

TEST_F(PipelineBinaries, OfAQuery)
{
    StateScene scene(gpu());
    Tracer tracer(gpu());
    const Kept data = kept(gpu(), tracer.layout(), tracer_comp);
    Binaries binaries(gpu());
    const newer::PipelineBinary binary = binaries.from(data);
    ASSERT_TRUE(binary != nullptr);
    const OfBinary made(binary);
    const VkComputePipelineCreateInfo info = computeInfo(tracer.layout(), VK_NULL_HANDLE, &made.info);
    VkPipeline pipeline = VK_NULL_HANDLE;
    VT_CHECK(vkCreateComputePipelines(gpu().device(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline));
    tracer.prepare(scene.tlas(), StateScene::rays());
    gpu().submit([&](VkCommandBuffer commands) {
        scene.record(commands);
        tracer.bind(commands);
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
        tracer.dispatch(commands);
        barrier(commands);
    });
    StateScene::expectRight(tracer.results());
    vkDestroyPipeline(gpu().device(), pipeline, nullptr);
}

// With any-hit shaders of the application's and of the layer's, and a group of the layer's for null records.
TEST_F(PipelineBinaries, OfARayTracingPipeline)
{
    for (const Way way : {Way::Pipeline, Way::Data, Way::Cache}) {
        for (const bool anyHit : {true, false}) {
            PipelineTracerSetup setup = remadeSetup(way);
            setup.groups = {{.anyHit = anyHit}, {.box = true, .anyHit = anyHit}};
            PipelineTracer tracer(gpu(), setup);
            for (const std::uint32_t flags : opacityRayFlags())
                scene_->expect(tracer, flags, {.triangleAnyHit = anyHit, .boxAnyHit = anyHit});
        }
    }
}

// How hidden ray flags travel is in the code, which is not there any more: here they are constants in it.
TEST_F(PipelineBinaries, OfAPipelineWithConstantRayFlags)
{
    for (const Way way : {Way::Pipeline, Way::Data}) {
        PipelineTracerSetup setup = remadeSetup(way);
        setup.raygen = pipeline_constant_080;
        PipelineTracer tracer(gpu(), setup);
        scene_->expect(tracer, kRayCullNoOpaque, {.runTimeFlags = 0, .constantFlags = constantRayFlags()});
    }
}

TEST_F(PipelineBinaries, OfAPipelineWithoutTheBit)
{
    const PipelineScene plain(gpu(), {.micromaps = false});
    PipelineTracerSetup setup = remadeSetup(Way::Data);
    setup.flags = 0;
    PipelineTracer tracer(gpu(), setup);
    for (const std::uint32_t flags : opacityRayFlags(false))
        plain.expect(tracer, flags);
}

TEST_F(PipelineBinaries, KeysAreThoseOfTheCode)
{
    const Tracer tracer(gpu());
    const auto query = keyOf(gpu(), tracer.layout(), tracer_comp);
    EXPECT_EQ(query, keyOf(gpu(), tracer.layout(), tracer_comp));
    EXPECT_NE(query, keyOf(gpu(), tracer.layout(), empty));
    EXPECT_NE(query, std::vector<std::uint8_t>(query.size()));
}

// A device with its tables elsewhere: in this process every other one.
TEST_F(PipelineBinaries, OfAnotherDevice)
{
    Gpu other(cachingDriver());
    const Tracer tracer(gpu());
    const Tracer otherTracer(other);
    Binaries binaries(gpu());
    EXPECT_NE(binaries.key(nullptr), Binaries(other).key(nullptr));
    EXPECT_NE(keyOf(gpu(), tracer.layout(), tracer_comp), keyOf(other, otherTracer.layout(), tracer_comp));
    for (const std::span<const std::uint32_t> words : {std::span<const std::uint32_t>(tracer_comp), {empty}}) {
        const Kept foreign = kept(other, otherTracer.layout(), words);
        EXPECT_TRUE(binaries.from(foreign) == nullptr);
        EXPECT_EQ(binaries.last(), VK_ERROR_INITIALIZATION_FAILED);
        const std::vector<Message> messages = gpu().takeUnexpectedMessages();
        ASSERT_EQ(messages.size(), 1u);
        EXPECT_EQ(messages[0].id, "VELLUM-pipeline-binary") << messages[0].text;
    }
    Kept damaged = kept(gpu(), tracer.layout(), tracer_comp);
    damaged.data.resize(20);
    EXPECT_TRUE(binaries.from(damaged) == nullptr);
    EXPECT_EQ(gpu().takeUnexpectedMessages().size(), 1u);
}

} // namespace
