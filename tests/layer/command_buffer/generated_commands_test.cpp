// SPDX-License-Identifier: Apache-2.0
// VK_EXT_device_generated_commands: shaders that trace rays, selected and launched by commands that the device reads,
// after the layer recorded work between these commands and the state that they depend on.
#include "command_buffer/compute_pipeline.h"
#include "command_buffer/generated_commands.h"
#include "command_buffer/shader_objects.h"
#include "command_buffer/state_scene.h"
#include "pipelines/pipeline_scene.h"

#include "harness/program/labels.h"
#include "shaders/tracer_by_address.h"
#include "shaders/tracer_constant_080.h"

namespace
{

const vt::Labels kGeneratedCommandsLabels{{"GeneratedCommandsOfDevice.*", "quirks forcing"},
                                          {"GeneratedCommandsWithoutLayer.*", "one_api"}};

using namespace vt;

class GeneratedCommandsTest : public PipelineSceneTest
{
protected:
    explicit GeneratedCommandsTest(bool vellum = true)
        : PipelineSceneTest({.vellum = vellum,
                             .oldValidation = false,
                             .micromaps = vellum,
                             .shaderObject = true,
                             .maintenance = true,
                             .newer = true})
    {
    }
    void SetUp() override
    {
        PipelineSceneTest::SetUp();
        if (!IsSkipped() && !gpu().has("VK_EXT_device_generated_commands"))
            GTEST_SKIP() << "no VK_EXT_device_generated_commands";
    }

    // Micromap, BLAS and TLAS are built between what `bind` does and the generated commands.
    void expectRight(const Tracer &tracer, StateScene &scene, const GeneratedCommands &generated, bool preprocess,
                     const std::function<void(VkCommandBuffer)> &bind)
    {
        gpu().submit([&](VkCommandBuffer commands) {
            bind(commands);
            scene.record(commands);
            if (preprocess) {
                generated.preprocess(commands, commands);
                barrier(commands);
            }
            generated.execute(commands);
            barrier(commands);
        });
        StateScene::expectRight(tracer.results());
    }

    static constexpr VkPushConstantRange kPush{VK_SHADER_STAGE_COMPUTE_BIT, 0, 16};
};

using GeneratedCommandsOfDevice = GeneratedCommandsTest;

// The structure's address is one of the push constants that a sequence sets. The first sequence traces no ray.
TEST_F(GeneratedCommandsOfDevice, DispatchesWithPushConstants)
{
    for (const bool preprocess : {false, true}) {
        StateScene scene(gpu());
        Tracer tracer(gpu());
        tracer.prepare(scene.tlas(), StateScene::rays());
        const ComputePipeline pipeline(gpu(), tracer.layout(), tracer_by_address, generated::kIndirectBindableBit);
        const VkDeviceAddress at = scene.tlas().address();
        const auto low = static_cast<uint32_t>(at);
        const auto high = static_cast<uint32_t>(at >> 32);
        const GeneratedCommands generated(gpu(),
                                          {.layout = tracer.layout(),
                                           .stages = VK_SHADER_STAGE_COMPUTE_BIT,
                                           .pipeline = pipeline.handle(),
                                           .push = kPush,
                                           .preprocess = preprocess},
                                          std::array<uint32_t, 14>{0, 8, low, high, 1, 1, 1, //
                                                                   4, 8, low, high, 1, 1, 1});
        expectRight(tracer, scene, generated, preprocess, [&](VkCommandBuffer commands) {
            tracer.bind(commands);
            vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline.handle());
        });
    }
}

// Push constants come from the command buffer: those that the application has pushed, not what the layer's builds push.
TEST_F(GeneratedCommandsOfDevice, ChoosesPipelines)
{
    for (const bool preprocess : {false, true}) {
        StateScene scene(gpu());
        Tracer tracer(gpu());
        tracer.prepare(scene.tlas(), StateScene::rays());
        const ComputePipeline other(gpu(), tracer.layout(), tracer_constant_080, generated::kIndirectBindableBit);
        const ComputePipeline pipeline(gpu(), tracer.layout(), tracer_comp, generated::kIndirectBindableBit, true);
        const ExecutionSet set(gpu(), std::array{other.handle(), pipeline.handle()});
        const GeneratedCommands generated(
            gpu(),
            {.layout = tracer.layout(), .stages = VK_SHADER_STAGE_COMPUTE_BIT, .set = &set, .preprocess = preprocess},
            std::array<uint32_t, 8>{0, 1, 1, 1, 1, 1, 1, 1});
        expectRight(tracer, scene, generated, preprocess, [&](VkCommandBuffer commands) {
            tracer.bind(commands);
            vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, other.handle()); // the initial pipeline
        });
    }
}

