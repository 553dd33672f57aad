// SPDX-License-Identifier: Apache-2.0
// VK_KHR_pipeline_binary: pipelines made from the binaries of an earlier one, without their code. The driver
// (layers/cache_quirk.cpp) reports a pipeline that is not the one that was captured.
#include "command_buffer/compute_pipeline.h"
#include "command_buffer/state_scene.h"
#include "pipelines/pipeline_binaries.h"
#include "pipelines/pipeline_scene.h"

#include "harness/program/labels.h"
#include "shaders/empty.h"
#include "shaders/pipeline_constant_080.h"
#include "shaders/tracer_comp.h"

namespace
{

const vt::Labels kPipelineBinaryLabels{{"PipelineBinaries.*", "slow"},
                                       {"PipelineBinaries.KeysAreThoseOfTheCode", "translated"},
                                       {"PipelineBinaries.FailedPipeline", "translated"},
                                       {"PipelineBinaries.QueryPipeline", "translated"}};

using namespace vt;
// Khronos' layer 1.4.363 allocates without an end for a pipeline of binaries alone.
Options unvalidatedCachingDriver()
{
    return {.validation = false, .quirks = "caching", .newer = true};
}

class PipelineBinaries : public PipelineSceneTest
{
protected:
    explicit PipelineBinaries(const Options &options = unvalidatedCachingDriver()) : PipelineSceneTest(options) {}

    VkComputePipelineCreateInfo computeInfo(VkPipelineLayout layout, VkShaderModule module, const void *next)
    {
        return vkInit<VkComputePipelineCreateInfo>(
            {.pNext = next,
             .stage = vkInit<VkPipelineShaderStageCreateInfo>(
                 {.stage = VK_SHADER_STAGE_COMPUTE_BIT, .module = module, .pName = "main"}),
             .layout = layout});
    }
    std::vector<uint8_t> keyOf(Gpu &gpu, VkPipelineLayout layout, std::span<const uint32_t> words)
    {
        const VkShaderModule module = gpu.shader(words);
        const VkComputePipelineCreateInfo info = computeInfo(layout, module, nullptr);
        std::vector<uint8_t> key = Binaries(gpu).key(&info);
        vkDestroyShaderModule(gpu.device(), module, nullptr);
        return key;
    }

public:
    static Kept kept(Gpu &gpu, VkPipelineLayout layout, std::span<const uint32_t> words)
    {
        const ComputePipeline pipeline(gpu, layout, words, kCaptureData);
        Binaries binaries(gpu);
        return binaries.keep(binaries.from(pipeline.handle()));
    }

protected:
    enum class Way { Pipeline, Data, Cache };
    // The pipeline of a setup, made of what an earlier one was made into, without code.
    VkPipeline remade(const PipelineSetup &setup, Way way)
    {
        const auto capture = vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = kCaptureData | setup.flags});
        PipelineInfo info(gpu(), setup);
        info.get().pNext = &capture;
        VkPipeline first = VK_NULL_HANDLE;
        VT_CHECK(gpu().vk().CreateRayTracingPipelinesKHR(gpu().device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info.get(),
                                                         nullptr, &first));
        Binaries binaries(gpu());
        VkPipelineBinaryKHR binary = way == Way::Cache ? binaries.fromCache(&info.get()) : binaries.from(first);
        if (way == Way::Data)
            binary = binaries.from(binaries.keep(binary));
        vkDestroyPipeline(gpu().device(), first, nullptr);
        const auto flags = vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = setup.flags});
        const OfBinary made(binary, &flags);
        std::vector<VkPipelineShaderStageCreateInfo> stages(info.get().pStages,
                                                            info.get().pStages + info.get().stageCount);
        // that could not be rewritten
        auto ignored = vkInit<VkShaderModuleCreateInfo>({.codeSize = sizeof tracer_comp / 8 * 4, .pCode = tracer_comp});
        for (VkPipelineShaderStageCreateInfo &stage : stages) {
            stage.module = VK_NULL_HANDLE;
            stage.pNext = &ignored;
        }
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
        setup.make = [this, way](Device &g, const PipelineSetup &from) {
            return MadePipeline{RayPipeline(g, remade(from, way)), {}};
        };
        return setup;
    }
};

