// SPDX-License-Identifier: Apache-2.0
// Pipeline libraries: linked in any order, nested, and together with groups of the pipeline itself.
#include <algorithm>

#include "gpu/programs/pipeline_libraries.h"
#include "harness/mock_driver.h"
#include "harness/program/labels.h"
#include "pipelines/pipeline_scene.h"
#include "shaders/pipeline_pushed.h"

namespace
{

const vt::Labels kPipelineLibraryLabels{{"PipelineLibrary.*", "slow forcing"},
                                        {"PipelineLibraryHandles.*", "slow"},
                                        {"PipelineLibraryHandlesWithoutLayer.*", "slow one_api"},
                                        {"PipelineLibraryWithoutLayer.*", "slow one_api"}};

using namespace vt;

// Groups of the tracer's setup: ray generation, miss, triangles, boxes. Each library holds some, with their stages.
using Groups = std::vector<uint32_t>;

struct GroupPlan {
    std::vector<Groups> libraries; // in the order of linking
    Groups own;                    // groups of the pipeline itself
    bool nested = false;           // all libraries are linked to one, which the pipeline links
};

class PipelineLibrary : public PipelineSceneTest
{
protected:
    explicit PipelineLibrary(const Options &options = {.shared = true}) : PipelineSceneTest(options) {}
    void SetUp() override
    {
        PipelineSceneTest::SetUp();
        if (!IsSkipped() && !gpu().has(VK_KHR_PIPELINE_LIBRARY_EXTENSION_NAME))
            GTEST_SKIP() << "no pipeline libraries";
    }
    void TearDown() override
    {
        libraries_.clear();
        PipelineSceneTest::TearDown();
    }

    MadePipeline link(const PipelineSetup &from, const GroupPlan &plan)
    {
        libraries_.clear();
        std::vector<uint32_t> places(from.groups.size());
        uint32_t next = 0;
        for (const uint32_t g : plan.own)
            places[g] = next++;
        PipelineSetup linking = partOf(from, plan.own);
        PipelineSetup outer = partOf(from, {});
        for (const Groups &groups : plan.libraries) {
            PipelineSetup library = partOf(from, groups);
            library.flags |= VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
            libraries_.emplace_back(gpu(), library);
            (plan.nested ? outer : linking).libraries.push_back(libraries_.back().handle());
            for (const uint32_t g : groups)
                places[g] = next++;
        }
        if (plan.nested) {
            outer.flags |= VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
            libraries_.emplace_back(gpu(), outer);
            linking.libraries = {libraries_.back().handle()};
        }
        MadePipeline made{RayPipeline(gpu(), linking), places};
        return made;
    }

    void expect(const GroupPlan &plan, const PipelineTracerSetup &base, const PipelineScene::View &view)
    {
        PipelineTracerSetup setup = base;
        setup.make = [this, &plan](Device &, const PipelineSetup &from) { return link(from, plan); };
        PipelineTracer tracer(gpu(), setup);
        for (const uint32_t flags : opacityRayFlags(gpu().options().micromaps))
            scene_->expect(tracer, flags, view);
        expectHandles(tracer.pipeline(), static_cast<uint32_t>(setup.groups.size()) + 2);
    }
    void expect(const GroupPlan &plan) { expect(plan, {}, {}); }
    void expectWithoutAnyHit(const GroupPlan &plan)
    {
        expect(plan, {.groups = {{.anyHit = false}, {.box = true, .anyHit = false}}},
               {.triangleAnyHit = false, .boxAnyHit = false});
    }

    // Ranges of handles, also across the end of the pipeline's own groups and from library to library.
    void expectHandles(const RayPipeline &pipeline, uint32_t groups) const
    {
        const size_t size = gpu().pipelineProperties().shaderGroupHandleSize;
        const std::vector<uint8_t> all = pipeline.groupHandles(0, groups);
        for (uint32_t first = 0; first < groups; ++first) {
            const auto start = all.begin() + static_cast<ptrdiff_t>(first * size);
            for (uint32_t other = 0; other < first; ++other)
                EXPECT_FALSE(std::equal(start, start + static_cast<ptrdiff_t>(size),
                                        all.begin() + static_cast<ptrdiff_t>(other * size)))
                    << "groups " << other << " and " << first << " have one handle";
            for (uint32_t count = 1; first + count <= groups; ++count) {
                const std::vector<uint8_t> some = pipeline.groupHandles(first, count);
                EXPECT_TRUE(std::equal(some.begin(), some.end(), start)) << first << ", " << count;
            }
        }
    }

    Gpu &gpu() const { return const_cast<PipelineLibrary *>(this)->PipelineTest::gpu(); }

