// SPDX-License-Identifier: Apache-2.0
// Cases that fail by a made-up rule: what stays must be what the rule needs.
#include "check/case/shrink/shrink.h"

#include <algorithm>
#include <gtest/gtest.h>

#include "check/case/case.h"
#include "check/oracle/cpu_trace.h"
#include "random_case.h"

namespace
{

using namespace vellum::check;
using Kind = Step::Kind;
using Fails = std::function<bool(const Case &)>;

constexpr ShrinkLimits kPlenty{.seconds = 100, .runs = 20000};

bool anyMesh(const Case &c, const std::function<bool(const oracle::Mesh &)> &is)
{
    return std::ranges::any_of(c.scene.objects,
                               [&](const oracle::Object &object) { return std::ranges::any_of(object.meshes, is); });
}

// Uses a 2-state triangle of level 3 or above by 16-bit indices and a base.
bool usesFineTwoStates(const Case &c)
{
    return anyMesh(c, [&](const oracle::Mesh &mesh) {
        if (!mesh.micromap || mesh.micromap->indexType != VK_INDEX_TYPE_UINT16 || mesh.micromap->base == 0 ||
            !mesh.micromap->micromap)
            return false;
        for (uint32_t t = 0; t < mesh.vertices.size() / 3; ++t) {
            const int32_t index = mesh.micromap->indexOf(t);
            if (index < 0)
                continue;
            const oracle::MicromapTriangle &triangle =
                c.scene.micromaps[*mesh.micromap->micromap]
                    .triangles[static_cast<uint32_t>(index) + mesh.micromap->base];
            if (triangle.format == kTwoState && triangle.level >= 3)
                return true;
        }
        return false;
    });
}

// An object of two meshes is updated after it was compacted.
bool updatesCompacted(const Case &c)
{
    for (size_t i = 0; i < c.steps.size(); ++i)
        for (size_t k = i + 1; k < c.steps.size(); ++k)
            if (c.steps[i].kind == Kind::CompactObject && c.steps[k].kind == Kind::UpdateObject &&
                c.steps[i].target == c.steps[k].target && c.scene.objects[c.steps[i].target].meshes.size() >= 2)
                return true;
    return false;
}

// A special index in an instance that disables micromaps, read with a stride.
bool disablesSpecialIndex(const Case &c)
{
    return std::ranges::any_of(c.scene.instances, [&](const oracle::Instance &instance) {
        return (instance.flags & kFlagDisable) != 0 &&
               std::ranges::any_of(c.scene.objects[instance.object].meshes, [](const oracle::Mesh &mesh) {
                   return mesh.micromap && mesh.micromap->stride.value_or(0) > 4 &&
                          std::ranges::find(mesh.micromap->indices, -2) != mesh.micromap->indices.end();
               });
    });
}

// A ray meets an opaque micro-triangle of a mesh that is not opaque.
bool meetsOpaqueMicroTriangle(const Case &c)
{
    const oracle::Scene scene = sceneAfter(c);
    return std::ranges::any_of(scene.rays, [&](const Ray &ray) {
        const oracle::Hits hits = oracle::allHits(scene, ray);
        return !hits.unsure && std::ranges::any_of(hits.hits, [&](const oracle::Hit &hit) {
            const oracle::Instance &instance = scene.instances[hit.instance];
            const oracle::Mesh &mesh = scene.objects[instance.object].meshes[hit.geometry];
            return ray.flags == 0 && instance.flags == 0 && !hit.box && mesh.micromap && !mesh.opaque &&
                   mesh.micromap->indexOf(hit.primitive) >= 0 && hit.opacity == oracle::Opacity::Opaque;
        });
    });
}

// Micro-triangle 37 of some triangle is unknown between others that are opaque.
bool hasUnknownBetween(const Case &c)
{
    return std::ranges::any_of(c.scene.micromaps, [](const oracle::SceneMicromap &micromap) {
        return std::ranges::any_of(micromap.triangles, [](const oracle::MicromapTriangle &triangle) {
            return triangle.states.size() >= 64 && triangle.states[37] == 3 && triangle.states[12] == 1;
        });
    });
}

// The number of elements of each kind in a case.
struct Size {
    size_t rays, instances, objects, meshes, triangles, micromaps, micromapTriangles, states, steps;
    bool operator==(const Size &) const = default;
};

void PrintTo(const Size &s, std::ostream *out)
{
    *out << s.rays << " rays, " << s.instances << " instances, " << s.objects << " objects, " << s.meshes << " meshes, "
         << s.triangles << " triangles, " << s.micromaps << " micromaps, " << s.micromapTriangles
         << " micromap triangles, " << s.states << " states, " << s.steps << " steps";
}

Size sizeOf(const Case &c)
{
    Size size{
        c.scene.rays.size(), c.scene.instances.size(), c.scene.objects.size(), 0, 0, c.scene.micromaps.size(), 0, 0,
        c.steps.size()};
    for (const oracle::Object &object : c.scene.objects)
        for (const oracle::Mesh &mesh : object.meshes) {
            ++size.meshes;
            size.triangles += mesh.vertices.size() / 3 + mesh.boxes.size();
        }
    for (const oracle::SceneMicromap &micromap : c.scene.micromaps)
        for (const oracle::MicromapTriangle &triangle : micromap.triangles) {
            ++size.micromapTriangles;
            size.states += triangle.states.size();
        }
    return size;
}

// True if nothing but the default flags, forms of usage counts and data layouts is used.
bool isBuiltOrdinarily(const Case &c)
{
    return c.scene.topFlags == 0 && !c.build.mixed && !c.build.together && !c.build.sharedInputs &&
           !c.build.aliasedInputs && !c.build.lateInputs && !c.build.rerecorded && !c.build.secondDevice &&
           std::ranges::none_of(c.scene.objects, [](const oracle::Object &object) { return object.flags != 0; }) &&
           std::ranges::none_of(c.scene.micromaps,
                                [](const auto &micromap) { return micromap.usage != 0 || micromap.layout != 0; }) &&
           !anyMesh(c,
                    [](const oracle::Mesh &mesh) {
                        return mesh.micromap && (mesh.micromap->usage != 0 || mesh.micromap->usagePointers);
                    }) &&
           std::ranges::none_of(c.steps, [](const Step &step) { return step.outOfPlace || step.exact; });
}

// True if two results of a pool are read with a gap between them, one of them of an object.
bool readsWithGaps(const Case &c)
{
    return std::ranges::any_of(c.queries, [](const QueryPlan &plan) {
        const auto of = [&](const auto &is) { return std::ranges::any_of(plan.commands, is); };
        return of([](const QueryCommand &command) {
                   return command.kind == QueryCommand::Kind::Read && command.count >= 2 && command.padding > 0;
               }) &&
               of([](const QueryCommand &command) {
                   return command.kind == QueryCommand::Kind::Write &&
                          std::ranges::find(command.targets, QueryTarget::Of::Object, &QueryTarget::of) !=
                              command.targets.end();
               });
    });
}

struct Planted {
    const char *name;
    Fails fails;
    Size smallest;
};

class Shrinking : public testing::TestWithParam<Planted>
{
protected:
    // The first random cases that fail.
    static std::vector<Case> failing(const Fails &fails, size_t count)
    {
        std::vector<Case> cases;
        for (uint32_t seed = 1000; cases.size() < count && seed < 40000; ++seed)
            if (Case c = randomCase(seed); fails(c))
                cases.push_back(std::move(c));
        EXPECT_EQ(cases.size(), count);
        return cases;
    }
};

TEST_P(Shrinking, LeavesWhatTheFailureNeeds)
{
    std::vector<uint32_t> runs;
    size_t longest = 0;
    for (const Case &c : failing(GetParam().fails, 20)) {
        uint32_t calls = 0;
        const Shrunk shrunk = shrink(
            c,
            [&](const Case &candidate) {
                ++calls;
                EXPECT_EQ(invalid(candidate), "");
                return GetParam().fails(candidate);
            },
            kPlenty);
        EXPECT_TRUE(GetParam().fails(shrunk.smallest));
        EXPECT_TRUE(shrunk.complete);
        EXPECT_EQ(shrunk.runs, calls);
        EXPECT_EQ(shrunk.failures, 3u);
        EXPECT_EQ(sizeOf(shrunk.smallest), GetParam().smallest) << toJson(shrunk.smallest);
        // Everything that the rules do not mention is reduced to its simplest value.
        EXPECT_EQ(shrunk.smallest.memory, Memory::Apart);
        EXPECT_EQ(shrunk.smallest.build.threads, 1u);
        EXPECT_EQ(shrunk.smallest.trace.method, TracePlan::Method::Query);
        EXPECT_TRUE(shrunk.smallest.queries.empty());
        EXPECT_TRUE(isBuiltOrdinarily(shrunk.smallest)) << toJson(shrunk.smallest);
        EXPECT_EQ(shrunk.smallest.scene.instances[0].customIndex, 0u);
        EXPECT_EQ(shrunk.smallest.scene.rays[0].flags, 0u);
        EXPECT_EQ(toJson(shrunk.smallest).find("layout"), std::string::npos) << toJson(shrunk.smallest);
        runs.push_back(shrunk.runs);
        longest = std::max(longest, toJson(shrunk.smallest).size());
    }
    std::ranges::sort(runs);
    std::printf("runs: median %u, at most %u; JSON of at most %zu bytes\n", runs[runs.size() / 2], runs.back(),
                longest);
}

const Planted kPlanted[] = {
    {"FineTwoStates", usesFineTwoStates, {1, 1, 1, 1, 1, 1, 2, 65, 0}},
    {"UpdatesCompacted", updatesCompacted, {1, 1, 1, 2, 0, 0, 0, 0, 2}},
    {"DisablesSpecialIndex", disablesSpecialIndex, {1, 1, 1, 1, 1, 0, 0, 0, 0}},
    {"MeetsOpaqueMicroTriangle", meetsOpaqueMicroTriangle, {1, 1, 1, 1, 1, 1, 1, 1, 0}},
    {"HasUnknownBetween", hasUnknownBetween, {1, 1, 1, 1, 0, 1, 1, 64, 0}},
};

INSTANTIATE_TEST_SUITE_P(, Shrinking, testing::ValuesIn(kPlanted),
                         [](const auto &planted) { return std::string(planted.param.name); });

TEST(ShrinkingQueries, LeavesTheCommandsThatAreNeeded)
{
    uint32_t found = 0;
    for (uint32_t seed = 0; found < 10; ++seed) {
        const Case c = randomCase(seed, 3);
        if (!readsWithGaps(c))
            continue;
        ++found;
        const Case smallest = shrink(c, readsWithGaps, kPlenty).smallest;
        ASSERT_EQ(smallest.queries.size(), 1u);
        const QueryPlan &plan = smallest.queries[0];
        EXPECT_LE(plan.count, 3u); // those that are read, and one that is written
        EXPECT_EQ(plan.commands.size(), 3u) << toJson(smallest);
        for (const QueryCommand &command : plan.commands) {
            EXPECT_TRUE(command.kind != QueryCommand::Kind::ResetOnHost && !command.wide && !command.availability &&
                        !command.wait && !command.partial)
                << toJson(smallest);
        }
    }
}

// A region of several writes three bytes or more, and its range has more.
bool copiesToALargerRange(const Case &c)
{
    return std::ranges::any_of(c.addressCopies.commands, [](const AddressCommand &command) {
        return command.kind == AddressCommand::Kind::Copy && command.regions.size() >= 2 &&
               std::ranges::any_of(command.regions,
                                   [](const AddressRegion &region) { return region.size >= 3 && region.spare > 0; });
    });
}

TEST(ShrinkingAddressCopies, LeavesTheRegionsThatAreNeeded)
{
    uint32_t found = 0;
    for (uint32_t seed = 0; found < 10; ++seed) {
        const Case c = randomCase(seed, 3);
        if (!copiesToALargerRange(c))
            continue;
        ++found;
        const AddressPlan plan = shrink(c, copiesToALargerRange, kPlenty).smallest.addressCopies;
        ASSERT_EQ(plan.commands.size(), 1u);
        EXPECT_EQ(plan.width, 1u);
        EXPECT_FALSE(plan.optimal || plan.commands[0].fullyBound);
        const std::vector<AddressRegion> &regions = plan.commands[0].regions;
        ASSERT_EQ(regions.size(), 2u);
        EXPECT_EQ(regions[0].size + regions[1].size, 3u);
        EXPECT_EQ(regions[0].spare + regions[1].spare, 1u);
        uint32_t bytes = 0;
        for (const uint32_t size : plan.buffers)
            bytes += size;
        EXPECT_LE(bytes, 12u);
    }
}

// Only the part of a mesh's memory layout that the failure needs stays.
TEST(ShrinkingLayouts, LeavesWhatTheFailureNeeds)
{
    const struct {
        std::function<bool(const oracle::MeshLayout &)> is;
        const char *layout;
    } planted[] = {
        {[](const auto &layout) { return layout.indexType == VK_INDEX_TYPE_UINT16; },
         R"("layout": {"indexType": "VK_INDEX_TYPE_UINT16"})"},
        {[](const auto &layout) { return layout.vertexFormat == VK_FORMAT_R16G16B16A16_SNORM; },
         R"("layout": {"vertexFormat": "VK_FORMAT_R16G16B16A16_SNORM"})"},
        {[](const auto &layout) { return layout.transform.has_value(); },
         R"("layout": {"transform": {"matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]}})"},
    };
    for (const auto &[is, layout] : planted) {
        const Fails fails = [&is = is](const Case &c) {
            return anyMesh(c, [&](const oracle::Mesh &mesh) { return mesh.triangles() > 0 && is(mesh.layout); });
        };
        uint32_t seed = 0;
        while (!fails(randomCase(seed)))
            ++seed;
        const std::string text = toJson(shrink(randomCase(seed), fails, kPlenty).smallest);
        EXPECT_NE(text.find(layout), std::string::npos) << text;
    }
}

