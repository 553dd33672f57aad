// SPDX-License-Identifier: Apache-2.0
// Creation of ray tracing pipelines: deferred, several at once, lifetimes of its input, stack sizes.
#include <algorithm>
#include <thread>

#include "harness/program/labels.h"
#include "pipelines/pipeline_scene.h"

namespace
{

const vt::Labels kPipelineCreationLabels{{"PipelineCreation.*", "slow forcing"},
                                         {"PipelineCreationDeferred.*", "slow forcing"},
                                         {"PipelineCreationDeferredInline.*", "slow forcing"},
                                         {"PipelineCreationNotDeferred.*", "slow forcing"},
                                         {"PipelineCreationUncompiled.*", "slow forcing"},
                                         {"PipelineCreationUncompiledDeferred.*", "slow forcing"}};

using namespace vt;

class PipelineCreation : public PipelineSceneTest
{
protected:
    explicit PipelineCreation(const Options &options = {}) : PipelineSceneTest(options) {}
    struct DeferredCase {
        uint32_t joiners = 1;
        bool destroyUnjoined = false;
    };

    // Joins with that many threads. At least one of them finds the operation complete.
    void join(VkDeferredOperationKHR operation, uint32_t joiners)
    {
        std::vector<std::thread> threads;
        std::vector<VkResult> joined(joiners, VK_ERROR_UNKNOWN);
        const auto joinOne = [&](size_t i) {
            joined[i] = gpu().vk().DeferredOperationJoinKHR(gpu().device(), operation);
        };
        for (size_t i = 1; i < joiners; ++i)
            threads.emplace_back(joinOne, i);
        joinOne(0);
        for (std::thread &thread : threads)
            thread.join();
        for (const VkResult result : joined)
            EXPECT_TRUE(result == VK_SUCCESS || result == VK_THREAD_DONE_KHR || result == VK_THREAD_IDLE_KHR) << result;
        EXPECT_NE(std::count(joined.begin(), joined.end(), VK_SUCCESS), 0);
    }

    // Makes the setup's pipeline by a deferred operation. Everything that the application passed is overwritten and
    // freed when the operation is complete, and not before.
    MadePipeline makeDeferred(const PipelineSetup &setup, const DeferredCase &how)
    {
        const Commands &vk = gpu().vk();
        VkDeferredOperationKHR operation = VK_NULL_HANDLE;
        VT_CHECK(vk.CreateDeferredOperationKHR(gpu().device(), nullptr, &operation));
        auto info = std::make_unique<PipelineInfo>(gpu(), setup);
        auto pipeline = std::make_unique<VkPipeline>(VK_NULL_HANDLE);
        const VkResult started = vk.CreateRayTracingPipelinesKHR(gpu().device(), operation, VK_NULL_HANDLE, 1,
                                                                 &info->get(), nullptr, pipeline.get());
        // Lavapipe (Mesa 25.0.7) says VK_SUCCESS where it does not defer.
        if (gpu().options().quirks == "deferred") {
            EXPECT_EQ(started, VK_OPERATION_DEFERRED_KHR);
        }
        if (started == VK_OPERATION_DEFERRED_KHR) {
            EXPECT_EQ(vk.GetDeferredOperationResultKHR(gpu().device(), operation), VK_NOT_READY);
            // Spoil the memory that was free when the call returned, so that what is read from there is noticed.
            std::vector<std::vector<uint8_t>> noise;
            for (size_t size = 16; size < 65536; size = size * 3 / 2)
                noise.emplace_back(size, uint8_t{0xdb});
            join(operation, how.joiners);
        }
        // "VK_OPERATION_NOT_DEFERRED_KHR: ... the command has completed": as good as VK_SUCCESS.
        EXPECT_EQ(vk.GetDeferredOperationResultKHR(gpu().device(), operation), VK_SUCCESS);
        info->scribble();
        info.reset();
        vk.DestroyDeferredOperationKHR(gpu().device(), operation, nullptr);
        return {RayPipeline(gpu(), *pipeline), {}};
    }

