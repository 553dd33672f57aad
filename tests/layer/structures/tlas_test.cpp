// SPDX-License-Identifier: Apache-2.0
// Top-level builds: where instances come from, updates, several structures alive at once, reused memory, custom
// indices.
#include "check/oracle/outcome.h"
#include "harness/harness.h"

#include "harness/program/labels.h"
#include "shaders/tracer_by_address.h"
#include "structures/constants.h"

namespace
{

const vt::Labels kTlasLabels{{"Top.*", "forcing"}};

using namespace vt;

// Instances stand two units apart in x; each shows one triangle.
class Top : public GpuTest
{
protected:
    Top() : GpuTest({.shared = true}) {}

    struct Shown {
        uint32_t customIndex;
        int state; // of the triangle: 0..3, or kNoMicromap
        uint32_t flags = 0;
    };

    void SetUp() override
    {
        for (uint8_t state = 0; state < 4; ++state) {
            MicromapInput input;
            input.add(3, kFourState, std::vector<uint8_t>(64, state));
            micromaps_.push_back(std::make_unique<Micromap>(gpu(), std::move(input)));
            micromaps_.back()->build();
            blas_.push_back(std::make_unique<Blas>(gpu(), std::vector{mapped(state)}));
        }
        plain_ = std::make_unique<Blas>(gpu(), std::vector{Geometry{.vertices = triangleRow(1)}});
    }

    Geometry mapped(uint32_t state)
    {
        Geometry geometry{.vertices = triangleRow(1)};
        geometry.micromap = Attachment{micromaps_[state].get()};
        return geometry;
    }

    const Blas &blasOf(int state) { return state == kNoMicromap ? *plain_ : *blas_[static_cast<size_t>(state)]; }

    std::vector<VkAccelerationStructureInstanceKHR> instances(const std::vector<Shown> &shown)
    {
        std::vector<VkAccelerationStructureInstanceKHR> out;
        for (const Shown &s : shown)
            out.push_back(
                instance(blasOf(s.state), {2.0f * static_cast<float>(out.size()), 0, 0}, s.customIndex, s.flags));
        return out;
    }

    void expectShown(const Structure &tlas, const std::vector<Shown> &shown, Tracer &tracer)
    {
        std::vector<Ray> rays(shown.size() + 1);
        for (size_t i = 0; i < rays.size(); ++i) {
            rays[i].origin = {2.0f * static_cast<float>(i) + 0.3f, 0.3f, 1};
            rays[i].rule = kAlways;
        }
        const std::vector<Result> results = tracer.trace(tlas, rays);
        for (size_t i = 0; i < shown.size(); ++i) {
            const Outcome outcome = outcomeOf(shown[i].state, false, shown[i].flags, 0);
            const bool isCandidate = outcome == Outcome::NonOpaque;
            const Result &r = results[i];
            ASSERT_EQ(r.candidateCount, isCandidate ? 1u : 0u) << "instance " << i;
            ASSERT_EQ(r.committed, isCandidate || outcome == Outcome::Opaque ? kTriangle : kNone) << "instance " << i;
            if (isCandidate) {
                EXPECT_EQ(r.candidates[0].customIndex, shown[i].customIndex) << "instance " << i;
            }
            if (r.committed == kTriangle) {
                EXPECT_EQ(r.customIndex, shown[i].customIndex) << "instance " << i;
                EXPECT_EQ(r.instance, i);
            }
        }
        EXPECT_EQ(results.back().committed, kNone) << "beyond the last instance";
    }
    void expectShown(const Structure &tlas, const std::vector<Shown> &shown)
    {
        Tracer tracer(gpu());
        expectShown(tlas, shown, tracer);
    }

