// SPDX-License-Identifier: Apache-2.0
// Groups that name stages of linked libraries, which "are treated as if they were defined as additional entries in
// pStages" (VkRayTracingPipelineCreateInfoKHR): each stage and each group of the tracer lies in the pipeline or in one
// of its libraries, which may be nested. Shaders that must not run are among them.
#include <algorithm>
#include <random>

#include "gpu/programs/pipeline_libraries.h"
#include "harness/program/labels.h"
#include "pipelines/assumed_micromaps.h"
#include "pipelines/pipeline_binaries.h"
#include "pipelines/pipeline_scene.h"
#include "shaders/pipeline_wide_any_hit.h"
#include "shaders/pipeline_wide_closest_hit.h"
#include "shaders/pipeline_wide_intersection.h"

namespace
{

const vt::Labels kLibraryStagesLabels{
    {"LibraryStages*.*", "slow"}, {"LibraryStages.*", "forcing"}, {"LibraryStagesWithoutLayer.*", "one_api"}};

using namespace vt;

// Stages and groups of the tracer's setup, and the decoys that follow them.
enum Stage : uint32_t { kRaygen, kMiss, kClosestHit, kAnyHit, kBoxes, kBoxesWithoutAnyHit, kDecoyStages };
constexpr uint32_t kDecoyGroups = 4; // after ray generation, miss, triangles, boxes

// A library, or the pipeline. The libraries of a part come before it.
struct Part {
    std::vector<uint32_t> stages;
    std::vector<uint32_t> groups;
    std::vector<size_t> libraries{};
};
using StagePlan = std::vector<Part>; // the last one is the pipeline

enum class Creation { Plain, Deferred, Cached, OfBinaries };

class LibraryStages : public PipelineSceneTest
{
protected:
    // Validation layer 1.3.239 does not count the stages of libraries in libraries.
    explicit LibraryStages(const Options &options = {.oldValidation = false, .shared = true})
        : PipelineSceneTest(options)
    {
    }
    void SetUp() override
    {
        PipelineSceneTest::SetUp();
        if (!IsSkipped() && !gpu().has(VK_KHR_PIPELINE_LIBRARY_EXTENSION_NAME))
            GTEST_SKIP() << "no pipeline libraries";
    }

    // The tracer's setup and decoys: closest-hit, any-hit and intersection shaders that write wrong attributes, in
    // groups for triangles without and with any-hit shader, and in one for boxes.
    static PipelineSetup withDecoys(const PipelineSetup &from)
    {
        PipelineSetup setup = from;
        setup.stages.push_back({VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, pipeline_wide_closest_hit});
        setup.stages.push_back({VK_SHADER_STAGE_ANY_HIT_BIT_KHR, pipeline_wide_any_hit});
        setup.stages.push_back({VK_SHADER_STAGE_INTERSECTION_BIT_KHR, pipeline_wide_intersection});
        setup.groups.push_back({.closestHit = kDecoyStages});
        setup.groups.push_back({.closestHit = kDecoyStages, .anyHit = kDecoyStages + 1});
        setup.groups.push_back(
            {.closestHit = kDecoyStages, .anyHit = kDecoyStages + 1, .intersection = kDecoyStages + 2});
        setup.attributeSize = 32;
        return setup;
    }