    void expectDeferred(const DeferredCase &how)
    {
        if (!gpu().has(VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME))
            GTEST_SKIP() << "no deferred operations";
        for (const bool micromaps : {true, false}) {
            const PipelineScene plain(gpu(), {.micromaps = false});
            for (const bool anyHit : {true, false}) {
                PipelineTracer tracer(
                    gpu(), {.groups = {{.anyHit = anyHit}, {.box = true, .anyHit = anyHit}},
                            .flags = micromaps ? kMicromapBit : 0,
                            .make = [&](Device &, const PipelineSetup &setup) { return makeDeferred(setup, how); }});
                for (const uint32_t flags : opacityRayFlags(micromaps))
                    (micromaps ? *scene_ : plain)
                        .expect(tracer, flags, {.triangleAnyHit = anyHit, .boxAnyHit = anyHit});
            }
        }
    }
};

// Without the validation layer: 1.3.239 records a deferred pipeline only when its result is queried, but Vellum uses
// the pipeline as soon as an operation is joined.
class PipelineCreationDeferred : public PipelineCreation
{
protected:
    explicit PipelineCreationDeferred(const char *quirks = "deferred")
        : PipelineCreation({.oldValidation = false, .quirks = quirks})
    {
    }
};
class PipelineCreationNotDeferred : public PipelineCreationDeferred
{
protected:
    PipelineCreationNotDeferred() : PipelineCreationDeferred("") {}
};

TEST_F(PipelineCreationDeferred, Deferred)
{
    expectDeferred({});
}

TEST_F(PipelineCreationDeferred, JoinedByThreads)
{
    expectDeferred({.joiners = 3});
}

TEST_F(PipelineCreationNotDeferred, NotDeferred)
{
    expectDeferred({});
}

// Inline modules are memory of the application's too.
class PipelineCreationDeferredInline : public PipelineCreation
{
protected:
    PipelineCreationDeferredInline() : PipelineCreation({.oldValidation = false, .quirks = "deferred", .newer = true})
    {
    }
};

TEST_F(PipelineCreationDeferredInline, Deferred)
{
    if (!gpu().has("VK_KHR_maintenance5"))
        GTEST_SKIP() << "no VK_KHR_maintenance5";
    PipelineTracer tracer(gpu(),
                          {.groups = {{.anyHit = false}, {.box = true}},
                           .flags2 = true,
                           .inlineModules = true,
                           .make = [&](Device &, const PipelineSetup &setup) { return makeDeferred(setup, {}); }});
    for (const uint32_t flags : opacityRayFlags())
        scene_->expect(tracer, flags, {.triangleAnyHit = false});
}

// Pipelines with and without the bit in one call, of the same modules, deferred and at once.
TEST_F(PipelineCreationDeferred, SeveralInOneCall)
{
    const PipelineScene plain(gpu(), {.micromaps = false});
    for (const bool deferred : {false, true}) {
        const auto make = [&](uint32_t kept) {
            return [this, deferred, kept](Device &, const PipelineSetup &from) {
                std::array<std::unique_ptr<PipelineInfo>, 3> infos;
                std::array<VkRayTracingPipelineCreateInfoKHR, 3> list{};
                for (uint32_t i = 0; i < 3; ++i) {
                    PipelineSetup setup = from;
                    setup.flags = i == 1 ? 0 : kMicromapBit;
                    for (PipelineGroup &group : setup.groups) {
                        if (i == 2)
                            group.anyHit = kUnused;
                    }
                    infos[i] = std::make_unique<PipelineInfo>(gpu(), setup);
                    list[i] = infos[i]->get();
                }
                const Commands &vk = gpu().vk();
                std::array<VkPipeline, 3> pipelines{};
                VkDeferredOperationKHR operation = VK_NULL_HANDLE;
                if (deferred)
                    VT_CHECK(vk.CreateDeferredOperationKHR(gpu().device(), nullptr, &operation));
                const VkResult result = vk.CreateRayTracingPipelinesKHR(gpu().device(), operation, VK_NULL_HANDLE, 3,
                                                                        list.data(), nullptr, pipelines.data());
                if (result == VK_OPERATION_DEFERRED_KHR) {
                    join(operation, 3); // each makes one
                    EXPECT_EQ(vk.GetDeferredOperationResultKHR(gpu().device(), operation), VK_SUCCESS);
                } else {
                    EXPECT_TRUE(result == VK_SUCCESS || result == VK_OPERATION_NOT_DEFERRED_KHR) << result;
                }
                if (deferred)
                    vk.DestroyDeferredOperationKHR(gpu().device(), operation, nullptr);
                for (auto &info : infos)
                    info->scribble();
                for (uint32_t i = 0; i < 3; ++i) {
                    if (i != kept)
                        vkDestroyPipeline(gpu().device(), pipelines[i], nullptr);
                }
                return MadePipeline{RayPipeline(gpu(), pipelines[kept]), {}};
            };
        };
        PipelineTracer with(gpu(), {.make = make(0)});
        PipelineTracer without(gpu(), {.make = make(1)});
        PipelineTracer noAnyHit(gpu(), {.make = make(2)});
        for (const uint32_t flags : opacityRayFlags()) {
            scene_->expect(with, flags);
            scene_->expect(noAnyHit, flags, {.triangleAnyHit = false, .boxAnyHit = false});
            if ((flags & kRayForceTwoState) == 0)
                plain.expect(without, flags);
        }
    }
}

// A driver that would have to compile: of several pipelines, those that may only be made without are not, and the
// others are ("Multiple Pipeline Creation"), with what the layer needs to know of them; deferred or not.
class PipelineCreationUncompiled : public PipelineCreation
{
protected:
    explicit PipelineCreationUncompiled(const Options &options = {.oldValidation = false, .quirks = "uncompiled"})
        : PipelineCreation(options)
    {
    }