TEST_F(PipelineBinaries, QueryPipeline)
{
    StateScene scene(gpu());
    Tracer tracer(gpu());
    const Kept data = kept(gpu(), tracer.layout(), tracer_comp);
    Binaries binaries(gpu());
    const VkPipelineBinaryKHR binary = binaries.from(data);
    ASSERT_TRUE(binary != nullptr);
    const OfBinary made(binary);
    auto ignored = vkInit<VkShaderModuleCreateInfo>({.codeSize = sizeof tracer_comp / 8 * 4, .pCode = tracer_comp});
    VkComputePipelineCreateInfo info = computeInfo(tracer.layout(), VK_NULL_HANDLE, &made.info);
    info.stage.pNext = &ignored;
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

// With any-hit shaders of the application and of the layer, and a group of the layer for null records.
TEST_F(PipelineBinaries, RayTracingPipeline)
{
    for (const Way way : {Way::Pipeline, Way::Data, Way::Cache}) {
        for (const bool anyHit : {true, false}) {
            PipelineTracerSetup setup = remadeSetup(way);
            setup.groups = {{.anyHit = anyHit}, {.box = true, .anyHit = anyHit}};
            PipelineTracer tracer(gpu(), setup);
            for (const uint32_t flags : opacityRayFlags())
                scene_->expect(tracer, flags, {.triangleAnyHit = anyHit, .boxAnyHit = anyHit});
        }
    }
}

// How hidden ray flags are passed depends on the code, which a binary lacks: here they are constants in the code.
TEST_F(PipelineBinaries, PipelineWithConstantRayFlags)
{
    for (const Way way : {Way::Pipeline, Way::Data}) {
        PipelineTracerSetup setup = remadeSetup(way);
        setup.raygen = pipeline_constant_080;
        PipelineTracer tracer(gpu(), setup);
        scene_->expect(tracer, kRayCullNoOpaque, {.runTimeFlags = 0, .constantFlags = constantRayFlags()});
    }
}

TEST_F(PipelineBinaries, PipelineWithoutTheBit)
{
    const PipelineScene plain(gpu(), {.micromaps = false});
    PipelineTracerSetup setup = remadeSetup(Way::Data);
    setup.flags = 0;
    PipelineTracer tracer(gpu(), setup);
    for (const uint32_t flags : opacityRayFlags(false))
        plain.expect(tracer, flags);
}

TEST_F(PipelineBinaries, KeysAreThoseOfTheCode)
{
    const Tracer tracer(gpu());
    const auto query = keyOf(gpu(), tracer.layout(), tracer_comp);
    EXPECT_EQ(query, keyOf(gpu(), tracer.layout(), tracer_comp));
    EXPECT_NE(query, keyOf(gpu(), tracer.layout(), empty));
    EXPECT_NE(query, std::vector<uint8_t>(query.size()));
}

// A device with its tables elsewhere: in this process every other one.
TEST_F(PipelineBinaries, AnotherDevice)
{
    Gpu other(unvalidatedCachingDriver());
    const Tracer tracer(gpu());
    const Tracer otherTracer(other);
    Binaries binaries(gpu());
    EXPECT_NE(binaries.key(nullptr), Binaries(other).key(nullptr));
    EXPECT_NE(keyOf(gpu(), tracer.layout(), tracer_comp), keyOf(other, otherTracer.layout(), tracer_comp));
    for (const std::span<const uint32_t> words : {std::span<const uint32_t>(tracer_comp), {empty}}) {
        const Kept foreign = kept(other, otherTracer.layout(), words);
        EXPECT_TRUE(binaries.from(foreign) == nullptr);
        EXPECT_EQ(binaries.last(), VK_ERROR_INITIALIZATION_FAILED);
        const std::vector<Message> messages = gpu().takeUnexpectedMessages();
        ASSERT_EQ(messages.size(), 1u);
        EXPECT_EQ(messages[0].id, "VELLUM-pipeline-binary") << messages[0].text;
    }
}

// Cut off, also right after the layer's header, or with any byte of the header or the driver's data changed.
TEST_F(PipelineBinaries, Damaged)
{
    const Tracer tracer(gpu());
    const Kept whole = kept(gpu(), tracer.layout(), tracer_comp);
    Binaries binaries(gpu());
    const auto expectRejected = [&](const Kept &damaged) {
        EXPECT_TRUE(binaries.from(damaged) == nullptr);
        EXPECT_EQ(binaries.last(), VK_ERROR_INITIALIZATION_FAILED);
        EXPECT_EQ(gpu().takeUnexpectedMessages().size(), 1u);
    };
    for (const size_t size : {size_t{1}, size_t{20}, whole.data.size() - 33, whole.data.size() - 32,
                              whole.data.size() - 31, whole.data.size() - 1}) {
        Kept damaged = whole;
        damaged.data.resize(size);
        expectRejected(damaged);
    }
    for (size_t at = 0; at < whole.data.size(); at += 3) {
        Kept damaged = whole;
        damaged.data[at] ^= 0x40;
        expectRejected(damaged);
    }
    EXPECT_TRUE(binaries.from(whole) != nullptr);
    Kept damaged = whole;
    damaged.data.back() ^= 1;
    const std::vector<VkPipelineBinaryKHR> made = binaries.fromAll({whole, damaged, whole});
    EXPECT_EQ(binaries.last(), VK_ERROR_INITIALIZATION_FAILED);
    EXPECT_TRUE(made[0] != nullptr && made[1] == nullptr && made[2] != nullptr);
    EXPECT_EQ(gpu().takeUnexpectedMessages().size(), 1u);
}

TEST_F(PipelineBinaries, NotInTheDriver)
{
    const Tracer tracer(gpu());
    const VkShaderModule module = gpu().shader(empty);
    VkComputePipelineCreateInfo info = computeInfo(tracer.layout(), module, nullptr);
    info.stage.pName = "nothing"; // a key of its own
    Binaries binaries(gpu());
    EXPECT_TRUE(binaries.fromCache(&info) == nullptr);
    EXPECT_EQ(binaries.last(), VK_PIPELINE_BINARY_MISSING_KHR);
    vkDestroyShaderModule(gpu().device(), module, nullptr);
}

// The layer does not query the driver: there are no binaries.
TEST_F(PipelineBinaries, FailedPipeline)
{
    const Tracer tracer(gpu());
    const std::vector<uint32_t> code = gpu().code(tracer_comp);
    auto module = vkInit<VkShaderModuleCreateInfo>({.codeSize = code.size() * sizeof(uint32_t), .pCode = code.data()});
    const VkBaseInStructure unknown{static_cast<VkStructureType>(0x7ffffff0), // a structure of the future
                                    reinterpret_cast<const VkBaseInStructure *>(&module)};
    VkComputePipelineCreateInfo info = computeInfo(tracer.layout(), VK_NULL_HANDLE, nullptr);
    info.stage.pNext = &unknown;
    Binaries binaries(gpu());
    EXPECT_TRUE(binaries.fromCacheAtOnce(&info) == nullptr);
    EXPECT_EQ(binaries.last(), VK_ERROR_INITIALIZATION_FAILED);
    const std::vector<Message> messages = gpu().takeUnexpectedMessages();
    ASSERT_EQ(messages.size(), 1u);
    EXPECT_EQ(messages[0].id, "VELLUM-shader-rewrite") << messages[0].text;
}

// Rays of a library may meet shaders of others. In the binary of a whole pipeline constant flags are constants.
TEST_F(PipelineBinaries, WholePipelineMakesNoLibrary)
{
    if (!constantRayFlags())
        GTEST_SKIP() << "constant ray flags travel like others";
    PipelineTracerSetup setup;
    setup.raygen = pipeline_constant_080;
    setup.make = [this](Device &g, const PipelineSetup &from) {
        const auto capture = vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = kCaptureData | from.flags});
        PipelineInfo info(g, from);
        info.get().pNext = &capture;
        VkPipeline whole = VK_NULL_HANDLE;
        VT_CHECK(g.vk().CreateRayTracingPipelinesKHR(g.device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info.get(),
                                                     nullptr, &whole));
        Binaries binaries(g);
        const VkPipelineBinaryKHR binary = binaries.from(whole);
        const auto flags =
            vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = VK_PIPELINE_CREATE_LIBRARY_BIT_KHR | from.flags});
        const OfBinary made(binary, &flags);
        info.get().pNext = &made.info;
        VkPipeline library = VK_NULL_HANDLE;
        EXPECT_EQ(g.vk().CreateRayTracingPipelinesKHR(g.device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info.get(),
                                                      nullptr, &library),
                  VK_ERROR_UNKNOWN);
        EXPECT_TRUE(library == VK_NULL_HANDLE);
        const std::vector<Message> messages = gpu().takeUnexpectedMessages();
        EXPECT_EQ(messages.size(), 1u);
        for (const Message &message : messages)
            EXPECT_EQ(message.id, "VELLUM-not-available") << message.text;
        return MadePipeline{RayPipeline(g, whole), {}};
    };
    const PipelineTracer tracer(gpu(), setup);
}