    // The stages that groups of a part may name, in the order of their indices.
    static std::vector<uint32_t> stagesOf(const StagePlan &plan, const Part &part)
    {
        std::vector<uint32_t> stages = part.stages;
        for (const size_t library : part.libraries) {
            const std::vector<uint32_t> more = stagesOf(plan, plan[library]);
            stages.insert(stages.end(), more.begin(), more.end());
        }
        return stages;
    }
    static std::vector<uint32_t> groupsOf(const StagePlan &plan, const Part &part)
    {
        std::vector<uint32_t> groups = part.groups;
        for (const size_t library : part.libraries) {
            const std::vector<uint32_t> more = groupsOf(plan, plan[library]);
            groups.insert(groups.end(), more.begin(), more.end());
        }
        return groups;
    }
    MadePipeline link(const PipelineSetup &from, const StagePlan &plan)
    {
        std::vector<RayPipeline> parts;
        for (const Part &part : plan) {
            PipelineSetup setup = from;
            setup.stages.clear();
            setup.groups.clear();
            for (const uint32_t stage : part.stages)
                setup.stages.push_back(from.stages[stage]);
            const std::vector<uint32_t> stages = stagesOf(plan, part);
            const auto indexOf = [&](uint32_t stage) {
                const auto found = std::ranges::find(stages, stage);
                return found == stages.end() ? kUnused : static_cast<uint32_t>(found - stages.begin());
            };
            for (const uint32_t g : part.groups) {
                const PipelineGroup &group = from.groups[g];
                setup.groups.push_back({indexOf(group.general), indexOf(group.closestHit), indexOf(group.anyHit),
                                        indexOf(group.intersection)});
            }
            for (const size_t library : part.libraries)
                setup.libraries.push_back(parts[library].handle());
            if (&part != &plan.back())
                setup.flags |= VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
            parts.emplace_back(gpu(), create(setup));
        }
        MadePipeline made{RayPipeline(std::move(parts.back())), {}};
        parts.pop_back();
        made.libraries = std::move(parts);
        const std::vector<uint32_t> groups = groupsOf(plan, plan.back());
        for (uint32_t g = 0; g < from.groups.size(); ++g)
            made.groups.push_back(static_cast<uint32_t>(std::ranges::find(groups, g) - groups.begin()));
        return made;
    }

    VkPipeline create(const PipelineSetup &setup)
    {
        PipelineInfo info(gpu(), setup);
        const Commands &vk = gpu().vk();
        VkPipeline pipeline = VK_NULL_HANDLE;
        const auto createWith = [&](VkDeferredOperationKHR operation, VkPipelineCache cache) {
            return vk.CreateRayTracingPipelinesKHR(gpu().device(), operation, cache, 1, &info.get(), nullptr,
                                                   &pipeline);
        };
        if (creation_ == Creation::Plain) {
            VT_CHECK(createWith(VK_NULL_HANDLE, VK_NULL_HANDLE));
        } else if (creation_ == Creation::Cached) {
            if (!cache_) {
                const auto empty = vkInit<VkPipelineCacheCreateInfo>();
                VT_CHECK(vkCreatePipelineCache(gpu().device(), &empty, nullptr, &cache_));
            }
            VT_CHECK(createWith(VK_NULL_HANDLE, cache_));
        } else if (creation_ == Creation::Deferred) {
            VkDeferredOperationKHR operation = VK_NULL_HANDLE;
            VT_CHECK(vk.CreateDeferredOperationKHR(gpu().device(), nullptr, &operation));
            if (createWith(operation, VK_NULL_HANDLE) == VK_OPERATION_DEFERRED_KHR) {
                EXPECT_EQ(vk.DeferredOperationJoinKHR(gpu().device(), operation), VK_SUCCESS);
            }
            EXPECT_EQ(vk.GetDeferredOperationResultKHR(gpu().device(), operation), VK_SUCCESS);
            vk.DestroyDeferredOperationKHR(gpu().device(), operation, nullptr);
        } else {
            return ofBinaries(info, setup.flags);
        }
        return pipeline;
    }