    void expectHalfMade(bool deferred)
    {
        const Commands &vk = gpu().vk();
        for (const bool early : {false, true}) {
            const auto make = [&](Device &, const PipelineSetup &from) {
                std::array<std::unique_ptr<PipelineInfo>, 3> infos;
                std::array<VkRayTracingPipelineCreateInfoKHR, 3> list{};
                for (uint32_t i = 0; i < 3; ++i) {
                    PipelineSetup setup = from;
                    if (i == 1)
                        setup.flags |= VK_PIPELINE_CREATE_FAIL_ON_PIPELINE_COMPILE_REQUIRED_BIT |
                                       (early ? VK_PIPELINE_CREATE_EARLY_RETURN_ON_FAILURE_BIT : 0);
                    infos[i] = std::make_unique<PipelineInfo>(gpu(), setup);
                    list[i] = infos[i]->get();
                }
                std::array<VkPipeline, 3> pipelines{};
                VkDeferredOperationKHR operation = VK_NULL_HANDLE;
                if (deferred)
                    VT_CHECK(vk.CreateDeferredOperationKHR(gpu().device(), nullptr, &operation));
                VkResult result = vk.CreateRayTracingPipelinesKHR(gpu().device(), operation, VK_NULL_HANDLE, 3,
                                                                  list.data(), nullptr, pipelines.data());
                if (result == VK_OPERATION_DEFERRED_KHR) {
                    join(operation, 2);
                    result = vk.GetDeferredOperationResultKHR(gpu().device(), operation);
                }
                EXPECT_EQ(result, VK_PIPELINE_COMPILE_REQUIRED);
                if (deferred)
                    vk.DestroyDeferredOperationKHR(gpu().device(), operation, nullptr);
                EXPECT_NE(pipelines[0], VkPipeline{});
                EXPECT_EQ(pipelines[1], VkPipeline{});
                EXPECT_EQ(pipelines[2] != VkPipeline{}, !early || deferred); // deferred, each is made by itself
                vkDestroyPipeline(gpu().device(), pipelines[2], nullptr);
                return MadePipeline{RayPipeline(gpu(), pipelines[0]), {}};
            };
            PipelineTracer tracer(gpu(), {.groups = {{.anyHit = false}, {.box = true}}, .make = make});
            for (const uint32_t flags : opacityRayFlags())
                scene_->expect(tracer, flags, {.triangleAnyHit = false});
        }
    }
};

TEST_F(PipelineCreationUncompiled, SomeOfSeveral)
{
    expectHalfMade(false);
}

class PipelineCreationUncompiledDeferred : public PipelineCreationUncompiled
{
protected:
    // Khronos' layer 1.4.363 knows no pipeline of a deferred operation in which another was not made.
    PipelineCreationUncompiledDeferred()
        : PipelineCreationUncompiled({.validation = false, .quirks = "uncompiled,deferred"})
    {
    }
};

TEST_F(PipelineCreationUncompiledDeferred, SomeOfSeveral)
{
    expectHalfMade(true);
}

// An unused deferred operation, and one whose call failed.
TEST_F(PipelineCreation, UnusedOperation)
{
    VkDeferredOperationKHR operation = VK_NULL_HANDLE;
    VT_CHECK(gpu().vk().CreateDeferredOperationKHR(gpu().device(), nullptr, &operation));
    EXPECT_EQ(gpu().vk().GetDeferredOperationResultKHR(gpu().device(), operation), VK_SUCCESS);
    gpu().vk().DestroyDeferredOperationKHR(gpu().device(), operation, nullptr);
    gpu().vk().DestroyDeferredOperationKHR(gpu().device(), VK_NULL_HANDLE, nullptr);
}

TEST_F(PipelineCreation, DestroyNothing)
{
    vkDestroyPipeline(gpu().device(), VK_NULL_HANDLE, nullptr);
}

// Twice with a pipeline cache: the second pipeline is taken from it.
TEST_F(PipelineCreation, Cache)
{
    auto info = vkInit<VkPipelineCacheCreateInfo>();
    VkPipelineCache cache = VK_NULL_HANDLE;
    VT_CHECK(vkCreatePipelineCache(gpu().device(), &info, nullptr, &cache));
    for (int i = 0; i < 2; ++i) {
        for (const bool anyHit : {true, false}) {
            PipelineTracer tracer(
                gpu(),
                {.groups = {{.anyHit = anyHit}, {.box = true}}, .make = [&](Device &g, const PipelineSetup &setup) {
                     const PipelineInfo create(g, setup);
                     VkPipeline pipeline = VK_NULL_HANDLE;
                     VT_CHECK(g.vk().CreateRayTracingPipelinesKHR(g.device(), VK_NULL_HANDLE, cache, 1, &create.get(),
                                                                  nullptr, &pipeline));
                     return MadePipeline{RayPipeline(g, pipeline), {}};
                 }});
            for (const uint32_t flags : opacityRayFlags())
                scene_->expect(tracer, flags, {.triangleAnyHit = anyHit});
        }
    }
    vkDestroyPipelineCache(gpu().device(), cache, nullptr);
}

// --- stack sizes ---

struct StackSizes {
    VkDeviceSize raygen, miss, closestHit, anyHit, boxClosestHit, boxAnyHit, intersection;