// A micro-triangle on an odd level, met by a ray, has another state than the one on the other end of the curve.
bool mirrorsOddLevels(const Case &c)
{
    const oracle::Scene scene = sceneAfter(c);
    return std::ranges::any_of(scene.rays, [&](const Ray &ray) {
        const oracle::Hits hits = oracle::allHits(scene, ray);
        const std::optional<oracle::Hit> hit = oracle::nearestTriangle(scene, ray);
        if (hits.unsure || !hit)
            return false;
        const oracle::Mesh &mesh = scene.objects[scene.instances[hit->instance].object].meshes[hit->geometry];
        const int32_t index = mesh.micromap ? mesh.micromap->indexOf(hit->primitive) : -1;
        if (index < 0)
            return false;
        const oracle::MicromapTriangle &triangle =
            scene.micromaps[*mesh.micromap->micromap].triangles[static_cast<uint32_t>(index) + mesh.micromap->base];
        double edge = 1;
        const uint32_t number = oracle::microTriangleAt(hit->u, hit->v, triangle.level, edge);
        return triangle.level % 2 == 1 &&
               triangle.states[number] != triangle.states[triangle.states.size() - 1 - number];
    });
}

// A failure that occurs at the lowest level is reduced to it, whether or not it occurs at the levels between.
TEST(ShrinkingLevels, FindTheLowest)
{
    uint32_t found = 0;
    for (uint32_t seed = 1000; found < 20 && seed < 3000; ++seed) {
        const Case c = randomCase(seed);
        if (!mirrorsOddLevels(c))
            continue;
        ++found;
        const Case smallest = shrink(c, mirrorsOddLevels, kPlenty).smallest;
        ASSERT_EQ(smallest.scene.micromaps.size(), 1u);
        for (const oracle::MicromapTriangle &triangle : smallest.scene.micromaps[0].triangles)
            EXPECT_EQ(triangle.level, 1u) << seed << "\n" << toJson(smallest);
    }
    EXPECT_EQ(found, 20u);
}

