// SPDX-License-Identifier: Apache-2.0
// Micromaps are found for exactly as long as the referenced structure has them: whatever is built or copied over it,
// and whatever used its memory or its table entries before.
#include <algorithm>
#include <cstring>

#include <gtest/gtest.h>

#include "gpu/scene.h"
#include "gpu/tracer.h"
#include "harness/harness.h"
#include "harness/program/labels.h"

using namespace vt;

namespace
{

const vt::Labels kLifetimeLabels{{"Lifetime.*", "quirks stacked packed forcing"}};

class Lifetime : public GpuTest
{
protected:
    // A micromap with one triangle of level 3, transparent all over.
    std::unique_ptr<Micromap> transparentMicromap()
    {
        MicromapInput input;
        input.add(3, kFourState, std::vector<uint8_t>(64, 0));
        auto micromap = std::make_unique<Micromap>(gpu(), std::move(input));
        micromap->build();
        return micromap;
    }
    static Geometry plain() { return Geometry{.vertices = triangleRow(1)}; }
    static Geometry mapped(const Micromap &micromap)
    {
        Geometry geometry = plain();
        geometry.micromap = Attachment{&micromap};
        return geometry;
    }
    // Candidates that the shader is handed by a ray at the only triangle.
    uint32_t candidates(const Blas &blas)
    {
        const Tlas tlas(gpu(), {instance(blas, {}, 5)});
        Ray ray;
        ray.origin = {0.3f, 0.3f, 1};
        Tracer tracer(gpu());
        return tracer.trace(tlas, std::span(&ray, 1))[0].candidateCount;
    }
    template <typename Function>
    Function function(const char *name)
    {
        return reinterpret_cast<Function>(vkGetDeviceProcAddr(gpu().device(), name));
    }
};

TEST_F(Lifetime, ACopyOverAStructureTakesItsMicromapsAway)
{
    const auto micromap = transparentMicromap();
    const Blas target(gpu(), {mapped(*micromap)});
    const Blas source(gpu(), {plain()});
    EXPECT_EQ(candidates(target), 0u);
    const auto copy = function<PFN_vkCmdCopyAccelerationStructureKHR>("vkCmdCopyAccelerationStructureKHR");
    gpu().submit([&](VkCommandBuffer commands) {
        auto info = vkInit<VkCopyAccelerationStructureInfoKHR>(
            {.src = source.handle(), .dst = target.handle(), .mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR});
        copy(commands, &info);
    });
    EXPECT_EQ(candidates(target), 1u);
}

// The layer keeps something of boxes too, for intersection shaders, but it is not in the structure.
TEST_F(Lifetime, BoxesAreSerializedByTheDriver)
{
    Geometry boxes;
    boxes.boxes = {{0, 0, -0.1f, 1, 1, 0.1f}};
    const Blas blas(gpu(), {boxes});
    const Buffer data(gpu(), blas.size() + 4096, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    std::memset(data.bytes(), 0, blas.size() + 4096);
    const auto copy =
        function<PFN_vkCmdCopyAccelerationStructureToMemoryKHR>("vkCmdCopyAccelerationStructureToMemoryKHR");
    gpu().submit([&](VkCommandBuffer commands) {
        auto info = vkInit<VkCopyAccelerationStructureToMemoryInfoKHR>({.src = blas.handle()});
        info.dst.deviceAddress = (data.address() + 255) & ~VkDeviceAddress{255};
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_SERIALIZE_KHR;
        copy(commands, &info);
    });
    EXPECT_TRUE(std::any_of(data.bytes(), data.bytes() + blas.size(), [](auto byte) { return byte != 0; }));
}

TEST_F(Lifetime, APlainBuildExecutedLateKeepsOthers)
{
    const Buffer memory(gpu(), 1 << 20, gpu().structureUsage());
    const auto micromap = transparentMicromap();
    auto first = std::make_unique<Blas>(gpu());
    first->placeIn(memory.handle(), 0);
    first->build({mapped(*micromap)});
    // Recorded while the memory's reference has micromaps, executed when its table entry could be another's.
    Blas aliasing(gpu());
    aliasing.placeIn(memory.handle(), 0);
    aliasing.prepare({plain()});
    VkCommandBuffer late = gpu().begin();
    aliasing.record(late);
    gpu().end(late);
    first.reset();
    const Blas other(gpu(), {mapped(*micromap)});
    EXPECT_EQ(candidates(other), 0u);
    gpu().execute(late);
    EXPECT_EQ(candidates(other), 0u);
    EXPECT_EQ(candidates(aliasing), 1u);
}

TEST_F(Lifetime, PrivateDataOfMicromapsIsKeptPerSlotAndObject)
{
    const auto micromap = transparentMicromap();
    const uint64_t object = micromap->handle().object();
    const VkObjectType type = micromap->handle().objectType();
    auto info = vkInit<VkPrivateDataSlotCreateInfo>();
    VkPrivateDataSlot slots[2] = {};
    for (VkPrivateDataSlot &slot : slots)
        ASSERT_EQ(vkCreatePrivateDataSlot(gpu().device(), &info, nullptr, &slot), VK_SUCCESS);
    ASSERT_EQ(vkSetPrivateData(gpu().device(), type, object, slots[0], 42), VK_SUCCESS);
    uint64_t values[2] = {1, 1};
    for (int i = 0; i < 2; ++i)
        vkGetPrivateData(gpu().device(), type, object, slots[i], &values[i]);
    EXPECT_EQ(values[0], 42u);
    EXPECT_EQ(values[1], 0u);
    for (VkPrivateDataSlot slot : slots)
        vkDestroyPrivateDataSlot(gpu().device(), slot, nullptr);
}

// 300 rounds of a build and a copy: the slots that the pair goes through come back.
TEST_F(Lifetime, BuildAndCopyInTurnDoesNotUseUpSlots)
{
    const Blas blas(gpu(), {plain()});
    Tlas source(gpu());
    Tlas target(gpu());
    const std::vector instances(60'000, instance(blas, {}, 5));
    source.prepare(instances);
    target.prepare(instances);
    const auto copy = function<PFN_vkCmdCopyAccelerationStructureKHR>("vkCmdCopyAccelerationStructureKHR");
    // Recorded only: what counts is that no build is rejected, which the fixture would see as a message.
    VkCommandBuffer commands = gpu().begin();
    for (int round = 0; round < 300; ++round) {
        source.record(commands);
        auto info = vkInit<VkCopyAccelerationStructureInfoKHR>(
            {.src = source.handle(), .dst = target.handle(), .mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR});
        copy(commands, &info);
    }
    gpu().end(commands);
}

} // namespace