    // raytracing.adoc, "Ray Tracing Pipeline Stack", for a recursion depth of 1.
    [[nodiscard]] VkDeviceSize total() const
    {
        return raygen + std::max({closestHit, boxClosestHit, miss, intersection + std::max(anyHit, boxAnyHit)});
    }
};

StackSizes sizesOf(const RayPipeline &pipeline, bool anyHit)
{
    return {pipeline.stackSize(0, VK_SHADER_GROUP_SHADER_GENERAL_KHR),
            pipeline.stackSize(1, VK_SHADER_GROUP_SHADER_GENERAL_KHR),
            pipeline.stackSize(2, VK_SHADER_GROUP_SHADER_CLOSEST_HIT_KHR),
            anyHit ? pipeline.stackSize(2, VK_SHADER_GROUP_SHADER_ANY_HIT_KHR) : 0,
            pipeline.stackSize(3, VK_SHADER_GROUP_SHADER_CLOSEST_HIT_KHR),
            anyHit ? pipeline.stackSize(3, VK_SHADER_GROUP_SHADER_ANY_HIT_KHR) : 0,
            pipeline.stackSize(3, VK_SHADER_GROUP_SHADER_INTERSECTION_KHR)};
}

TEST_F(PipelineCreation, StackSizes)
{
    for (const bool anyHit : {true, false}) {
        const std::vector<TracerGroup> groups{{.anyHit = anyHit}, {.box = true, .anyHit = anyHit}};
        const PipelineTracer with(gpu(), {.groups = groups});
        const PipelineTracer without(gpu(), {.groups = groups, .flags = 0});
        const StackSizes a = sizesOf(with.pipeline(), anyHit), b = sizesOf(without.pipeline(), anyHit);
        // The layer's code adds little, and no size is 0 or that of another group's shader.
        EXPECT_GE(a.total(), b.total());
        EXPECT_LT(a.total(), b.total() + 65536);
    }
}

// The application sets a stack size without any-hit shaders, as it has none. The spy reports it if the size that
// reaches the driver has no space for the layer's.
TEST_F(PipelineCreation, StackSizeSetByTheApplication)
{
    for (const bool anyHit : {true, false}) {
        for (const bool micromaps : {true, false}) {
            const PipelineScene plain(gpu(), {.micromaps = false});
            PipelineTracer tracer(gpu(), {.groups = {{.anyHit = anyHit}, {.box = true, .anyHit = anyHit}},
                                          .flags = micromaps ? kMicromapBit : 0,
                                          .dynamicStackSize = true});
            const PipelineScene &scene = micromaps ? *scene_ : plain;
            const auto size = static_cast<uint32_t>(sizesOf(tracer.pipeline(), anyHit).total());
            for (const uint32_t flags : opacityRayFlags(micromaps)) {
                tracer.prepare(scene.tlas(), scene.rays(flags), 4);
                gpu().submit([&](VkCommandBuffer commands) {
                    tracer.bind(commands);
                    gpu().vk().CmdSetRayTracingPipelineStackSizeKHR(commands, size);
                    tracer.dispatch(commands);
                    barrier(commands);
                });
                scene.expect(tracer.results(), flags, {.triangleAnyHit = anyHit, .boxAnyHit = anyHit});
            }
        }
    }
}

// As above, if the layer's any-hit shader for boxes is the only one that it adds.
TEST_F(PipelineCreation, StackSizeWithBoxesOnly)
{
    PipelineTracer tracer(gpu(), {.groups = {{}, {.box = true, .anyHit = false}},
                                  .flags = kMicromapBit | VK_PIPELINE_CREATE_RAY_TRACING_SKIP_TRIANGLES_BIT_KHR,
                                  .dynamicStackSize = true,
                                  .make = [](Device &g, const PipelineSetup &from) {
                                      PipelineSetup setup = from;
                                      setup.groups.erase(setup.groups.begin() + 2);
                                      return MadePipeline{RayPipeline(g, setup), {0, 1, 2, 2}};
                                  }});
    const RayPipeline &pipeline = tracer.pipeline();
    const VkDeviceSize size = pipeline.stackSize(0, VK_SHADER_GROUP_SHADER_GENERAL_KHR) +
                              std::max({pipeline.stackSize(1, VK_SHADER_GROUP_SHADER_GENERAL_KHR),
                                        pipeline.stackSize(2, VK_SHADER_GROUP_SHADER_CLOSEST_HIT_KHR),
                                        pipeline.stackSize(2, VK_SHADER_GROUP_SHADER_INTERSECTION_KHR)});
    for (const uint32_t flags : opacityRayFlags()) {
        tracer.prepare(scene_->tlas(), scene_->rays(flags), 4);
        gpu().submit([&](VkCommandBuffer commands) {
            tracer.bind(commands);
            gpu().vk().CmdSetRayTracingPipelineStackSizeKHR(commands, static_cast<uint32_t>(size));
            tracer.dispatch(commands);
            barrier(commands);
        });
        scene_->expect(tracer.results(), flags, {.boxAnyHit = false, .skipTriangles = true});
    }
}

// Pipelines are made by several threads at once (VkDevice is not externally synchronized).
TEST_F(PipelineCreation, MadeByThreads)
{
    std::array<std::unique_ptr<PipelineTracer>, 4> tracers;
    std::vector<std::thread> threads;
    for (size_t i = 0; i < tracers.size(); ++i) {
        threads.emplace_back([&, i] {
            for (int k = 0; k < 3; ++k)
                tracers[i] = std::make_unique<PipelineTracer>(
                    gpu(), PipelineTracerSetup{.groups = {{.anyHit = i % 2 == 0}, {.box = true}}});
        });
    }
    for (std::thread &thread : threads)
        thread.join();
    for (size_t i = 0; i < tracers.size(); ++i)
        scene_->expect(*tracers[i], 0x402, {.triangleAnyHit = i % 2 == 0});
}

// The application's feedback has space for its own stages.
TEST_F(PipelineCreation, Feedback)
{
    for (const bool anyHit : {true, false}) {
        struct {
            VkPipelineCreationFeedback whole{};
            std::array<VkPipelineCreationFeedback, 6> stages{};
            std::array<uint8_t, 256> guard{};
        } feedback;
        feedback.guard.fill(0xa5);
        PipelineTracer tracer(gpu(), {.groups = {{.anyHit = anyHit}, {.box = true, .anyHit = anyHit}},
                                      .make = [&](Device &g, const PipelineSetup &setup) {
                                          PipelineInfo info(g, setup);
                                          auto create = vkInit<VkPipelineCreationFeedbackCreateInfo>(
                                              {.pNext = info.get().pNext,
                                               .pPipelineCreationFeedback = &feedback.whole,
                                               .pipelineStageCreationFeedbackCount = info.get().stageCount,
                                               .pPipelineStageCreationFeedbacks = feedback.stages.data()});
                                          EXPECT_EQ(info.get().stageCount, feedback.stages.size());
                                          info.get().pNext = &create;
                                          VkPipeline pipeline = VK_NULL_HANDLE;
                                          VT_CHECK(g.vk().CreateRayTracingPipelinesKHR(g.device(), VK_NULL_HANDLE,
                                                                                       VK_NULL_HANDLE, 1, &info.get(),
                                                                                       nullptr, &pipeline));
                                          return MadePipeline{RayPipeline(g, pipeline), {}};
                                      }});
        EXPECT_TRUE(std::all_of(feedback.guard.begin(), feedback.guard.end(), [](uint8_t b) { return b == 0xa5; }));
        scene_->expect(tracer, 0x402, {.triangleAnyHit = anyHit, .boxAnyHit = anyHit});
    }
}

} // namespace