// Large scenes become as large as the failure needs, or nearly, in few runs, and their files stay short.
TEST(ShrinkingScale, KeepsTheNumbersThatMatter)
{
    Case c = randomCase(1000);
    const oracle::Mesh mesh{.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}};
    c.steps.clear();
    c.trace = {};
    c.scene.objects = {{.meshes = std::vector<oracle::Mesh>(1200, mesh)}};
    c.scene.objects[0].meshes[1190].opaque = true;
    for (oracle::Instance &instance : c.scene.instances)
        instance.object = 0;
    const auto fails = [](uint32_t first) {
        return [first](const Case &candidate) {
            const auto &meshes = candidate.scene.objects[0].meshes;
            return std::ranges::any_of(meshes.begin() + std::min<ptrdiff_t>(first, std::ssize(meshes)), meshes.end(),
                                       [](const oracle::Mesh &m) { return m.opaque; });
        };
    };
    const Shrunk few = shrink(c, fails(256), kPlenty);
    EXPECT_EQ(few.smallest.scene.objects[0].meshes.size(), 257u);
    const Shrunk many = shrink(c, fails(1100), kPlenty);
    EXPECT_LT(many.smallest.scene.objects[0].meshes.size(), 1200u);
    EXPECT_GE(many.smallest.scene.objects[0].meshes.size(), 1101u);
    EXPECT_LT(many.runs, 2500u);
    EXPECT_LT(toJson(many.smallest).size(), 2000u);
}