    std::vector<RayPipeline> libraries_;
};

class PipelineLibraryWithoutLayer : public PipelineLibrary
{
protected:
    PipelineLibraryWithoutLayer() : PipelineLibrary({.vellum = false, .validation = false, .micromaps = false}) {}
};

// A ray generation shader of a library does not run on lavapipe (Mesa 25.0.7), so it is the pipeline's own here.
const std::vector<GroupPlan> kPlans{
    {.libraries = {{1}, {2}, {3}}, .own = {0}},
    {.libraries = {{3}, {2}, {1}}, .own = {0}},
    {.libraries = {{2, 3}}, .own = {0, 1}},
    {.libraries = {{2}, {3}}, .own = {0, 1}},
    {.libraries = {{3}, {2}}, .own = {1, 0}},
    {.libraries = {{1}}, .own = {3, 0, 2}},
    {.libraries = {{3}, {1}}, .own = {2, 0}},
    {.libraries = {{2}, {3}}, .own = {0, 1}, .nested = true},
    {.libraries = {{3}, {2, 1}}, .own = {0}, .nested = true},
};

// Pipelines of libraries only: they can be created, and have handles.
const std::vector<GroupPlan> kOnlyLibraries{
    {.libraries = {{0, 1}, {2}, {3}}},
    {.libraries = {{3}, {2}, {1, 0}}},
    {.libraries = {{3, 0}, {2, 1}}, .nested = true},
};

TEST_F(PipelineLibraryWithoutLayer, Orders)
{
    for (size_t i = 0; i < kPlans.size(); ++i) {
        SCOPED_TRACE(testing::Message() << "plan " << i);
        expect(kPlans[i]);
        expectWithoutAnyHit(kPlans[i]);
    }
}

TEST_F(PipelineLibrary, Orders)
{
    for (size_t i = 0; i < kPlans.size(); ++i) {
        SCOPED_TRACE(testing::Message() << "plan " << i);
        expect(kPlans[i]);
    }
}

TEST_F(PipelineLibrary, GroupsWithoutAnyHit)
{
    for (size_t i = 0; i < kPlans.size(); ++i) {
        SCOPED_TRACE(testing::Message() << "plan " << i);
        expectWithoutAnyHit(kPlans[i]);
    }
}

TEST_F(PipelineLibrary, OnlyLibraries)
{
    for (const GroupPlan &plan : kOnlyLibraries) {
        for (const bool anyHit : {true, false}) {
            const PipelineTracer tracer(
                gpu(), {.groups = {{.anyHit = anyHit}, {.box = true, .anyHit = anyHit}},
                        .make = [&](Device &, const PipelineSetup &from) { return link(from, plan); }});
            expectHandles(tracer.pipeline(), 4);
        }
    }
}

TEST_F(PipelineLibrary, ZeroRecords)
{
    for (size_t i = 0; i < kPlans.size(); ++i) {
        SCOPED_TRACE(testing::Message() << "plan " << i);
        expect(kPlans[i], {.records = {std::nullopt, 1}}, {.triangleAnyHit = false, .triangleClosestHit = false});
    }
    // Neither the pipeline nor its libraries have a hit group.
    const PipelineTracerSetup none{.groups = {}, .records = {std::nullopt, std::nullopt}};
    const PipelineScene::View view{
        .triangleAnyHit = false, .triangleClosestHit = false, .skipBoxes = true, .missFlags = false};
    expect({.libraries = {{1}}, .own = {0}}, none, view);
}

TEST_F(PipelineLibrary, WithoutTheBit)
{
    const PipelineScene plain(gpu(), {.micromaps = false});
    for (const GroupPlan &plan : kPlans) {
        PipelineTracer tracer(
            gpu(), {.flags = 0, .make = [&](Device &, const PipelineSetup &from) { return link(from, plan); }});
        for (const uint32_t flags : opacityRayFlags(false))
            plain.expect(tracer, flags);
    }
}

// Only the opposite is forbidden: libraries with the bit may be linked to a pipeline without it.
TEST_F(PipelineLibrary, LibrariesWithTheBitInAPipelineWithoutIt)
{
    const PipelineScene plain(gpu(), {.micromaps = false});
    PipelineTracer tracer(gpu(), {.make = [&](Device &g, const PipelineSetup &from) {
                              PipelineSetup library = partOf(from, Groups{2, 3});
                              library.flags |= VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
                              libraries_.emplace_back(g, library);
                              PipelineSetup linking = partOf(from, Groups{0, 1});
                              linking.flags = 0;
                              linking.libraries = {libraries_.back().handle()};
                              return MadePipeline{RayPipeline(g, linking), {}};
                          }});
    for (const uint32_t flags : opacityRayFlags(false))
        plain.expect(tracer, flags);
}

// Lavapipe before Mesa 26 shows rays of linked libraries the push constants of the last dispatch. After one of the
// layer's they are the application's, all of them.
TEST_F(PipelineLibrary, PushConstantsAfterInjectedWork)
{
    VkPhysicalDeviceProperties properties{};
    vkGetPhysicalDeviceProperties(gpu().physical(), &properties);
    if (properties.limits.maxPushConstantsSize < 256)
        GTEST_SKIP() << "fewer push constants";
    if (chosenQuirk("structures"))
        GTEST_SKIP() << "the driver says that it is a newer one";
    const PipelineResources resources(gpu(), 1, 256);
    PipelineSetup setup;
    setup.stages = {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, pipeline_pushed}};
    setup.groups = {{.general = 0}};
    setup.layout = resources.layout();
    setup.flags = VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
    const RayPipeline library(gpu(), setup);
    PipelineSetup linked;
    linked.layout = resources.layout();
    linked.libraries = {library.handle()};
    const RayPipeline pipeline(gpu(), linked);
    const BindingTable table(gpu(), pipeline, {});
    std::array<uint32_t, 64> words{};
    for (uint32_t i = 0; i < words.size(); ++i)
        words[i] = 0x3254761 * (i + 1);
    const Buffer seen(gpu(), sizeof words, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    const PipelineScene scene(gpu());
    resources.write(scene.tlas().handle(), std::array<const Buffer *, 1>{&seen});
    MicromapInput input;
    input.add(3, kFourState, std::vector<uint8_t>(64, 1));
    Micromap micromap(gpu(), std::move(input));
    gpu().submit([&](VkCommandBuffer commands) {
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, pipeline.handle());
        resources.bind(commands);
        vkCmdPushConstants(commands, resources.layout(), PipelineResources::kStages, 0, sizeof words, words.data());
        micromap.record(commands);
        table.trace(commands, static_cast<uint32_t>(words.size()));
        barrier(commands);
    });
    for (size_t i = 0; i < words.size(); ++i)
        ASSERT_EQ(seen.as<uint32_t>()[i], words[i]) << "word " << i;
}