    // Created twice: from code, and without it from the binary of the first.
    VkPipeline ofBinaries(PipelineInfo &info, VkFlags64 flags)
    {
        const auto capture = vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = kCaptureData | flags});
        info.get().pNext = &capture;
        VkPipeline first = VK_NULL_HANDLE;
        VT_CHECK(gpu().vk().CreateRayTracingPipelinesKHR(gpu().device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info.get(),
                                                         nullptr, &first));
        Binaries binaries(gpu());
        const VkPipelineBinaryKHR binary = binaries.from(first);
        vkDestroyPipeline(gpu().device(), first, nullptr);
        const auto own = vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = flags});
        const OfBinary made(binary, &own);
        std::vector<VkPipelineShaderStageCreateInfo> stages(info.get().pStages,
                                                            info.get().pStages + info.get().stageCount);
        for (VkPipelineShaderStageCreateInfo &stage : stages)
            stage.module = VK_NULL_HANDLE;
        info.get().pNext = &made.info;
        info.get().pStages = stages.data();
        VkPipeline pipeline = VK_NULL_HANDLE;
        VT_CHECK(gpu().vk().CreateRayTracingPipelinesKHR(gpu().device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info.get(),
                                                         nullptr, &pipeline));
        return pipeline;
    }

    void expect(const StagePlan &plan, bool anyHit, std::span<const uint32_t> rayFlags)
    {
        PipelineTracer tracer(
            gpu(), {.groups = {{.anyHit = anyHit}, {.box = true, .anyHit = anyHit}},
                    .flags = flags_,
                    .make = [&](Device &, const PipelineSetup &from) { return link(withDecoys(from), plan); }});
        for (const uint32_t flags : rayFlags)
            scene_->expect(tracer, flags, {.triangleAnyHit = anyHit, .boxAnyHit = anyHit});
    }
    void expect(const StagePlan &plan)
    {
        const std::vector<uint32_t> flags = opacityRayFlags(gpu().options().micromaps);
        for (const bool anyHit : {true, false})
            expect(plan, anyHit, flags);
    }

    // Random plans, each with a part of the ray flags.
    void expectRandom(uint32_t plans, uint32_t seed = 1)
    {
        std::mt19937 random(seed);
        const std::vector<uint32_t> all = opacityRayFlags(gpu().options().micromaps);
        for (uint32_t i = 0; i < plans && !HasFailure(); ++i) {
            const StagePlan plan = randomPlan(random);
            SCOPED_TRACE(describe(plan));
            const std::array flags{all[i % all.size()], all[random() % all.size()]};
            expect(plan, i % 4 != 0, flags);
        }
    }

    static StagePlan randomPlan(std::mt19937 &random)
    {
        const auto below = [&random](size_t limit) { return static_cast<size_t>(random() % limit); };
        StagePlan plan(2 + below(4));
        const size_t last = plan.size() - 1;
        for (size_t i = 0; i < last; ++i)
            plan[below(2) == 0 ? last : i + 1 + below(last - i)].libraries.push_back(i);
        std::shuffle(plan[last].libraries.begin(), plan[last].libraries.end(), random);
        for (uint32_t stage = 0; stage < kDecoyStages + 3; ++stage) {
            // Bare lavapipe (Mesa 25.0.7) gives a ray generation shader of a library no push constants.
            plan[stage == kRaygen ? last : below(plan.size())].stages.push_back(stage);
            if (stage >= kDecoyStages)
                plan[below(plan.size())].stages.push_back(stage);
        }
        for (Part &part : plan) {
            if (part.stages.empty() &&
                part.libraries.empty()) // VUID-VkRayTracingPipelineCreateInfoKHR-pLibraryInfo-07999
                part.stages.push_back(kDecoyStages);
            std::shuffle(part.stages.begin(), part.stages.end(), random);
        }
        // Puts each group into a random part that has all its stages.
        const std::vector<std::vector<uint32_t>> stagesOfGroups{
            {kRaygen},
            {kMiss},
            {kClosestHit, kAnyHit},
            {kClosestHit, kAnyHit, kBoxes, kBoxesWithoutAnyHit},
            {kDecoyStages},
            {kDecoyStages, kDecoyStages + 1},
            {kDecoyStages, kDecoyStages + 1, kDecoyStages + 2},
        };
        for (uint32_t g = 0; g < stagesOfGroups.size(); ++g) {
            std::vector<Part *> having;
            for (Part &part : plan) {
                const std::vector<uint32_t> stages = stagesOf(plan, part);
                if (std::ranges::all_of(stagesOfGroups[g],
                                        [&](uint32_t stage) { return std::ranges::count(stages, stage) > 0; }))
                    having.push_back(&part);
            }
            having[below(having.size())]->groups.push_back(g);
        }
        return plan;
    }

    static std::string describe(const StagePlan &plan)
    {
        std::string text = "parts (stages; groups; libraries):";
        for (const Part &part : plan) {
            text += " [";
            for (const uint32_t stage : part.stages)
                text += std::to_string(stage) + " ";
            text += ";";
            for (const uint32_t group : part.groups)
                text += " " + std::to_string(group);
            text += ";";
            for (const size_t library : part.libraries)
                text += " " + std::to_string(library);
            text += "]";
        }
        return text;
    }

    void TearDown() override
    {
        if (cache_)
            vkDestroyPipelineCache(gpu().device(), cache_, nullptr);
        PipelineSceneTest::TearDown();
    }

    Creation creation_ = Creation::Plain;
    std::optional<VkPipelineCreateFlags> flags_; // else the micromap bit
    VkPipelineCache cache_ = VK_NULL_HANDLE;
};