Case failingCase()
{
    for (uint32_t seed = 0;; ++seed)
        if (Case c = randomCase(seed); usesFineTwoStates(c))
            return c;
}

TEST(ShrinkingLimits, BeginsWithTheWrongRay)
{
    Case c = failingCase();
    c.scene.rays[17].tMax = 123;
    std::vector<size_t> rays;
    (void)shrink(c,
                 [&](const Case &candidate) {
                     rays.push_back(candidate.scene.rays.size());
                     return std::ranges::any_of(candidate.scene.rays, [](const Ray &ray) { return ray.tMax == 123; });
                 },
                 {.seconds = 100, .runs = 10, .ray = 17});
    EXPECT_EQ(rays.at(0), 1u);
}

TEST(ShrinkingLimits, EndsAfterItsRuns)
{
    uint32_t calls = 0;
    const Shrunk shrunk = shrink(failingCase(),
                                 [&](const Case &candidate) {
                                     ++calls;
                                     return usesFineTwoStates(candidate);
                                 },
                                 {.seconds = 100, .runs = 20});
    EXPECT_EQ(calls, 20u + shrunk.confirmations);
    EXPECT_FALSE(shrunk.complete);
    EXPECT_TRUE(usesFineTwoStates(shrunk.smallest));
    const Shrunk none = shrink(failingCase(), usesFineTwoStates, {.seconds = 0, .runs = 20});
    EXPECT_EQ(toJson(none.smallest), toJson(failingCase()));
}