    std::vector<std::unique_ptr<Micromap>> micromaps_;
    std::vector<std::unique_ptr<Blas>> blas_;
    std::unique_ptr<Blas> plain_;
};

TEST_F(Top, CustomIndices)
{
    const std::vector<Shown> shown{
        {0, 1},           {0xffffff, 1},           {0x800000, 2},           {1, 3},
        {0, kNoMicromap}, {0xffffff, kNoMicromap}, {0x123456, kNoMicromap}, {0x7fffff, 0, 0x10}};
    expectShown(Tlas(gpu(), instances(shown)), shown);
}

TEST_F(Top, OnlyPlainInstances)
{
    const std::vector<Shown> shown{{0xffffff, kNoMicromap}, {3, kNoMicromap, 4}, {0, kNoMicromap, 8}};
    expectShown(Tlas(gpu(), instances(shown)), shown);
}

// Reference 0: no ray meets the instance, which is counted nevertheless. Lavapipe 26 crashes where another one comes
// behind it, without the layer too (src/check/groups/random_case.cpp).
TEST_F(Top, InactiveInstances)
{
    const std::vector<Shown> shown{{7, 1}, {8, 2}, {9, kNoMicromap}, {10, 3}, {11, 1}};
    std::vector<std::vector<size_t>> cases{{3, 4}, {0, 1, 2, 3, 4}};
    if (!gpu().onLavapipe26())
        cases.insert(cases.end(), {{0}, {0, 1, 3}, {1, 2, 4}});
    for (const std::vector<size_t> &inactive : cases) {
        std::vector<VkAccelerationStructureInstanceKHR> all = instances(shown);
        std::vector<Shown> expected = shown;
        for (const size_t i : inactive) {
            all[i].accelerationStructureReference = 0;
            expected[i].state = 0; // transparent
        }
        expectShown(Tlas(gpu(), all), expected);
    }
}

TEST_F(Top, ByDeviceAddress)
{
    const std::vector<Shown> shown{{7, 1}, {8, 0}, {9, 2}, {10, kNoMicromap}};
    Tracer tracer(gpu(), tracer_by_address);
    expectShown(Tlas(gpu(), instances(shown)), shown, tracer);
}

TEST_F(Top, ArraysOfPointersAndOffsets)
{
    const std::vector<Shown> shown{{7, 1}, {8, 0}, {9, 2}, {10, kNoMicromap}, {11, 3, 0x10}};
    for (const Arrangement arrangement : {Arrangement::Array, Arrangement::Pointers}) {
        for (const uint32_t skipped : {0u, 2u, 6u}) { // offsets are multiples of 16, of pointers too
            SCOPED_TRACE(testing::Message()
                         << "pointers " << (arrangement == Arrangement::Pointers) << " skipped " << skipped);
            Tlas tlas(gpu());
            tlas.build(instances(shown), 0, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR, arrangement, skipped);
            expectShown(tlas, shown);
        }
    }
}

TEST_F(Top, Update)
{
    std::vector<Shown> shown{{7, 1}, {8, 0}, {9, 2}, {10, kNoMicromap}};
    Tlas tlas(gpu());
    tlas.build(instances(shown), kUpdatable);
    expectShown(tlas, shown);
    for (int round = 0; round < 3; ++round) {
        for (Shown &s : shown) {
            s.customIndex = (s.customIndex * 1000 + 1) & 0xffffff;
            s.flags = round == 0 ? 0x10u : round == 1 ? 4u : 8u;
        }
        tlas.build(instances(shown), kUpdatable, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR,
                   round == 1 ? Arrangement::Pointers : Arrangement::Array);
        expectShown(tlas, shown);
    }
}

TEST_F(Top, RebuildWithOtherInstances)
{
    Tlas tlas(gpu());
    for (const std::vector<Shown> &shown : std::vector<std::vector<Shown>>{
             {{7, 1}, {8, 0}}, {{3, kNoMicromap}}, {{1, 2}, {2, 3}, {3, 1}, {4, 0}, {5, kNoMicromap}}, {}, {{9, 1}}}) {
        tlas.build(instances(shown));
        expectShown(tlas, shown);
    }
}

TEST_F(Top, EmptyStructure)
{
    Tlas tlas(gpu());
    tlas.build({});
    expectShown(tlas, {});
}

TEST_F(Top, ManyInstances)
{
    std::vector<Shown> shown;
    for (uint32_t i = 0; i < 9001; ++i)
        shown.push_back({i * 1861 & 0xffffff, static_cast<int>(i % 5) - 1});
    Tlas tlas(gpu(), instances(shown));
    expectShown(tlas, shown);
}

// Instance records lie in pages of 65,536: of a structure that begins in one and ends in the next.
TEST_F(Top, InstancesOnTwoPages)
{
    std::vector<Shown> shown;
    for (uint32_t i = 0; i < 1200; ++i)
        shown.push_back({i * 13921 & 0xffffff, static_cast<int>(i % 5) - 1});
    for (const size_t before : {65'000u, 196'000u}) {
        const std::vector<VkAccelerationStructureInstanceKHR> others(before, instances({{1, 1}}).front());
        const Tlas filler(gpu(), others);
        const Tlas tlas(gpu(), instances(shown));
        expectShown(tlas, shown);
    }
}

TEST_F(Top, TwoAtOnceSharingBlas)
{
    const std::vector<Shown> one{{7, 1}, {8, 0}, {9, 2, 0x10}}, two{{17, 1, 8}, {18, 3}, {19, 2}, {20, 1}};
    Tlas first(gpu(), instances(one)), second(gpu(), instances(two));
    expectShown(first, one);
    expectShown(second, two);
    first.build(instances(two));
    expectShown(first, two);
    expectShown(second, two);
}

TEST_F(Top, ManyComeAndGo)
{
    // Instance slots are released.
    const std::vector<Shown> kept{{70, 1}, {80, 0}, {90, 2}};
    const Tlas stays(gpu(), instances(kept));
    for (uint32_t round = 0; round < 50; ++round) {
        std::vector<Shown> shown;
        for (uint32_t i = 0; i < 200; ++i)
            shown.push_back({round * 200 + i, static_cast<int>((i + round) % 5) - 1});
        const Tlas tlas(gpu(), instances(shown));
        if (round % 10 == 9)
            expectShown(tlas, shown);
    }
    expectShown(stays, kept);
}

TEST_F(Top, BlasRebuiltWithAndWithoutMicromap)
{
    Blas blas(gpu(), {mapped(0)});
    const auto expect = [&](const Outcome outcome) {
        Tlas tlas(gpu(), {instance(blas, {}, 5)});
        Tracer tracer(gpu());
        Ray ray;
        ray.origin = {0.3f, 0.3f, 1};
        const std::vector<Result> results = tracer.trace(tlas, std::span(&ray, 1));
        EXPECT_EQ(results[0].candidateCount, outcome == Outcome::NonOpaque ? 1u : 0u);
        EXPECT_EQ(results[0].committed, outcome == Outcome::Opaque ? kTriangle : kNone);
    };
    expect(Outcome::Ignored);
    blas.build({Geometry{.vertices = triangleRow(1)}});
    expect(Outcome::NonOpaque);
    blas.build({mapped(1)});
    expect(Outcome::Opaque);
    blas.build({Geometry{.vertices = triangleRow(1), .flags = VK_GEOMETRY_OPAQUE_BIT_KHR}});
    expect(Outcome::Opaque);
    blas.build({mapped(2)});
    expect(Outcome::NonOpaque);
}

TEST_F(Top, MemoryReused)
{
    // Structures with and without micromaps, one after the other at the same place: the one built last is meant.
    const Buffer memory(gpu(), 1 << 20, gpu().structureUsage());
    for (int round = 0; round < 6; ++round) {
        Blas blas(gpu());
        blas.placeIn(memory.handle(), 4096);
        const int state = round % 2 == 0 ? round / 2 : kNoMicromap;
        blas.build(
            {state == kNoMicromap ? Geometry{.vertices = triangleRow(1)} : mapped(static_cast<uint32_t>(state))});
        Tlas tlas(gpu());
        tlas.placeIn(memory.handle(), 512 * 1024);
        tlas.build(std::vector{instance(blas, {}, 42), instance(blas, {2, 0, 0}, 43, kFlagTwoState)});
        expectShown(tlas, {{42, state}, {43, state, kFlagTwoState}});
    }
}

TEST_F(Top, AliasesAliveTogether)
{
    const Buffer memory(gpu(), 1 << 20, gpu().structureUsage());
    Blas first(gpu()), second(gpu());
    first.placeIn(memory.handle(), 0);
    second.placeIn(memory.handle(), 0);
    first.build({mapped(0)});
    second.build({mapped(2)});
    Tlas tlas(gpu(), {instance(second, {}, 1)});
    expectShown(tlas, {{1, 2}});
    first.build({mapped(1)});
    tlas.build(std::vector{instance(first, {}, 2)});
    expectShown(tlas, {{2, 1}});
    second.build({Geometry{.vertices = triangleRow(1)}});
    tlas.build(std::vector{instance(second, {}, 3)});
    expectShown(tlas, {{3, kNoMicromap}});
}

TEST_F(Top, EverythingInOneCommandBuffer)
{
    MicromapInput input;
    input.add(6, kFourState, std::vector<uint8_t>(4096, 1));
    Micromap micromap(gpu(), std::move(input));
    Geometry geometry{.vertices = triangleRow(1)};
    geometry.micromap = Attachment{&micromap};
    Blas blas(gpu());
    blas.prepare({geometry});
    Tlas tlas(gpu());
    tlas.prepare(std::vector{instance(blas, {}, 9), instance(*blas_[0], {2, 0, 0}, 8)});
    Tracer tracer(gpu());
    std::vector<Ray> rays(2);
    rays[0].origin = {0.3f, 0.3f, 1};
    rays[1].origin = {2.3f, 0.3f, 1};
    tracer.prepare(tlas, rays);
    gpu().submit([&](VkCommandBuffer commands) {
        micromap.record(commands);
        barrier(commands);
        blas.record(commands);
        barrier(commands);
        tlas.record(commands);
        barrier(commands);
        tracer.bind(commands);
        tracer.dispatch(commands);
        barrier(commands);
    });
    const std::vector<Result> results = tracer.results();
    EXPECT_EQ(results[0].committed, kTriangle);
    EXPECT_EQ(results[0].candidateCount, 0u);
    EXPECT_EQ(results[0].customIndex, 9u);
    EXPECT_EQ(results[1].committed, kNone);
    EXPECT_EQ(results[1].candidateCount, 0u);
}

} // namespace