const std::vector<uint32_t> kAllGroups{0, 1, 2, 3};

struct NamedPlan {
    const char *name;
    StagePlan plan;
};

const std::vector<NamedPlan> kNamedPlans{
    {"closest hit in a library",
     {{{kClosestHit}, {}}, {{kRaygen, kMiss, kAnyHit, kBoxes, kBoxesWithoutAnyHit}, kAllGroups, {0}}}},
    {"miss in a library",
     {{{kMiss}, {}}, {{kRaygen, kClosestHit, kAnyHit, kBoxes, kBoxesWithoutAnyHit}, kAllGroups, {0}}}},
    {"any-hit in a library",
     {{{kAnyHit}, {}}, {{kRaygen, kMiss, kClosestHit, kBoxes, kBoxesWithoutAnyHit}, kAllGroups, {0}}}},
    {"intersection in a library",
     {{{kBoxes, kBoxesWithoutAnyHit}, {}}, {{kRaygen, kMiss, kClosestHit, kAnyHit}, kAllGroups, {0}}}},
    {"stages of the second library, where the first has a hit group of its own",
     {{{kDecoyStages}, {kDecoyGroups}},
      {{kMiss, kClosestHit}, {}},
      {{kRaygen, kAnyHit, kBoxes, kBoxesWithoutAnyHit}, kAllGroups, {0, 1}}}},
    {"an any-hit shader that the library's group uses for boxes, and the pipeline's for triangles",
     {{{kClosestHit, kAnyHit, kBoxes, kBoxesWithoutAnyHit}, {3}}, {{kRaygen, kMiss}, {0, 1, 2}, {0}}}},
    {"an any-hit shader that the library's group uses for triangles, and the pipeline's for boxes",
     {{{kClosestHit, kAnyHit}, {2}}, {{kRaygen, kMiss, kBoxes, kBoxesWithoutAnyHit}, {0, 1, 3}, {0}}}},
    {"a library in a library",
     {{{kDecoyStages, kClosestHit}, {kDecoyGroups}},
      {{kDecoyStages, kMiss, kAnyHit}, {kDecoyGroups, 2}, {0}},
      {{kRaygen, kBoxes, kBoxesWithoutAnyHit}, {0, 1, 3}, {1}}}},
};

// Checks that driver and tests agree without the layer.
class LibraryStagesWithoutLayer : public LibraryStages
{
protected:
    LibraryStagesWithoutLayer() : LibraryStages({.vellum = false, .validation = false, .micromaps = false}) {}
};

TEST_F(LibraryStagesWithoutLayer, Cases)
{
    for (const NamedPlan &c : kNamedPlans) {
        SCOPED_TRACE(c.name);
        expect(c.plan);
    }
}

TEST_F(LibraryStagesWithoutLayer, RandomPlans)
{
    expectRandom(30);
}