// A case that fails always, if it has several instances, and else every third time.
TEST(ShrinkingLimits, GoesBackToACaseThatFailsAlways)
{
    Case c = failingCase();
    c.scene.instances.resize(6, c.scene.instances[0]);
    uint32_t calls = 0;
    const Shrunk shrunk = shrink(
        c,
        [&](const Case &candidate) {
            return usesFineTwoStates(candidate) && (candidate.scene.instances.size() >= 2 || ++calls % 3 == 0);
        },
        kPlenty);
    EXPECT_EQ(shrunk.failures, 3u);
    EXPECT_GE(shrunk.smallest.scene.instances.size(), 2u);
    EXPECT_LT(shrunk.smallest.scene.rays.size(), c.scene.rays.size());
}

// A case that fails in some runs only: shrinking reports in how many.
TEST(ShrinkingLimits, ReportsHowOftenACaseFails)
{
    uint32_t calls = 0;
    const Shrunk shrunk = shrink(
        failingCase(), [&](const Case &candidate) { return usesFineTwoStates(candidate) && ++calls % 3 != 0; },
        kPlenty);
    EXPECT_EQ(shrunk.confirmations, 3u);
    EXPECT_EQ(shrunk.failures, 2u);
    EXPECT_TRUE(usesFineTwoStates(shrunk.smallest));
}

// Runs that follow the attempts count as well: a slow device's cases would take longer than a hang may.
TEST(Shrink, TakesNoMoreTimeOnSlowDevices)
{
    EXPECT_GT(secondsForAttempts(20, 0.05), 19);
    EXPECT_LE(secondsForAttempts(20, 2) + 6 * 2, 20);
    EXPECT_LE(secondsForAttempts(20, 5), 0);
    EXPECT_LE(secondsForAttempts(0, 0), 0); // vellum check --replay
}

} // namespace