// A library may be linked to several pipelines, and pipelines may be linked and destroyed in any order.
TEST_F(PipelineLibrary, LinkedTwice)
{
    std::vector<RayPipeline> libraries;
    const auto make = [&](Device &g, const PipelineSetup &from) {
        if (libraries.empty()) {
            PipelineSetup library = partOf(from, Groups{2, 3});
            library.flags |= VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
            libraries.emplace_back(g, library);
        }
        PipelineSetup linking = partOf(from, Groups{0, 1});
        linking.libraries = {libraries[0].handle()};
        return MadePipeline{RayPipeline(g, linking), {}};
    };
    auto first = std::make_unique<PipelineTracer>(gpu(), PipelineTracerSetup{.make = make});
    PipelineTracer second(gpu(), {.make = make});
    scene_->expect(*first, 0);
    first.reset();
    scene_->expect(second, kRayOpaque);
    PipelineTracer third(gpu(), {.make = make});
    scene_->expect(third, kRayCullNoOpaque);
}

// VK_EXT_pipeline_library_group_handles: "These group handles remain bitwise identical for any pipeline which
// references the pipeline library."
class PipelineLibraryHandles : public PipelineLibrary
{
protected:
    explicit PipelineLibraryHandles(bool vellum = true)
        : PipelineLibrary({.vellum = vellum, .oldValidation = false, .micromaps = vellum, .newer = true})
    {
    }
    void expectSame()
    {
        if (!gpu().has("VK_EXT_pipeline_library_group_handles"))
            GTEST_SKIP() << "no VK_EXT_pipeline_library_group_handles";
        const PipelineTracer tracer(gpu(), {.make = [&](Device &, const PipelineSetup &from) {
                                        return link(from, {.libraries = {{3}, {2, 1}}, .own = {0}});
                                    }});
        ASSERT_EQ(libraries_.size(), 2u);
        EXPECT_EQ(libraries_[0].groupHandles(0), tracer.pipeline().groupHandles(1));
        EXPECT_EQ(libraries_[1].groupHandles(0), tracer.pipeline().groupHandles(2));
        EXPECT_EQ(libraries_[1].groupHandles(1), tracer.pipeline().groupHandles(3));
        EXPECT_EQ(libraries_[1].groupHandles(0, 2), tracer.pipeline().groupHandles(2, 2));
    }
};

class PipelineLibraryHandlesWithoutLayer : public PipelineLibraryHandles
{
protected:
    PipelineLibraryHandlesWithoutLayer() : PipelineLibraryHandles(false) {}
};

TEST_F(PipelineLibraryHandlesWithoutLayer, SameAsThePipelines)
{
    expectSame();
}

TEST_F(PipelineLibraryHandles, SameAsThePipelines)
{
    expectSame();
}

} // namespace
