// SPDX-License-Identifier: Apache-2.0
// The setting assume_micromaps where micromaps are the driver's own (quirks "khr" and "ext"), or KHR is translated to
// the driver's EXT: shaders and pipelines that do not declare their use of micromaps use them.
#include "command_buffer/shader_objects.h"
#include "command_buffer/state_scene.h"
#include "gpu/pipeline_tracer.h"
#include "gpu/programs/graphics.h"
#include "harness/harness.h"
#include "harness/program/labels.h"
#include "pipelines/assumed_micromaps.h"
#include "shaders/plain_vertex.h"
#include "shaders/query_fragment.h"
#include "shaders/query_raygen.h"
#include "shaders/tracer_comp.h"

namespace
{

const vt::Labels kAssumedOnDriverLabels{{"Assumed/AssumedOn*Driver.*", "one_api"},
                                        {"Assumed/AssumedTranslated.*", "one_api"}};

using namespace vt;

class OnDriver : public testing::TestWithParam<bool>
{
protected:
    explicit OnDriver(Options options)
    {
        options.oldValidation = options.declaresMode = options.validation = false;
        const AssumedMicromaps setting(assumed()); // read when the instance is created
        gpu_.emplace(options);
        scene_.emplace(gpu());
        tracer_.emplace(gpu());
        gpu().submit([this](VkCommandBuffer commands) { scene_->record(commands); });
    }
    void TearDown() override
    {
        scene_.reset();
        tracer_.reset();
        gpu_->takeMessages(); // the driver warns of the same
    }

    Gpu &gpu() { return *gpu_; }
    [[nodiscard]] static bool assumed() { return GetParam(); }

    // The expected results of the rays of StateScene. Without micromaps, all are candidates, which the shader does not
    // confirm.
    template <typename AnyResult>
    static void expectStates(const std::vector<AnyResult> &results, bool consumed)
    {
        ASSERT_EQ(results.size(), 4u);
        for (size_t i = 0; i < 4; ++i) {
            EXPECT_EQ(results[i].committed, consumed && i == 1 ? uint32_t{kTriangle} : uint32_t{kNone})
                << "triangle " << i;
            EXPECT_EQ(results[i].candidateCount, !consumed || i >= 2 ? 1u : 0u) << "triangle " << i;
        }
    }
    // Traces by whatever `record` does with the tracer's descriptor set.
    void expectTraced(bool consumed, const std::function<void(VkCommandBuffer, const Tracer &)> &record)
    {
        tracer_->prepare(scene_->tlas(), scene_->rays(), 1);
        gpu().submit([&](VkCommandBuffer commands) {
            barrier(commands);
            record(commands, *tracer_);
            barrier(commands);
        });
        expectStates(tracer_->results(), consumed);
    }
    void expectTraced(const PipelineTracerSetup &setup, bool consumed)
    {
        PipelineTracer tracer(gpu(), setup);
        expectStates(tracer.trace(scene_->tlas(), scene_->rays()), consumed);
    }
    void expectPipelines()
    {
        if (!gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
            GTEST_SKIP() << "no ray tracing pipelines";
        expectTraced({.flags = 0}, assumed());
        expectTraced({.flags = kMicromapBit}, true);
        expectTraced({.flags = 0, .inlineModules = true}, assumed());
    }

    // A library that promises to meet no micromaps gets no micromap bit, nor does a pipeline that links it
    // (VUID-VkRayTracingPipelineCreateInfoKHR-pLibraries-11598): the driver would not create it.
    void expectLinked()
    {
        if (!assumed() || !gpu().has("VK_KHR_maintenance5") || !gpu().has(VK_KHR_PIPELINE_LIBRARY_EXTENSION_NAME))
            GTEST_SKIP() << "no VkPipelineCreateFlags2CreateInfo, or no libraries";
        PipelineSetup setup;
        setup.stages = {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, query_raygen}};
        setup.groups = {{.general = 0}};
        setup.layout = tracer_->layout();
        setup.flags = VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
        const auto create = [&](const PipelineSetup &own, const void *pNext) {
            PipelineInfo info(gpu(), own);
            info.get().pNext = pNext;
            VkPipeline pipeline = VK_NULL_HANDLE;
            VT_CHECK(gpu().vk().CreateRayTracingPipelinesKHR(gpu().device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1,
                                                             &info.get(), nullptr, &pipeline));
            return RayPipeline(gpu(), pipeline);
        };
        const auto disallows = vkInit<VkPipelineCreateFlags2CreateInfoKHR>(
            {.flags = VK_PIPELINE_CREATE_LIBRARY_BIT_KHR | VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM});
        const RayPipeline library = create(setup, &disallows);
        setup.flags = 0;
        setup.libraries = {library.handle()};
        gpu().takeMessages();
        EXPECT_NE(create(setup, nullptr).handle(), VkPipeline{});
        for (const Message &message : gpu().takeMessages())
            EXPECT_EQ(message.id.find("11598"), std::string::npos) << message.text;
    }

