// SPDX-License-Identifier: Apache-2.0
// Random scenes traced by every plan that a conformance case can name.
#include "check/case/lossy.h"
#include "check/case/trace.h"
#include "check/groups/random_case.h"
#include "compare_scenes.h"

namespace
{

using namespace vellum::check::oracle;
using Plan = vellum::check::TracePlan;
using vellum::check::missingFor;
using vellum::check::PlannedTracer;

// The rays have few different flags where these are constants of pipelines.
Scene sceneFor(const vt::Gpu &gpu, const Plan &plan, Random &random)
{
    constexpr std::array kFew{vt::kRayNoOpaque, vt::kRayForceTwoState, vt::kRayCullOpaque | vt::kRayForceTwoState};
    const bool queries = plan.method == Plan::Method::Query;
    const bool without = queries ? !vellum::check::consumesMicromaps(plan) : plan.withoutMicromaps;
    Scene scene = vellum::check::makeScene(
        random, {.micromaps = !without, .maxLevel = 4, .rays = 300, .lossy = gpu.khr()}, vellum::check::limitsOf(gpu));
    for (size_t i = 0; plan.flags != Plan::Flags::RunTime && i < scene.rays.size(); ++i)
        scene.rays[i].flags = without ? kFew[i % 3] & ~vt::kRayForceTwoState : kFew[i % 3];
    return scene;
}

class Plans : public vt::GpuTest
{
protected:
    // With VK_KHR_maintenance5 and mesh shaders.
    Plans() : GpuTest({.oldValidation = false, .newer = true, .addressCommands = true}) {}

    void expectNoFault(const Plan &plan, const std::string &name)
    {
        if (const auto missing = missingFor(gpu(), plan)) {
            std::printf("%s: %s\n", name.c_str(), missing->c_str());
            return;
        }
        PlannedTracer tracer(gpu(), plan);
        Random random(setting("VELLUM_ORACLE_SEED", 20261122));
        uint64_t rays = 0;
        const uint32_t scenes = setting("VELLUM_ORACLE_SCENES", 2);
        for (uint32_t s = 0; s < scenes; ++s) {
            const Scene scene = sceneFor(gpu(), plan, random);
            const Built built = build(gpu(), scene);
            const vellum::check::Case whole{.scene = scene};
            std::vector<Hits> hits = allHits(scene);
            hits = allHits(scene, vellum::check::lossyStatesOfTwin(gpu(), whole, scene, hits).states);
            vt::Blas beside(gpu());
            beside.prepare(geometriesOf(scene.objects[0], built.micromaps), structureFlags(gpu()));
            const auto record = [&](VkCommandBuffer commands) { beside.record(commands); };
            const std::vector<std::string> faults = tracer.faults(
                *built.scene, scene, hits, plan.besideBuild ? PlannedTracer::Record(record) : PlannedTracer::Record{});
            ASSERT_EQ(faults.size(), scene.rays.size());
            for (size_t i = 0; i < faults.size(); ++i)
                EXPECT_EQ(faults[i], "") << name << ", scene " << s << " ray " << i;
            rays +=
                static_cast<uint64_t>(std::count_if(hits.begin(), hits.end(), [](const Hits &h) { return !h.unsure; }));
        }
        EXPECT_GT(rays, 250u * scenes) << name;
    }
};

constexpr std::array kFlags{Plan::Flags::RunTime, Plan::Flags::Specialized, Plan::Flags::Literal,
                            Plan::Flags::Selected};
constexpr std::array kModes{
    Plan::Mode::True,         Plan::Mode::False,        Plan::Mode::SpecializedTrue, Plan::Mode::SpecializedFalse,
    Plan::Mode::ComputedTrue, Plan::Mode::ComputedFalse};

TEST_F(Plans, QueriesInEveryStage)
{
    uint32_t n = 0;
    for (const VkShaderStageFlagBits stage : vellum::check::kQueryStages) {
        for (const Plan::Flags flags : kFlags) {
            ++n;
            expectNoFault({.stage = stage,
                           .flags = flags,
                           .byAddress = (n + n / 4) % 2 == 0,
                           .inlineModules = n % 3 == 0,
                           .besideBuild = n % 5 == 0},
                          "stage " + std::to_string(stage) + " flags " + std::to_string(static_cast<int>(flags)));
        }
    }
}

TEST_F(Plans, QueriesWithEveryMode)
{
    for (const VkShaderStageFlagBits stage : {VK_SHADER_STAGE_COMPUTE_BIT, VK_SHADER_STAGE_FRAGMENT_BIT,
                                              VK_SHADER_STAGE_RAYGEN_BIT_KHR, VK_SHADER_STAGE_ANY_HIT_BIT_KHR}) {
        for (const Plan::Mode mode : kModes)
            expectNoFault({.stage = stage, .flags = kFlags[uint32_t{stage} % 3], .mode = mode},
                          "stage " + std::to_string(stage) + " mode " + std::to_string(static_cast<int>(mode)));
    }
}

TEST_F(Plans, Pipelines)
{
    constexpr auto kPipeline = Plan::Method::Pipeline;
    using From = Plan::From;
    // Groups of the pipeline name stages of libraries, one of which links another.
    const std::vector<vellum::check::PipelinePart> parts{
        {{3, 2, 9}, {2, 3}}, {{5, 1, 4, 7, 6, 8}, {4, 6, 7, 10, 12}, {0}}, {{0}, {0, 1, 5, 8, 9, 11, 13}, {1}}};
    const vellum::check::PipelinePlan linked{.parts = parts};
    const std::vector<Plan> plans{
        {.method = kPipeline},
        {.method = kPipeline, .flags = Plan::Flags::Specialized, .byAddress = true},
        {.method = kPipeline, .flags = Plan::Flags::Literal, .inlineModules = true},
        {.method = kPipeline, .flags = Plan::Flags::Selected, .from = From::Miss},
        {.method = kPipeline, .flags = Plan::Flags::Mixed},
        {.method = kPipeline, .flags = Plan::Flags::Computed},
        {.method = kPipeline, .pipeline = linked},
        {.method = kPipeline, .inlineModules = true, .pipeline = linked, .dynamicStackSize = true},
        {.method = kPipeline, .byAddress = true, .pipeline = linked, .flags2 = true},
        {.method = kPipeline, .besideBuild = true, .dynamicStackSize = true},
        {.method = kPipeline, .from = From::ClosestHit},
        {.method = kPipeline, .flags = Plan::Flags::Literal, .byAddress = true, .from = From::Miss, .flags2 = true},
        {.method = kPipeline, .withoutMicromaps = true},
        {.method = kPipeline, .pipeline = linked, .withoutMicromaps = true},
        {.method = kPipeline, .pipeline = linked, .otherPipelines = {{}}, .firstDestroyed = true},
    };
    for (size_t i = 0; i < plans.size(); ++i)
        expectNoFault(plans[i], "plan " + std::to_string(i));
}

} // namespace