// Settings change what pipelines are made of: groups get any-hit shaders, or ray flags travel in another way. An
// application that sees the same global key hands over the same binaries for the same pipeline.
class BinariesOfSettings : public testing::TestWithParam<std::array<const char *, 2>>
{
};

TEST_P(BinariesOfSettings, DifferFromThoseOfOtherSettings)
{
    const auto [variable, value] = GetParam();
    const char *old = std::getenv(variable);
    const std::optional<std::string> before = old ? std::optional<std::string>(old) : std::nullopt;
    if (before == value)
        GTEST_SKIP() << variable << " is " << value;
    std::vector<uint8_t> key;
    Kept data;
    {
        Gpu gpu(unvalidatedCachingDriver());
        key = Binaries(gpu).key(nullptr);
        data = PipelineBinaries::kept(gpu, Tracer(gpu).layout(), empty);
    }
    setenv(variable, value, 1);
    {
        Gpu gpu(unvalidatedCachingDriver());
        Binaries binaries(gpu);
        EXPECT_NE(binaries.key(nullptr), key);
        EXPECT_TRUE(binaries.from(data) == nullptr);
        EXPECT_EQ(gpu.takeUnexpectedMessages().size(), 1u);
    }
    if (before)
        setenv(variable, before->c_str(), 1);
    else
        unsetenv(variable);
    Gpu gpu(unvalidatedCachingDriver());
    Binaries binaries(gpu);
    if (binaries.key(nullptr) != key)
        GTEST_SKIP() << "the tables are elsewhere for each device";
    EXPECT_TRUE(binaries.from(data) != nullptr);
}

INSTANTIATE_TEST_SUITE_P(All, BinariesOfSettings,
                         testing::Values(std::array{"VELLUM_ASSUME_MICROMAPS", "1"},
                                         std::array{"VELLUM_CONSTANT_RAY_FLAGS", "off"}));

} // namespace
