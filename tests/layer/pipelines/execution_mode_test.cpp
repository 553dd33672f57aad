// SPDX-License-Identifier: Apache-2.0
// A device with VK_KHR_opacity_micromap and without VK_EXT_opacity_micromap: ray queries use micromaps if the shader
// has the execution mode OpacityMicromapIdKHR with a true operand. Also the promise that an application does not mix
// special indices, which is part of the same extension.
#include "command_buffer/state_scene.h"
#include "gpu/execution_mode.h"
#include "gpu/pipeline_builder.h"
#include "gpu/programs/graphics.h"
#include "harness/harness.h"

#include "harness/program/labels.h"
#include "shaders/plain_vertex.h"
#include "shaders/query_fragment.h"
#include "shaders/query_raygen.h"
#include "shaders/tracer_comp.h"

namespace
{

const vt::Labels kExecutionModeLabels{{"ExecutionMode.*", "one_api stacked lenient"},
                                      {"ExecutionModeWithExt.*", "one_api"},
                                      {"MixedSpecialIndex.*", "one_api strict_ext"},
                                      {"MixedSpecialIndexWithoutKhr.*", "one_api strict_ext"}};

using namespace vt;

// The expected results of the rays of StateScene. Without micromaps, all are candidates, which the shader does not
// confirm.
void expectStates(const std::vector<Result> &results, bool consumed)
{
    if (consumed) {
        StateScene::expectRight(results);
        return;
    }
    for (size_t i = 0; i < 4; ++i) {
        EXPECT_EQ(results[i].committed, uint32_t{kNone}) << "triangle " << i;
        EXPECT_EQ(results[i].candidateCount, 1u) << "triangle " << i;
    }
}

struct ModeCase {
    Mode mode;
    std::optional<uint32_t> specialized;
    bool consumes;
};
constexpr std::array<ModeCase, 6> kModeCases{{{Mode::Absent, {}, false},
                                              {Mode::False, {}, false},
                                              {Mode::True, {}, true},
                                              {Mode::Specialized, {}, false},
                                              {Mode::Specialized, 0, false},
                                              {Mode::Specialized, 1, true}}};

class ExecutionMode : public GpuTest
{
protected:
    explicit ExecutionMode(
        const Options &options = {.oldValidation = false, .api = Api::Khr, .newer = true, .declaresMode = false})
        : GpuTest(options), scene_(gpu())
    {
        gpu().submit([this](VkCommandBuffer commands) { scene_.record(commands); });
    }
    // Traces by whatever `record` does with the tracer's descriptor set.
    void expectTraced(bool consumed, const std::function<void(VkCommandBuffer, const Tracer &)> &record)
    {
        tracer_.prepare(scene_.tlas(), scene_.rays(), 1);
        gpu().submit([&](VkCommandBuffer commands) {
            barrier(commands);
            record(commands, tracer_);
            barrier(commands);
        });
        expectStates(tracer_.results(), consumed);
    }

    StateScene scene_;
    Tracer tracer_{gpu()};
};

TEST_F(ExecutionMode, Compute)
{
    for (const ModeCase &c : kModeCases)
        for (const bool inlined : {false, true}) {
            if (inlined && !gpu().has(VK_EXT_GRAPHICS_PIPELINE_LIBRARY_EXTENSION_NAME))
                continue;
            SCOPED_TRACE(testing::Message() << "case " << &c - kModeCases.data() << (inlined ? " inline" : ""));
            Tracer tracer(gpu(), withMode(tracer_comp, c.mode),
                          {.specializedFlags = c.specialized, .inlineModule = inlined});
            const std::vector<Result> results = tracer.trace(scene_.tlas(), scene_.rays());
            expectStates(results, c.consumes);
            EXPECT_EQ(results[2].candidates.at(0).customIndex, 321u); // and not the slot
        }
}

TEST_F(ExecutionMode, Fragment)
{
    for (const Mode mode : {Mode::Absent, Mode::True}) {
        const Graphics graphics(gpu(), tracer_.layout(), {plain_vertex, withMode(query_fragment, mode)}, 4);
        expectTraced(mode == Mode::True, [&](VkCommandBuffer commands, const Tracer &tracer) {
            graphics.bind(commands);
            const VkDescriptorSet set = tracer.set();
            vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, tracer.layout(), 0, 1, &set, 0, nullptr);
            graphics.draw(commands, 3);
        });
    }
}

// "even if executed inside a ray pipeline shader with the ... RAY_TRACING_OPACITY_MICROMAP_BIT_KHR flag specified"
TEST_F(ExecutionMode, RayGeneration)
{
    if (!gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        GTEST_SKIP() << "no ray tracing pipelines";
    for (const VkPipelineCreateFlags flags : {VkPipelineCreateFlags{0}, kMicromapBit})
        for (const Mode mode : {Mode::Absent, Mode::False, Mode::True}) {
            SCOPED_TRACE(testing::Message() << "flags " << flags << " mode " << static_cast<int>(mode));
            const std::vector<uint32_t> words = withMode(query_raygen, mode);
            PipelineSetup setup;
            setup.stages = {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, words}};
            setup.groups = {{.general = 0}};
            setup.layout = tracer_.layout();
            setup.flags = flags;
            const RayPipeline pipeline(gpu(), setup);
            const BindingTable table(gpu(), pipeline, {});
            expectTraced(mode == Mode::True, [&](VkCommandBuffer commands, const Tracer &tracer) {
                vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, pipeline.handle());
                const VkDescriptorSet set = tracer.set();
                vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, tracer.layout(), 0, 1, &set,
                                        0, nullptr);
                table.trace(commands, 4);
            });
        }
}