    std::optional<Gpu> gpu_;
    std::optional<StateScene> scene_;
    std::optional<Tracer> tracer_;
};

class AssumedOnKhrDriver : public OnDriver
{
protected:
    explicit AssumedOnKhrDriver(const char *quirks = "khr")
        : OnDriver({.quirks = quirks, .api = Api::Khr, .shaderObject = true})
    {
    }
};

TEST_P(AssumedOnKhrDriver, Compute)
{
    for (const bool inlined : {false, true}) {
        if (inlined && !gpu().has(VK_EXT_GRAPHICS_PIPELINE_LIBRARY_EXTENSION_NAME))
            continue;
        Tracer tracer(gpu(), tracer_comp, {.inlineModule = inlined});
        expectStates(tracer.trace(scene_->tlas(), scene_->rays()), assumed());
    }
}

TEST_P(AssumedOnKhrDriver, Graphics)
{
    const Graphics graphics(gpu(), tracer_->layout(), {plain_vertex, query_fragment}, 4);
    expectTraced(assumed(), [&](VkCommandBuffer commands, const Tracer &tracer) {
        graphics.bind(commands);
        const VkDescriptorSet set = tracer.set();
        vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, tracer.layout(), 0, 1, &set, 0, nullptr);
        graphics.draw(commands, 3);
    });
}

TEST_P(AssumedOnKhrDriver, ShaderObjects)
{
    if (!gpu().has("VK_EXT_shader_object"))
        GTEST_SKIP() << "no VK_EXT_shader_object";
    const auto create = reinterpret_cast<CreateShaders>(vkGetDeviceProcAddr(gpu().device(), "vkCreateShadersEXT"));
    const auto destroy = reinterpret_cast<DestroyShader>(vkGetDeviceProcAddr(gpu().device(), "vkDestroyShaderEXT"));
    const auto bind = reinterpret_cast<BindShaders>(vkGetDeviceProcAddr(gpu().device(), "vkCmdBindShadersEXT"));
    TracerShader description(gpu(), *tracer_);
    ShaderHandle shader = 0;
    VT_CHECK(create(gpu().device(), 1, &description.info, nullptr, &shader));
    expectTraced(assumed(), [&](VkCommandBuffer commands, const Tracer &tracer) {
        tracer.bind(commands);
        const VkShaderStageFlagBits stage = VK_SHADER_STAGE_COMPUTE_BIT;
        bind(commands, 1, &stage, &shader);
        tracer.dispatch(commands);
    });
    destroy(gpu().device(), shader, nullptr);
}

