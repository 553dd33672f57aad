// SPDX-License-Identifier: Apache-2.0
// Thousands of bottom-level structures with micromaps in a frame, and a top-level structure of 100,000 instances in
// each.
#include <algorithm>
#include <chrono>

#include "harness/program/labels.h"
#include "scale/scale.h"
#include "structures/constants.h"

namespace
{

const vt::Labels kStructureScaleLabels{{"StructureScale.*", "slow"}};

using namespace vt;

constexpr auto kCompactedSize = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;

class StructureScale : public Scale
{
protected:
    StructureScale()
    {
        for (uint8_t state = 0; state < 4; ++state) {
            MicromapInput input;
            input.add(1, kFourState, std::array<uint8_t, 4>{state, 0, 1, 1});
            micromaps_.push_back(std::make_unique<Micromap>(gpu(), std::move(input)));
            micromaps_.back()->build();
        }
    }
    Geometry geometry(size_t i) const
    {
        Geometry result{.vertices = triangleRow(1)};
        if (i % 5 < 4)
            result.micromap = Attachment{.micromap = micromaps_[i % 5].get()};
        return result;
    }

    std::vector<std::unique_ptr<Micromap>> micromaps_;
};

TEST_F(StructureScale, ThousandsBuiltAndCompactedInAFrame)
{
    const size_t count = scaled(2000);
    std::vector<std::unique_ptr<Blas>> built(count);
    for (size_t i = 0; i < count; ++i) {
        built[i] = std::make_unique<Blas>(gpu());
        built[i]->prepare({geometry(i)}, VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR);
    }
    const QueryPool sizes(gpu(), kCompactedSize, static_cast<uint32_t>(count));
    std::vector<VkAccelerationStructureKHR> handles;
    for (const auto &blas : built)
        handles.push_back(blas->handle());
    const Buffer packed(gpu(), count * 4096, gpu().structureUsage());
    uint64_t warm = 0, warmAllocations = 0;
    timed("frame", 6, [&](size_t frame) {
        if (frame == 2) {
            warm = Footprint::now().resident;
            warmAllocations = allocations();
        }
        gpu().submit([&](VkCommandBuffer commands) {
            for (const auto &blas : built)
                blas->record(commands);
            barrier(commands);
            vkCmdResetQueryPool(commands, sizes, 0, static_cast<uint32_t>(count));
            gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, static_cast<uint32_t>(count),
                                                                   handles.data(), kCompactedSize, sizes, 0);
        });
        std::vector<std::unique_ptr<Structure>> compact;
        VkDeviceSize end = 0;
        for (size_t i = 0; i < count; ++i) {
            const VkDeviceSize size = sizes.value(static_cast<uint32_t>(i));
            compact.push_back(std::make_unique<Structure>(gpu(), kBottom));
            compact.back()->placeIn(packed.handle(), end);
            compact.back()->create(size);
            end += (size + 255) / 256 * 256;
            ASSERT_LE(end, packed.size());
        }
        gpu().submit([&](VkCommandBuffer commands) {
            for (size_t i = 0; i < count; ++i)
                recordCopy(gpu(), commands, handles[i], compact[i]->handle(),
                           VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR);
        });
        std::vector<VkAccelerationStructureInstanceKHR> instances, originals;
        for (size_t i = 0; i < 10; ++i) {
            originals.push_back(instance(*built[i * (count / 10) + i], {0, 2.0f * static_cast<float>(i), 0}, 100));
            instances.push_back(instance(*compact[i * (count / 10) + i], {0, 2.0f * static_cast<float>(i), 0}, 100));
        }
        std::vector<Ray> rays;
        for (size_t i = 0; i < instances.size(); ++i) {
            const float y = 2.0f * static_cast<float>(i);
            rays.push_back({.origin = {0.2f, y + 0.2f, 1}});
            rays.push_back({.origin = {0.7f, y + 0.1f, 1}});
        }
        EXPECT_EQ(seen(gpu(), Tlas(gpu(), instances), rays), seen(gpu(), Tlas(gpu(), originals), rays));
    });
    if (kResidentIsMeaningful) {
        // A kilobyte for each structure and frame; lavapipe's threads alone have been seen to take 6 MiB.
        EXPECT_LT(Footprint::now().resident, warm + (8 << 20));
    }
    EXPECT_EQ(allocations(), warmAllocations);
}