TEST_F(GeneratedCommandsOfDevice, ChoosesShaderObjects)
{
    if (!gpu().has("VK_EXT_shader_object"))
        GTEST_SKIP() << "no VK_EXT_shader_object";
    const auto create = reinterpret_cast<CreateShaders>(vkGetDeviceProcAddr(gpu().device(), "vkCreateShadersEXT"));
    const auto destroy = reinterpret_cast<DestroyShader>(vkGetDeviceProcAddr(gpu().device(), "vkDestroyShaderEXT"));
    const auto bind = reinterpret_cast<BindShaders>(vkGetDeviceProcAddr(gpu().device(), "vkCmdBindShadersEXT"));
    StateScene scene(gpu());
    Tracer tracer(gpu());
    tracer.prepare(scene.tlas(), StateScene::rays());
    std::array<ShaderHandle, 2> shaders{};
    for (size_t i = 0; i < 2; ++i) {
        TracerShader description(gpu(), tracer, i == 0 ? std::span<const uint32_t>(tracer_constant_080) : tracer_comp);
        description.info.flags = generated::kIndirectBindableShaderBit;
        VT_CHECK(create(gpu().device(), 1, &description.info, nullptr, &shaders[i]));
    }
    {
        const ExecutionSet set(gpu(), shaders, tracer.setLayout(), kPush);
        const GeneratedCommands generated(
            gpu(),
            {.layout = tracer.layout(), .stages = VK_SHADER_STAGE_COMPUTE_BIT, .set = &set, .shaderObjects = true},
            std::array<uint32_t, 8>{0, 1, 1, 1, 1, 1, 1, 1});
        expectRight(tracer, scene, generated, false, [&](VkCommandBuffer commands) {
            tracer.bind(commands);
            const VkShaderStageFlagBits stage = VK_SHADER_STAGE_COMPUTE_BIT;
            bind(commands, 1, &stage, shaders.data());
        });
    }
    for (const ShaderHandle shader : shaders)
        destroy(gpu().device(), shader, nullptr);
}

class GeneratedCommandsWithoutLayer : public GeneratedCommandsTest
{
protected:
    GeneratedCommandsWithoutLayer() : GeneratedCommandsTest(false) {}
};

// A VkTraceRaysIndirectCommand2KHR in each sequence.
class TracedRays
{
public:
    TracedRays(Gpu &gpu, const PipelineScene &scene, bool chosen) : gpu_(gpu), scene_(scene), chosen_(chosen) {}

    void expect(const PipelineTracerSetup &setup)
    {
        PipelineTracerSetup bindable = setup;
        bindable.make = [](Device &g, const PipelineSetup &from) {
            class PipelineInfo info(g, from);
            const auto flags =
                vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = generated::kIndirectBindableBit | from.flags});
            info.get().pNext = &flags;
            VkPipeline pipeline = VK_NULL_HANDLE;
            VT_CHECK(g.vk().CreateRayTracingPipelinesKHR(g.device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info.get(),
                                                         nullptr, &pipeline));
            return MadePipeline{RayPipeline(g, pipeline), {}};
        };
        PipelineTracer tracer(gpu_, bindable);
        const VkPipeline pipeline = tracer.pipeline().handle();
        const std::array<VkPipeline, 1> pipelines{pipeline};
        std::optional<ExecutionSet> set;
        if (chosen_)
            set.emplace(gpu_, pipelines);
        for (const uint32_t flags : opacityRayFlags(gpu_.options().micromaps)) {
            tracer.prepare(scene_.tlas(), scene_.rays(flags), 4);
            const BindingTable &table = tracer.table();
            const VkTraceRaysIndirectCommand2KHR command{table.raygen.deviceAddress,
                                                         table.raygen.size,
                                                         table.miss.deviceAddress,
                                                         table.miss.size,
                                                         table.miss.stride,
                                                         table.hit.deviceAddress,
                                                         table.hit.size,
                                                         table.hit.stride,
                                                         table.callable.deviceAddress,
                                                         table.callable.size,
                                                         table.callable.stride,
                                                         tracer.rayCount(),
                                                         1,
                                                         1};
            std::vector<uint32_t> words(sizeof command / 4);
            std::memcpy(words.data(), &command, sizeof command);
            if (chosen_)
                words.insert(words.begin(), 0);
            const GeneratedCommands generated(gpu_,
                                              {.layout = tracer.resources().layout(),
                                               .stages = kStages,
                                               .set = set ? &*set : nullptr,
                                               .pipeline = set ? VK_NULL_HANDLE : pipeline,
                                               .last = Token::TraceRays2,
                                               .lastBytes = sizeof command},
                                              words);
            gpu_.submit([&](VkCommandBuffer commands) {
                tracer.bind(commands);
                generated.execute(commands);
                barrier(commands);
            });
            scene_.expect(tracer.results(), flags);
        }
    }

private:
    // The stages of the pipeline.
    static constexpr VkShaderStageFlags kStages =
        PipelineResources::kStages & ~static_cast<VkShaderStageFlags>(VK_SHADER_STAGE_CALLABLE_BIT_KHR);

    Gpu &gpu_;
    const PipelineScene &scene_;
    bool chosen_;
};

TEST_F(GeneratedCommandsWithoutLayer, TracesRays)
{
    TracedRays(gpu(), *scene_, false).expect({});
}

TEST_F(GeneratedCommandsOfDevice, TracesRays)
{
    TracedRays(gpu(), *scene_, false).expect({});
}

TEST_F(GeneratedCommandsOfDevice, TracesRaysByAChosenPipeline)
{
    TracedRays(gpu(), *scene_, true).expect({});
}

} // namespace