TEST_P(AssumedOnKhrDriver, QueriesInPipelines)
{
    if (!gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        GTEST_SKIP() << "no ray tracing pipelines";
    PipelineSetup setup;
    setup.stages = {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, query_raygen}};
    setup.groups = {{.general = 0}};
    setup.layout = tracer_->layout();
    setup.flags = 0;
    const RayPipeline pipeline(gpu(), setup);
    const BindingTable table(gpu(), pipeline, {.raygen = 0});
    expectTraced(assumed(), [&](VkCommandBuffer commands, const Tracer &tracer) {
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, pipeline.handle());
        const VkDescriptorSet set = tracer.set();
        vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, tracer.layout(), 0, 1, &set, 0,
                                nullptr);
        table.trace(commands, 4);
    });
}

TEST_P(AssumedOnKhrDriver, Pipelines)
{
    expectPipelines();
}

// The create infos of a deferred operation live until it is complete.
class AssumedOnDeferringDriver : public AssumedOnKhrDriver
{
protected:
    AssumedOnDeferringDriver() : AssumedOnKhrDriver("khr,deferred") {}

    MadePipeline makeDeferred(const PipelineSetup &setup)
    {
        const Commands &vk = gpu().vk();
        VkDeferredOperationKHR operation = VK_NULL_HANDLE;
        VT_CHECK(vk.CreateDeferredOperationKHR(gpu().device(), nullptr, &operation));
        PipelineInfo info(gpu(), setup);
        VkPipeline pipeline = VK_NULL_HANDLE;
        EXPECT_EQ(vk.CreateRayTracingPipelinesKHR(gpu().device(), operation, VK_NULL_HANDLE, 1, &info.get(), nullptr,
                                                  &pipeline),
                  VK_OPERATION_DEFERRED_KHR);
        EXPECT_EQ(vk.DeferredOperationJoinKHR(gpu().device(), operation), VK_SUCCESS);
        EXPECT_EQ(vk.GetDeferredOperationResultKHR(gpu().device(), operation), VK_SUCCESS);
        vk.DestroyDeferredOperationKHR(gpu().device(), operation, nullptr);
        return {RayPipeline(gpu(), pipeline), {}};
    }
};

TEST_P(AssumedOnDeferringDriver, Pipelines)
{
    if (!gpu().has(VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME))
        GTEST_SKIP() << "no deferred operations";
    expectTraced({.flags = 0, .make = [&](Device &, const PipelineSetup &setup) { return makeDeferred(setup); }},
                 assumed());
}

// With VK_EXT_opacity_micromap all ray queries use micromaps.
class AssumedOnExtDriver : public OnDriver
{
protected:
    explicit AssumedOnExtDriver(Api api = Api::Ext) : OnDriver({.quirks = "ext", .api = api, .newer = true}) {}
};

TEST_P(AssumedOnExtDriver, Pipelines)
{
    expectPipelines();
}

TEST_P(AssumedOnExtDriver, LibraryThatDisallowsMicromaps)
{
    expectLinked();
}

class AssumedTranslated : public AssumedOnExtDriver
{
protected:
    AssumedTranslated() : AssumedOnExtDriver(Api::Khr) {}
};

TEST_P(AssumedTranslated, Pipelines)
{
    expectPipelines();
}

TEST_P(AssumedTranslated, LibraryThatDisallowsMicromaps)
{
    expectLinked();
}

TEST_P(AssumedTranslated, ReportsNoMissingMode)
{
    Tracer tracer(gpu(), tracer_comp);
    expectStates(tracer.trace(scene_->tlas(), scene_->rays()), true);
    const std::vector<Message> messages = gpu().takeMessages();
    EXPECT_EQ(std::ranges::count(messages, "VELLUM-queries-without-micromaps", &Message::id), assumed() ? 0 : 1);
}

INSTANTIATE_TEST_SUITE_P(Assumed, AssumedOnKhrDriver, testing::Bool());
INSTANTIATE_TEST_SUITE_P(Assumed, AssumedOnDeferringDriver, testing::Bool());
INSTANTIATE_TEST_SUITE_P(Assumed, AssumedOnExtDriver, testing::Bool());
INSTANTIATE_TEST_SUITE_P(Assumed, AssumedTranslated, testing::Bool());

} // namespace
