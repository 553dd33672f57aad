// SPDX-License-Identifier: Apache-2.0
// Structures that are created and destroyed again and again: memory is reused, and tables do not grow.
#include "gpu/copies.h"
#include "harness/harness.h"
#include "harness/program/labels.h"
#include "structures/constants.h"
#include "structures/footprint.h"

namespace
{

const vt::Labels kStructureChurnLabels{{"Churn.*", "slow packed"}};

using namespace vt;

void expectFlat(uint64_t before, uint64_t spare)
{
    if (kResidentIsMeaningful) {
        EXPECT_LT(Footprint::now().resident, before + spare);
    }
}

class Churn : public GpuTest
{
protected:
    std::vector<Geometry> plain() { return {Geometry{.vertices = triangleRow(6)}}; }
};

// The structure built, copied or loaded last is the one that instances of the address show.
TEST_F(Churn, AliasesOfCopies)
{
    const Patchwork first(gpu()), second(gpu(), 2);
    const Blas one(gpu(), first.geometries()), two(gpu(), second.geometries()), none(gpu(), plain());
    const Serialized data = serialize(gpu(), two), plainData = serialize(gpu(), none);
    const Buffer memory(gpu(), 1 << 20, gpu().structureUsage());
    Blas a(gpu()), b(gpu());
    for (Blas *alias : {&a, &b}) {
        alias->placeIn(memory.handle(), 0);
        alias->create(std::max<VkDeviceSize>(one.size(), data.deserializedSize()) + 4096);
    }
    ASSERT_EQ(a.address(), b.address());
    const auto shows = [&](const Structure &original) {
        const auto expected = seenOf(gpu(), original);
        EXPECT_EQ(seenOf(gpu(), a), expected);
        EXPECT_EQ(seenOf(gpu(), b), expected);
    };
    copy(gpu(), one, a);
    shows(one);
    b.build(plain());
    shows(none);
    deserialize(gpu(), data, a);
    shows(two);
    copy(gpu(), one, b);
    shows(one);
    deserialize(gpu(), plainData, a);
    shows(none);
    a.build(second.geometries());
    shows(two);
    copy(gpu(), none, b);
    shows(none);
}

// A top-level structure where a bottom-level one was, and back.
TEST_F(Churn, TopAndBottomInTheSameMemory)
{
    const Patchwork patchwork(gpu());
    const Blas source(gpu(), patchwork.geometries());
    const auto expected = seenOf(gpu(), source);
    const Tlas scene(gpu(), {instance(source, {}, 77)});
    const Buffer memory(gpu(), 1 << 20, gpu().structureUsage());
    for (int round = 0; round < 3; ++round) {
        Structure bottom(gpu(), kBottom), top(gpu(), kTop);
        bottom.placeIn(memory.handle(), 0);
        bottom.create(source.size());
        copy(gpu(), source, bottom);
        EXPECT_EQ(seenOf(gpu(), bottom), expected);
        top.placeIn(memory.handle(), 0);
        top.create(scene.size());
        copy(gpu(), scene, top);
        EXPECT_EQ(seen(gpu(), top, Patchwork::rays()), expected);
    }
}

// More structures than a table has capacity for at once, and far more in total.
TEST_F(Churn, ManyStructures)
{
    const Buffer memory(gpu(), 16 << 20, gpu().structureUsage());
    constexpr size_t kAlive = 3000;
    std::vector<VkAccelerationStructureKHR> alive(kAlive, VK_NULL_HANDLE);
    uint64_t warm = 0;
    for (size_t i = 0; i < 150'000; ++i) {
        VkAccelerationStructureKHR &place = alive[i * 7919 % kAlive];
        gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), place, nullptr);
        auto info = vkInit<VkAccelerationStructureCreateInfoKHR>(
            {.buffer = memory.handle(), .offset = i * 12347 % 60000 * 256, .size = 256, .type = kBottom});
        VT_CHECK(gpu().vk().CreateAccelerationStructureKHR(gpu().device(), &info, nullptr, &place));
        auto query = vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = place});
        ASSERT_NE(gpu().vk().GetAccelerationStructureDeviceAddressKHR(gpu().device(), &query), 0u);
        if (i == 30'000)
            warm = Footprint::now().resident;
    }
    expectFlat(warm, 2 << 20);
    for (const VkAccelerationStructureKHR one : alive)
        gpu().vk().DestroyAccelerationStructureKHR(gpu().device(), one, nullptr);
    const Patchwork patchwork(gpu());
    const Blas source(gpu(), patchwork.geometries());
    const Structure target(gpu(), kBottom);
    Structure clone(gpu(), kBottom);
    clone.create(source.size());
    copy(gpu(), source, clone);
    EXPECT_EQ(seenOf(gpu(), clone), seenOf(gpu(), source));
}

// 300 times 60,000 instances, in structures that are destroyed again: more than there are slots.
TEST_F(Churn, SlotsOfCopiesComeBack)
{
    const Blas blas(gpu(), plain());
    Tlas source(gpu());
    source.prepare(std::vector(60'000, instance(blas, {}, 5)));
    for (int round = 0; round < 300; ++round) {
        Structure target(gpu(), kTop);
        target.create(source.size());
        // Recorded only: what counts is that no copy is rejected, which the fixture would see as a message.
        VkCommandBuffer commands = gpu().begin();
        source.record(commands);
        recordCopy(gpu(), commands, source.handle(), target.handle());
        gpu().end(commands);
        vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &commands);
    }
}

TEST_F(Churn, ThousandsOfBuildsAndCopies)
{
    const Patchwork patchwork(gpu());
    const auto expected = seenOf(gpu(), Blas(gpu(), patchwork.geometries()));
    uint64_t warm = 0;
    for (int round = 0; round < 2000; ++round) {
        const Blas source(gpu(), patchwork.geometries());
        Structure clone(gpu(), kBottom);
        clone.create(source.size());
        copy(gpu(), source, clone);
        const Tlas scene(gpu(), {instance(clone, {}, 77)});
        Structure sceneCopy(gpu(), kTop);
        sceneCopy.create(scene.size());
        copy(gpu(), scene, sceneCopy);
        if (round % 250 == 249) {
            ASSERT_EQ(seen(gpu(), sceneCopy, Patchwork::rays()), expected) << "round " << round;
        }
        if (round == 499)
            warm = Footprint::now().resident;
    }
    expectFlat(warm, 4 << 20);
}

} // namespace