class ExecutionModeWithExt : public ExecutionMode
{
protected:
    ExecutionModeWithExt() : ExecutionMode({.oldValidation = false, .api = Api::Ext, .newer = true}) {}
};

TEST_F(ExecutionModeWithExt, DoesNotMatter)
{
    // The extension is not enabled, nor its feature.
    gpu().breaks("VUID-VkShaderModuleCreateInfo-pCode-08740");
    gpu().breaks("VUID-VkShaderModuleCreateInfo-pCode-08742");
    for (const ModeCase &c : kModeCases) {
        Tracer tracer(gpu(), withMode(tracer_comp, c.mode), {.specializedFlags = c.specialized});
        expectStates(tracer.trace(scene_.tlas(), scene_.rays()), true);
    }
}

// --- OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX: the spy below the layer reports if it gets there ---

constexpr VkFlags64 kDisallowMixed = VkFlags64{1} << 41;

class MixedSpecialIndex : public GpuTest
{
protected:
    explicit MixedSpecialIndex(Api api = Api::Khr) : GpuTest({.oldValidation = false, .api = api, .newer = true}) {}

    void makeCompute()
    {
        const VkShaderModule module = gpu().shader(tracer_comp);
        const auto flags = vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = kDisallowMixed});
        auto info = vkInit<VkComputePipelineCreateInfo>(
            {.pNext = &flags,
             .stage = vkInit<VkPipelineShaderStageCreateInfo>(
                 {.stage = VK_SHADER_STAGE_COMPUTE_BIT, .module = module, .pName = "main"}),
             .layout = tracer_.layout()});
        VkPipeline pipeline = VK_NULL_HANDLE;
        EXPECT_EQ(vkCreateComputePipelines(gpu().device(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline), expected_);
        EXPECT_EQ(pipeline != VK_NULL_HANDLE, expected_ == VK_SUCCESS);
        EXPECT_EQ(flags.flags, kDisallowMixed) << "the application's chain is const";
        vkDestroyPipeline(gpu().device(), pipeline, nullptr);
        vkDestroyShaderModule(gpu().device(), module, nullptr);
    }
    void makeGraphics()
    {
        const auto flags = vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = kDisallowMixed});
        if (expected_ == VK_SUCCESS) {
            const Graphics graphics(gpu(), tracer_.layout(),
                                    {.vertex = plain_vertex, .fragment = query_fragment, .pNext = &flags}, 4);
            return;
        }
        // rejected before more of it is looked at
        auto info = vkInit<VkGraphicsPipelineCreateInfo>({.pNext = &flags});
        VkPipeline pipeline = VK_NULL_HANDLE;
        EXPECT_EQ(vkCreateGraphicsPipelines(gpu().device(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline), expected_);
        EXPECT_EQ(pipeline, VkPipeline{});
    }
    void makeRayTracing(VkFlags64 others)
    {
        PipelineSetup setup;
        setup.stages = {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, query_raygen}};
        setup.groups = {{.general = 0}};
        setup.layout = tracer_.layout();
        PipelineInfo info(gpu(), setup);
        const auto flags = vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = kDisallowMixed | others});
        info.get().pNext = &flags;
        VkPipeline pipeline = VK_NULL_HANDLE;
        EXPECT_EQ(gpu().vk().CreateRayTracingPipelinesKHR(gpu().device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1,
                                                          &info.get(), nullptr, &pipeline),
                  expected_);
        EXPECT_EQ(pipeline != VK_NULL_HANDLE, expected_ == VK_SUCCESS);
        vkDestroyPipeline(gpu().device(), pipeline, nullptr);
    }
    VkResult expected_ = VK_SUCCESS; // of every pipeline
    void expectFinding(const std::string &rule)
    {
        const std::vector<Message> messages = gpu().takeUnexpectedMessages();
        ASSERT_EQ(messages.size(), 1u) << rule;
        EXPECT_EQ(messages[0].id, "VELLUM-VUID-" + rule) << messages[0].text;
    }

    Tracer tracer_{gpu()};
};

TEST_F(MixedSpecialIndex, StaysInTheLayer)
{
    makeCompute();
    makeGraphics();
    makeRayTracing(kMicromapBit);
    expectNoMessages();
}

TEST_F(MixedSpecialIndex, MissingBitOfRayTracingPipelines)
{
    expected_ = strictTests() ? VK_ERROR_VALIDATION_FAILED_EXT : VK_SUCCESS;
    makeRayTracing(0);
    expectFinding("VkRayTracingPipelineCreateInfoKHR-flags-11599");
}

class MixedSpecialIndexWithoutKhr : public MixedSpecialIndex
{
protected:
    MixedSpecialIndexWithoutKhr() : MixedSpecialIndex(Api::Ext) {}
};

TEST_F(MixedSpecialIndexWithoutKhr, Reported)
{
    expected_ = strictTests() ? VK_ERROR_VALIDATION_FAILED_EXT : VK_SUCCESS;
    makeCompute();
    expectFinding("VkComputePipelineCreateInfo-flags-11593");
    makeGraphics();
    expectFinding("VkGraphicsPipelineCreateInfo-flags-11595");
    makeRayTracing(kMicromapBit);
    expectFinding("VkRayTracingPipelineCreateInfoKHR-flags-11599");
}

} // namespace