TEST_F(LibraryStages, Cases)
{
    for (const NamedPlan &c : kNamedPlans) {
        SCOPED_TRACE(c.name);
        expect(c.plan);
    }
}

TEST_F(LibraryStages, RandomPlans)
{
    expectRandom(30);
}

TEST_F(LibraryStages, WithOneCache)
{
    creation_ = Creation::Cached;
    expectRandom(8, 2);
    expectRandom(8, 2); // all of it is in the cache
}

// Pipelines and libraries without the bit.
TEST_F(LibraryStages, WithoutTheBit)
{
    scene_ = std::make_unique<PipelineScene>(gpu(), PipelineScene::Config{.micromaps = false});
    flags_ = 0;
    expectRandom(10, 3);
}

class LibraryStagesDeferred : public LibraryStages
{
protected:
    LibraryStagesDeferred() : LibraryStages({.oldValidation = false, .quirks = "deferred"}) {}
};

TEST_F(LibraryStagesDeferred, RandomPlans)
{
    if (!gpu().has(VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME))
        GTEST_SKIP() << "no deferred operations";
    creation_ = Creation::Deferred;
    expectRandom(10, 4);
}

class LibraryStagesOfBinaries : public LibraryStages
{
protected:
    LibraryStagesOfBinaries() : LibraryStages({.oldValidation = false, .quirks = "caching", .newer = true}) {}
    // Where pipeline binaries exist, from which a pipeline may be created without code, the layer's any-hit shaders of
    // libraries declare no payload beyond the prefix (payloadTypes()).
    void TearDown() override
    {
        for (const Message &m : gpu().takeUnexpectedMessages()) {
            if (m.text.find("payloads of different types") == std::string::npos)
                ADD_FAILURE() << m.id << ": " << m.text;
        }
        LibraryStages::TearDown();
    }
};

TEST_F(LibraryStagesOfBinaries, RandomPlans)
{
    creation_ = Creation::OfBinaries;
    expectRandom(10, 5);
}

// Without the bit; micromaps are enabled by the setting assume_micromaps.
class LibraryStagesAssumed : public LibraryStages
{
protected:
    explicit LibraryStagesAssumed(const AssumedMicromaps & = AssumedMicromaps())
        : LibraryStages({.oldValidation = false, .newer = true})
    {
    }
};

TEST_F(LibraryStagesAssumed, RandomPlans)
{
    flags_ = 0;
    expectRandom(10, 6);
}

// The setting does not concern a library that promises to meet no micromaps, nor a pipeline that links it.
TEST_F(LibraryStagesAssumed, LibraryThatDisallowsMicromaps)
{
    if (!gpu().has("VK_KHR_maintenance5"))
        GTEST_SKIP() << "no VkPipelineCreateFlags2CreateInfo";
    const PipelineScene plain(gpu(), {.micromaps = false});
    const auto make = [&](Device &, const PipelineSetup &from) {
        const auto disallows = vkInit<VkPipelineCreateFlags2CreateInfoKHR>(
            {.flags = VK_PIPELINE_CREATE_LIBRARY_BIT_KHR | VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM});
        PipelineSetup library = partOf(from, std::array{1u, 2u, 3u});
        library.flags = VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
        PipelineInfo info(gpu(), library);
        info.get().flags = 0;
        info.get().pNext = &disallows;
        VkPipeline handle = VK_NULL_HANDLE;
        VT_CHECK(gpu().vk().CreateRayTracingPipelinesKHR(gpu().device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info.get(),
                                                         nullptr, &handle));
        std::vector<RayPipeline> libraries;
        libraries.emplace_back(gpu(), handle);
        PipelineSetup linking = partOf(from, std::array{0u});
        linking.libraries = {handle};
        return MadePipeline{RayPipeline(gpu(), linking), {}, std::move(libraries)};
    };
    PipelineTracer tracer(gpu(), {.flags = 0, .make = make});
    for (const uint32_t flags : opacityRayFlags(false))
        plain.expect(tracer, flags);
}

} // namespace