TEST_F(StructureScale, TopLevelOfAHundredThousandInstancesEachFrame)
{
    const size_t count = scaled(100'000);
    const Blas mapped(gpu(), {geometry(0)}), plain(gpu(), {geometry(4)});
    std::vector<VkAccelerationStructureInstanceKHR> instances;
    for (size_t i = 0; i < count; ++i)
        instances.push_back(instance(i % 2 == 0 ? mapped : plain,
                                     {1.5f * static_cast<float>(i % 1000), 1.5f * static_cast<float>(i / 1000), 0},
                                     static_cast<uint32_t>(i & 0xffffff)));
    std::vector<Ray> rays;
    std::vector<uint32_t> expected;
    for (size_t i = 1; i < count; i += count / 50 | 1) {
        rays.push_back(
            {.origin = {instances[i].transform.matrix[0][3] + 0.2f, instances[i].transform.matrix[1][3] + 0.2f, 1},
             .flags = kRayOpaque});
        expected.push_back(static_cast<uint32_t>(i));
    }
    Tracer tracer(gpu());
    Tlas frames[2] = {Tlas(gpu()), Tlas(gpu())};
    for (Tlas &tlas : frames)
        tlas.prepare(instances);
    uint64_t warm = 0, warmAllocations = 0;
    timed("frame", 12, [&](size_t frame) {
        if (frame == 4) {
            warm = Footprint::now().resident;
            warmAllocations = allocations();
        }
        gpu().submit([&](VkCommandBuffer commands) { frames[frame % 2].record(commands); });
        if (frame % 4 < 2) {
            const auto results = tracer.trace(frames[frame % 2], rays);
            for (size_t i = 0; i < rays.size(); ++i) {
                const bool hit = results[i].committed == kTriangle;
                EXPECT_TRUE(!hit || results[i].customIndex == expected[i]) << i;
                EXPECT_TRUE(hit || expected[i] % 2 == 0) << i;
            }
        }
    });
    if (kResidentIsMeaningful) {
        EXPECT_LT(Footprint::now().resident, warm + (4 << 20));
    }
    EXPECT_LE(allocations(), warmAllocations);
}

// GENERIC structures may hold micromaps, which are found by the addresses of their buffers once these have memory.
TEST_F(StructureScale, MemoryAfterThousandsOfGenericStructures)
{
    const VkDevice device = gpu().device();
    constexpr VkDeviceSize kBytes = 4096;
    // Time of each buffer that gets its memory after `count` structures were created.
    const auto timeOf = [&](size_t count) {
        std::vector<VkBuffer> buffers(count);
        std::vector<VkAccelerationStructureKHR> structures(count);
        auto bufferInfo = vkInit<VkBufferCreateInfo>({.size = kBytes, .usage = gpu().structureUsage()});
        auto info = vkInit<VkAccelerationStructureCreateInfoKHR>(
            {.size = kBytes, .type = VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR});
        for (size_t i = 0; i < count; ++i) {
            VT_CHECK(vkCreateBuffer(device, &bufferInfo, nullptr, &buffers[i]));
            info.buffer = buffers[i];
            VT_CHECK(gpu().vk().CreateAccelerationStructureKHR(device, &info, nullptr, &structures[i]));
        }
        VkMemoryRequirements needs;
        vkGetBufferMemoryRequirements(device, buffers[0], &needs);
        const VkDeviceSize stride = (needs.size + needs.alignment - 1) / needs.alignment * needs.alignment;
        needs.size = stride * count;
        const VkDeviceMemory memory = gpu().allocate(needs);
        const auto start = std::chrono::steady_clock::now(); // std::clock() has 1 ms on Windows
        for (size_t i = 0; i < count; ++i)
            VT_CHECK(vkBindBufferMemory(device, buffers[i], memory, i * stride));
        const std::chrono::duration<double> time = std::chrono::steady_clock::now() - start;
        for (size_t i = 0; i < count; ++i) {
            gpu().vk().DestroyAccelerationStructureKHR(device, structures[i], nullptr);
            vkDestroyBuffer(device, buffers[i], nullptr);
        }
        vkFreeMemory(device, memory, nullptr);
        return time.count() / static_cast<double>(count);
    };
    // Others use the processors as well.
    const auto least = [&](size_t count) { return std::min({timeOf(count), timeOf(count), timeOf(count)}); };
    timeOf(500);
    EXPECT_LT(least(16000), 12 * least(500)); // 32 where each looks at all structures
}

} // namespace
