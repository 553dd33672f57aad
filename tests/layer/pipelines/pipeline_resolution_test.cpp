// SPDX-License-Identifier: Apache-2.0
// The resolution of hits in ray tracing pipelines: every state, format, geometry flag, instance flag and ray flag, ray
// flags at run time, constant and specialized, hit groups with and without any-hit and closest-hit shaders.
#include <algorithm>

#include "gpu/copies.h"
#include "harness/harness.h"
#include "pipelines/pipeline_scene.h"

#include "harness/program/labels.h"
#include "shaders/pipeline_by_address.h"
#include "shaders/pipeline_constant_000.h"
#include "shaders/pipeline_constant_001.h"
#include "shaders/pipeline_constant_002.h"
#include "shaders/pipeline_constant_040.h"
#include "shaders/pipeline_constant_080.h"
#include "shaders/pipeline_constant_400.h"
#include "shaders/pipeline_constant_401.h"
#include "shaders/pipeline_constant_402.h"
#include "shaders/pipeline_constant_440.h"
#include "shaders/pipeline_constant_480.h"
#include "shaders/pipeline_in_function.h"
#include "shaders/pipeline_mixed_080.h"
#include "shaders/pipeline_mixed_401.h"
#include "shaders/pipeline_specialized.h"

namespace
{

const vt::Labels kPipelineResolutionLabels{
    {"PipelineResolution.*", "slow forcing"},
    {"PipelineResolution.PlainSceneWithoutTheBit", "unforced"}, // with the bit, intersection shaders lack hidden flags
    {"PipelineResolution.Constant*", "constants"},
    {"PipelineResolution.CopiesOfBoxes", "constants"},
    {"PipelineResolutionMaintenance5.*", "slow forcing"},
    {"PipelineResolutionNotEnabled.*", "slow"},
    {"PipelineResolutionWithoutLayer.*", "slow one_api"}};

using namespace vt;

struct Variant {
    uint32_t flags;
    std::span<const uint32_t> raygen;
};

const std::array<Variant, 10> kConstants{{{0x000, pipeline_constant_000},
                                          {0x001, pipeline_constant_001},
                                          {0x002, pipeline_constant_002},
                                          {0x040, pipeline_constant_040},
                                          {0x080, pipeline_constant_080},
                                          {0x400, pipeline_constant_400},
                                          {0x401, pipeline_constant_401},
                                          {0x402, pipeline_constant_402},
                                          {0x440, pipeline_constant_440},
                                          {0x480, pipeline_constant_480}}};

class PipelineResolution : public PipelineSceneTest
{
protected:
    explicit PipelineResolution(const Options &options = {.shared = true}) : PipelineSceneTest(options) {}
};

// Checks on the driver alone what the tests expect of cases that Vellum does not change.
class PipelineResolutionWithoutLayer : public PipelineResolution
{
protected:
    PipelineResolutionWithoutLayer() : PipelineResolution({.vellum = false, .validation = false, .micromaps = false}) {}
};

TEST_F(PipelineResolution, RayFlagsAtRunTime)
{
    PipelineTracer tracer(gpu());
    EXPECT_GT(gpu().intersectionWarnings(), 0u); // once for a shader
    for (const uint32_t flags : allRayFlags())
        scene_->expect(tracer, flags);
}

TEST_F(PipelineResolution, ConstantRayFlags)
{
    const size_t warnings = gpu().intersectionWarnings();
    for (const Variant &variant : kConstants) {
        PipelineTracer tracer(gpu(), {.raygen = variant.raygen});
        scene_->expect(tracer, variant.flags, {.runTimeFlags = 0x40, .constantFlags = constantRayFlags()});
    }
    EXPECT_TRUE(!constantRayFlags() || gpu().intersectionWarnings() == warnings);
}

TEST_F(PipelineResolution, SpecializedRayFlags)
{
    for (const uint32_t flags : opacityRayFlags()) {
        PipelineTracer tracer(gpu(), {.raygen = pipeline_specialized, .specializedFlags = flags});
        scene_->expect(tracer, flags, {.runTimeFlags = 0x80});
    }
}

TEST_F(PipelineResolution, ConstantAndRunTimeFlagsInOneModule)
{
    PipelineTracer first(gpu(), {.raygen = pipeline_mixed_080});
    PipelineTracer second(gpu(), {.raygen = pipeline_mixed_401});
    for (const uint32_t flags : allRayFlags()) {
        scene_->expect(first, flags);
        scene_->expect(second, flags);
    }
}

TEST_F(PipelineResolution, RaysTracedInAFunction)
{
    PipelineTracer tracer(gpu(), {.raygen = pipeline_in_function});
    for (const uint32_t flags : allRayFlags())
        scene_->expect(tracer, flags);
}

// A module with capabilities and an extension more, as compilers other than glslang write them for these ray flags.
std::vector<uint32_t> declaring(std::span<const uint32_t> words)
{
    constexpr uint32_t opCapability = 17, opExtension = 10;
    constexpr uint32_t opacityMicromap = 5381, primitiveCulling = 4478;
    const std::string_view name = "SPV_EXT_opacity_micromap";
    std::vector<uint32_t> extension(1 + name.size() / 4 + 1);
    extension[0] = static_cast<uint32_t>(extension.size()) << 16 | opExtension;
    std::memcpy(extension.data() + 1, name.data(), name.size());
    std::vector<uint32_t> out(words.begin(), words.begin() + 5);
    for (const uint32_t capability : {opacityMicromap, primitiveCulling}) {
        out.push_back(2u << 16 | opCapability);
        out.push_back(capability);
    }
    size_t at = 5;
    while ((words[at] & 0xffffu) == opCapability) {
        out.insert(out.end(), words.begin() + static_cast<ptrdiff_t>(at),
                   words.begin() + static_cast<ptrdiff_t>(at) + 2);
        at += 2;
    }
    out.insert(out.end(), extension.begin(), extension.end());
    out.insert(out.end(), words.begin() + static_cast<ptrdiff_t>(at), words.end());
    return out;
}

// The layer removes capabilities and extensions that the driver does not know: otherwise the validation layer would
// report the module.
TEST_F(PipelineResolution, DeclaredExtensions)
{
    for (const std::span<const uint32_t> words :
         {std::span<const uint32_t>(pipeline_constant_401), std::span<const uint32_t>(pipeline_mixed_401)}) {
        const std::vector<uint32_t> more = declaring(words);
        PipelineTracer tracer(gpu(), {.raygen = more});
        scene_->expect(tracer, 0x401, {.runTimeFlags = 0x401});
        // In a pipeline without the bit they must not reach the driver either.
        PipelineTracer without(gpu(), {.raygen = more, .flags = 0});
    }
}

TEST_F(PipelineResolution, StructureByAddress)
{
    PipelineTracer tracer(gpu(), {.raygen = pipeline_by_address});
    for (const uint32_t flags : allRayFlags())
        scene_->expect(tracer, flags);
}

TEST_F(PipelineResolution, GroupsWithoutAnyHit)
{
    PipelineTracer tracer(gpu(), {.groups = {{.anyHit = false}, {.box = true, .anyHit = false}}});
    for (const uint32_t flags : allRayFlags())
        scene_->expect(tracer, flags, {.triangleAnyHit = false, .boxAnyHit = false});
}

TEST_F(PipelineResolution, OneGroupWithoutAnyHit)
{
    PipelineTracer triangles(gpu(), {.groups = {{.anyHit = false}, {.box = true}}});
    PipelineTracer boxes(gpu(), {.groups = {{}, {.box = true, .anyHit = false}}});
    for (const uint32_t flags : opacityRayFlags()) {
        scene_->expect(triangles, flags, {.triangleAnyHit = false});
        scene_->expect(boxes, flags, {.boxAnyHit = false});
    }
}

TEST_F(PipelineResolution, GroupsWithoutClosestHit)
{
    PipelineTracer tracer(gpu(), {.groups = {{.closestHit = false}, {.box = true, .closestHit = false}}});
    for (const uint32_t flags : opacityRayFlags())
        scene_->expect(tracer, flags, {.triangleClosestHit = false, .boxClosestHit = false});
}

TEST_F(PipelineResolution, GroupsWithoutShaders)
{
    PipelineTracer tracer(gpu(), {.groups = {{.anyHit = false, .closestHit = false},
                                             {.box = true, .anyHit = false, .closestHit = false}}});
    for (const uint32_t flags : allRayFlags())
        scene_->expect(
            tracer, flags,
            {.triangleAnyHit = false, .boxAnyHit = false, .triangleClosestHit = false, .boxClosestHit = false});
}

// "A zero shader group behaves as though it is a shader group consisting entirely of VK_SHADER_UNUSED_KHR."
TEST_F(PipelineResolution, ZeroRecordForTriangles)
{
    PipelineTracer tracer(gpu(), {.records = {std::nullopt, 1}});
    for (const uint32_t flags : allRayFlags())
        scene_->expect(tracer, flags, {.triangleAnyHit = false, .triangleClosestHit = false});
}

TEST_F(PipelineResolution, ZeroRecordsOnly)
{
    // Boxes have no intersection shader then: they are not met.
    PipelineTracer tracer(gpu(), {.records = {std::nullopt, std::nullopt}});
    for (const uint32_t flags : opacityRayFlags())
        scene_->expect(tracer, flags, {.triangleAnyHit = false, .triangleClosestHit = false, .skipBoxes = true});
}

TEST_F(PipelineResolution, NoHitGroupInThePipeline)
{
    PipelineTracer tracer(gpu(), {.groups = {}, .records = {std::nullopt, std::nullopt}});
    for (const uint32_t flags : opacityRayFlags())
        scene_->expect(tracer, flags,
                       {.triangleAnyHit = false, .triangleClosestHit = false, .skipBoxes = true, .missFlags = false});
}

TEST_F(PipelineResolution, ZeroMissRecord)
{
    PipelineTracer tracer(gpu(), {.missRecord = false});
    for (const uint32_t flags : opacityRayFlags())
        scene_->expect(tracer, flags, {.miss = false});
}

// VK_KHR_maintenance5 brings both; 1.3.239 of the validation layer knows neither.
class PipelineResolutionMaintenance5 : public PipelineResolution
{
protected:
    PipelineResolutionMaintenance5() : PipelineResolution({.oldValidation = false, .newer = true}) {}
    void SetUp() override
    {
        PipelineResolution::SetUp();
        if (!gpu().has("VK_KHR_maintenance5"))
            GTEST_SKIP() << "no VK_KHR_maintenance5";
    }
};

TEST_F(PipelineResolutionMaintenance5, FlagsInTheChain)
{
    PipelineTracer tracer(gpu(), {.flags2 = true});
    PipelineTracer without(gpu(), {.groups = {{.anyHit = false}, {.box = true}}, .flags2 = true});
    for (const uint32_t flags : opacityRayFlags()) {
        scene_->expect(tracer, flags);
        scene_->expect(without, flags, {.triangleAnyHit = false});
    }
}

// "flags from that structure is used instead of pname:flags from this structure."
TEST_F(PipelineResolutionMaintenance5, FlagsInTheChainReplaceTheOthers)
{
    gpu().breaks("WARNING-VkPipelineCreateFlags2-flags1-zero");
    const PipelineScene plain(gpu(), {.micromaps = false});
    for (const bool micromaps : {true, false}) {
        PipelineTracer tracer(
            gpu(),
            {.flags = micromaps ? kMicromapBit : 0, .flags2 = true, .make = [&](Device &g, const PipelineSetup &setup) {
                 PipelineInfo info(g, setup);
                 info.get().flags = micromaps ? 0 : kMicromapBit;
                 VkPipeline pipeline = VK_NULL_HANDLE;
                 VT_CHECK(g.vk().CreateRayTracingPipelinesKHR(g.device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1,
                                                              &info.get(), nullptr, &pipeline));
                 return MadePipeline{RayPipeline(g, pipeline), {}};
             }});
        for (const uint32_t flags : opacityRayFlags(micromaps))
            (micromaps ? *scene_ : plain).expect(tracer, flags);
    }
}

// VK_ARM_pipeline_opacity_micromap: the promise that there are no micromaps stays in the layer (the spy).
TEST_F(PipelineResolutionMaintenance5, PromiseOfNoMicromaps)
{
    // The extension is not enabled. The micromap flags are set as well, once in the chain and once not.
    gpu().breaks("VUID-VkPipelineCreateFlags2CreateInfo-flags-parameter");
    gpu().breaks("VUID-VkRayTracingPipelineCreateInfoKHR-flags-10392");
    gpu().breaks("WARNING-VkPipelineCreateFlags2-flags-appending");
    const PipelineScene plain(gpu(), {.micromaps = false});
    for (const VkFlags64 bit : {VkFlags64{0}, VkFlags64{kMicromapBit}}) {
        const auto promise = vkInit<VkPipelineCreateFlags2CreateInfoKHR>(
            {.flags = bit | VK_PIPELINE_CREATE_2_DISALLOW_OPACITY_MICROMAP_BIT_ARM});
        PipelineTracer tracer(gpu(), {.make = [&](Device &g, const PipelineSetup &setup) {
                                  PipelineInfo info(g, setup);
                                  info.get().pNext = &promise;
                                  VkPipeline pipeline = VK_NULL_HANDLE;
                                  VT_CHECK(g.vk().CreateRayTracingPipelinesKHR(
                                      g.device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info.get(), nullptr, &pipeline));
                                  return MadePipeline{RayPipeline(g, pipeline), {}};
                              }});
        for (const uint32_t flags : opacityRayFlags(false))
            plain.expect(tracer, flags);
    }
}

TEST_F(PipelineResolutionMaintenance5, InlineModules)
{
    PipelineTracer tracer(gpu(), {.inlineModules = true});
    PipelineTracer without(gpu(), {.groups = {{.anyHit = false}, {.box = true}}, .inlineModules = true});
    for (const uint32_t flags : opacityRayFlags()) {
        scene_->expect(tracer, flags);
        scene_->expect(without, flags, {.triangleAnyHit = false});
    }
}

TEST_F(PipelineResolution, PipelineFlags)
{
    struct Case {
        VkPipelineCreateFlags flags;
        PipelineScene::View view;
    };
    const std::array<Case, 6> cases{{
        {VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_ANY_HIT_SHADERS_BIT_KHR, {}},
        {VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_CLOSEST_HIT_SHADERS_BIT_KHR, {}},
        {VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_MISS_SHADERS_BIT_KHR |
             VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_INTERSECTION_SHADERS_BIT_KHR,
         {}},
        {VK_PIPELINE_CREATE_RAY_TRACING_SKIP_TRIANGLES_BIT_KHR, {.skipTriangles = true}},
        {VK_PIPELINE_CREATE_RAY_TRACING_SKIP_AABBS_BIT_KHR, {.skipBoxes = true}},
        {VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_ANY_HIT_SHADERS_BIT_KHR |
             VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_CLOSEST_HIT_SHADERS_BIT_KHR |
             VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_MISS_SHADERS_BIT_KHR |
             VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_INTERSECTION_SHADERS_BIT_KHR |
             VK_PIPELINE_CREATE_RAY_TRACING_SKIP_AABBS_BIT_KHR,
         {.skipBoxes = true}},
    }};
    for (const Case &c : cases) {
        SCOPED_TRACE(testing::Message() << "pipeline flags 0x" << std::hex << c.flags);
        PipelineTracer tracer(gpu(), {.flags = kMicromapBit | c.flags});
        for (const uint32_t flags : opacityRayFlags())
            scene_->expect(tracer, flags, c.view);
    }
}

// NO_NULL_ANY_HIT: every hit that needs an any-hit shader finds one. The layer itself turns hits on opaque geometry,
// which need none, into hits that do; their record may have none.
TEST_F(PipelineResolution, NoNullAnyHitWithOpaqueHitsOnZeroRecords)
{
    PipelineTracer tracer(gpu(),
                          {.records = {std::nullopt, 1},
                           .flags = kMicromapBit | VK_PIPELINE_CREATE_RAY_TRACING_NO_NULL_ANY_HIT_SHADERS_BIT_KHR});
    for (const uint32_t flags : {kRayOpaque, kRayCullNoOpaque, kRayOpaque | kRayForceTwoState})
        scene_->expect(tracer, flags, {.triangleAnyHit = false, .triangleClosestHit = false});
}

TEST_F(PipelineResolution, TerminateRay)
{
    PipelineTracer tracer(gpu());
    for (const uint32_t flags : opacityRayFlags()) {
        std::vector<Ray> rays = scene_->rays(flags);
        for (Ray &ray : rays)
            ray.rule = ray.rule == kAlways ? kTerminate : ray.rule;
        scene_->expect(tracer.trace(scene_->tlas(), rays, 4), flags, {.terminates = true});
    }
}

// A scene without micromaps: nothing may change, in a pipeline without the bit nor in one with it.
void expectPlain(Gpu &gpu, VkPipelineCreateFlags flags)
{
    const PipelineScene scene(gpu, {.micromaps = false});
    for (const bool anyHit : {true, false}) {
        PipelineTracer tracer(gpu, {.groups = {{.anyHit = anyHit}, {.box = true, .anyHit = anyHit}}, .flags = flags});
        for (const uint32_t rayFlags : allRayFlags(false))
            scene.expect(tracer, rayFlags,
                         {.triangleAnyHit = anyHit, .boxAnyHit = anyHit, .constantFlags = flags == 0});
    }
}

TEST_F(PipelineResolution, PlainSceneWithTheBit)
{
    expectPlain(gpu(), kMicromapBit);
}

TEST_F(PipelineResolution, PlainSceneWithoutTheBit)
{
    expectPlain(gpu(), 0);
}

// Boxes: results are the same with and without the bit, including the number of intersection shader invocations, except
// for ray flags that intersection shaders cannot see.
TEST_F(PipelineResolution, SameWithAndWithoutTheBit)
{
    // Flags that intersection shaders cannot see, and that do not skip them.
    constexpr uint32_t kHidden = kRayOpaque | kRayCullNoOpaque | kRayForceTwoState;
    const PipelineScene scene(gpu(), {.micromaps = false});
    for (const bool triangleAnyHit : {true, false}) {
        for (const bool boxAnyHit : {true, false}) {
            const std::vector<TracerGroup> groups{{.anyHit = triangleAnyHit}, {.box = true, .anyHit = boxAnyHit}};
            PipelineTracer with(gpu(), {.groups = groups, .flags = kMicromapBit});
            PipelineTracer without(gpu(), {.groups = groups, .flags = 0});
            for (const uint32_t flags : allRayFlags(false)) {
                const std::vector<PipelineResult> a = with.trace(scene.tlas(), scene.rays(flags), 4);
                const std::vector<PipelineResult> b = without.trace(scene.tlas(), scene.rays(flags), 4);
                for (size_t i = 0; i < a.size(); ++i) {
                    ASSERT_EQ(std::memcmp(static_cast<const RawResult *>(&a[i]), static_cast<const RawResult *>(&b[i]),
                                          sizeof(RawResult)),
                              0)
                        << "ray " << i << " flags " << flags;
                    const bool culls = (flags & kRayCullNoOpaque) != 0;
                    ASSERT_TRUE(culls || a[i].visitCount == b[i].visitCount) << "ray " << i << " flags " << flags;
                    ASSERT_EQ(a[i].hitKind, b[i].hitKind);
                    ASSERT_EQ(a[i].record, b[i].record);
                    ASSERT_TRUE(culls || a[i].invocations == b[i].invocations);
                    ASSERT_TRUE(std::equal(
                        a[i].candidates.begin(), a[i].candidates.end(), b[i].candidates.begin(), b[i].candidates.end(),
                        [](const Candidate &x, const Candidate &y) { return std::memcmp(&x, &y, sizeof x) == 0; }));
                    if (culls)
                        continue;
                    ASSERT_TRUE(std::equal(a[i].visits.begin(), a[i].visits.end(), b[i].visits.begin(),
                                           b[i].visits.end(), [](BoxVisit x, BoxVisit y) {
                                               x.flags &= ~kHidden;
                                               y.flags &= ~kHidden;
                                               return std::memcmp(&x, &y, sizeof x) == 0;
                                           }));
                }
            }
        }
    }
}

// A copy of boxes still knows which of them are opaque, which an intersection shader must know to skip the others.
TEST_F(PipelineResolution, CopiesOfBoxes)
{
    Geometry opaque, other;
    opaque.boxes = {{0, 0, -1, 1, 1, 1}};
    opaque.flags = VK_GEOMETRY_OPAQUE_BIT_KHR;
    other.boxes = {{2, 0, -1, 3, 1, 1}};
    const Blas source(gpu(), {opaque, other});
    Structure clone(gpu(), VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR);
    clone.create(source.size());
    copy(gpu(), source, clone);
    const auto loaded = deserialized(gpu(), serialize(gpu(), clone), VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR);
    PipelineTracer tracer(gpu(), {.raygen = pipeline_constant_080, .groups = {{.box = true}}});
    const std::vector<Ray> rays{{.origin = {0.5f, 0.5f, 5}, .flags = kRayCullNoOpaque},
                                {.origin = {2.5f, 0.5f, 5}, .flags = kRayCullNoOpaque}};
    for (const Structure *blas : std::initializer_list<const Structure *>{&source, &clone, loaded.get()}) {
        const Tlas scene(gpu(), {instance(*blas, {}, 5)});
        const std::vector<PipelineResult> results = tracer.trace(scene, rays);
        EXPECT_EQ(results[0].visitCount, 1u);
        const bool mayRun = !constantRayFlags() && intersectionMayRunCulled(kRayCullNoOpaque);
        EXPECT_LE(results[1].visitCount, mayRun ? 1u : 0u);
        EXPECT_EQ(results[1].committed, 0u);
    }
}

TEST_F(PipelineResolutionWithoutLayer, RayFlagsAtRunTime)
{
    expectPlain(gpu(), 0);
}

TEST_F(PipelineResolutionWithoutLayer, GroupsWithoutShaders)
{
    PipelineTracer tracer(gpu(), {.groups = {{.anyHit = false, .closestHit = false},
                                             {.box = true, .anyHit = false, .closestHit = false}}});
    for (const uint32_t flags : allRayFlags(false))
        scene_->expect(
            tracer, flags,
            {.triangleAnyHit = false, .boxAnyHit = false, .triangleClosestHit = false, .boxClosestHit = false});
}

TEST_F(PipelineResolutionWithoutLayer, ZeroRecordsOnly)
{
    PipelineTracer tracer(gpu(), {.records = {std::nullopt, std::nullopt}});
    for (const uint32_t flags : allRayFlags(false))
        scene_->expect(tracer, flags, {.triangleAnyHit = false, .triangleClosestHit = false, .skipBoxes = true});
}

TEST_F(PipelineResolutionWithoutLayer, NoHitGroupInThePipeline)
{
    PipelineTracer tracer(gpu(), {.groups = {}, .records = {std::nullopt, std::nullopt}});
    for (const uint32_t flags : allRayFlags(false))
        scene_->expect(tracer, flags,
                       {.triangleAnyHit = false, .triangleClosestHit = false, .skipBoxes = true, .missFlags = false});
}

TEST_F(PipelineResolutionWithoutLayer, ZeroMissRecord)
{
    PipelineTracer tracer(gpu(), {.missRecord = false});
    for (const uint32_t flags : allRayFlags(false))
        scene_->expect(tracer, flags, {.miss = false});
}

class PipelineResolutionNotEnabled : public PipelineResolution
{
protected:
    PipelineResolutionNotEnabled() : PipelineResolution({.micromaps = false}) {}
};

TEST_F(PipelineResolutionNotEnabled, RayFlagsAtRunTime)
{
    expectPlain(gpu(), 0);
}

} // namespace
