// SPDX-License-Identifier: Apache-2.0
// Queue families with restricted capabilities, as most GPUs have: the mock driver's quirk "queues" reports commands
// that a family does not support.
#include <cstring>

#include "gpu/copies.h"
#include "harness/harness.h"
#include "harness/program/labels.h"
#include "harness/states.h"

namespace
{

const vt::Labels kQueueFamilyLabels{{"QueueFamilies.*", "forcing"}};

using namespace vt;

class QueueFamilies : public GpuTest
{
protected:
    explicit QueueFamilies(const Options &options = {.quirks = "queues"}) : GpuTest(options) {}

    // The family with exactly these of the three purposes.
    uint32_t family(VkQueueFlags purposes)
    {
        constexpr VkQueueFlags kAll = VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT | VK_QUEUE_TRANSFER_BIT;
        for (uint32_t i = 0; i < gpu().families().size(); ++i) {
            if ((gpu().families()[i].queueFlags & kAll) == purposes)
                return i;
        }
        throw std::runtime_error("no such queue family");
    }

    struct Submission {
        VkCommandPool pool;
        VkQueue queue;
    };
    // Records for that family and submits there.
    Submission start(uint32_t family, const std::function<void(VkCommandBuffer)> &record)
    {
        auto poolInfo = vkInit<VkCommandPoolCreateInfo>({.queueFamilyIndex = family});
        VkCommandPool pool = VK_NULL_HANDLE;
        VT_CHECK(vkCreateCommandPool(gpu().device(), &poolInfo, nullptr, &pool));
        auto allocation = vkInit<VkCommandBufferAllocateInfo>({.commandPool = pool, .commandBufferCount = 1});
        VkCommandBuffer commands = VK_NULL_HANDLE;
        VT_CHECK(vkAllocateCommandBuffers(gpu().device(), &allocation, &commands));
        auto begin = vkInit<VkCommandBufferBeginInfo>();
        VT_CHECK(vkBeginCommandBuffer(commands, &begin));
        record(commands);
        VT_CHECK(vkEndCommandBuffer(commands));
        auto submission = vkInit<VkSubmitInfo>({.commandBufferCount = 1, .pCommandBuffers = &commands});
        const VkQueue queue = gpu().queueOf(family);
        VT_CHECK(vkQueueSubmit(queue, 1, &submission, VK_NULL_HANDLE));
        return {pool, queue};
    }
    void finish(const Submission &submission)
    {
        VT_CHECK(vkQueueWaitIdle(submission.queue));
        vkDestroyCommandPool(gpu().device(), submission.pool, nullptr);
    }
    void submit(uint32_t family, const std::function<void(VkCommandBuffer)> &record) { finish(start(family, record)); }
};

// Query results may be copied, and queries reset, on queues without compute: "Supported Queue Types" of both commands
// includes graphics. Tests each form of result, from pools whose values are written by the layer.
TEST_F(QueueFamilies, QueryResultsWithoutCompute)
{
    const Patchwork patchwork(gpu());
    const Blas structure(gpu(), patchwork.geometries());
    const uint32_t graphics = family(VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_TRANSFER_BIT);
    constexpr uint32_t kQueries = 3; // the second one is never written
    const QueryPool pool(gpu(), VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR, kQueries);
    submit(graphics, [&](VkCommandBuffer commands) { vkCmdResetQueryPool(commands, pool, 0, kQueries); });
    gpu().submit([&](VkCommandBuffer commands) {
        const VkAccelerationStructureKHR handle = structure.handle();
        for (const uint32_t query : {0u, 2u})
            gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 1, &handle, pool.type(), pool, query);
    });
    const uint64_t size = pool.value(0);
    EXPECT_GT(size, 0u);
    for (const VkQueryResultFlags flags :
         {VkQueryResultFlags{0}, VkQueryResultFlags{VK_QUERY_RESULT_64_BIT},
          VkQueryResultFlags{VK_QUERY_RESULT_WITH_AVAILABILITY_BIT},
          VkQueryResultFlags{VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WITH_AVAILABILITY_BIT}}) {
        for (const VkDeviceSize spare : {0u, 24u}) {
            SCOPED_TRACE(testing::Message() << "flags " << flags << ", spare " << spare);
            const bool wide = (flags & VK_QUERY_RESULT_64_BIT) != 0;
            const bool both = (flags & VK_QUERY_RESULT_WITH_AVAILABILITY_BIT) != 0;
            const VkDeviceSize number = wide ? 8 : 4;
            const VkDeviceSize stride = number * (both ? 2 : 1) + spare;
            const Buffer out(gpu(), 16 + stride * kQueries, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
            std::memset(out.bytes(), 0xee, static_cast<size_t>(out.size()));
            submit(graphics, [&](VkCommandBuffer commands) {
                vkCmdCopyQueryPoolResults(commands, pool, 0, kQueries, out.handle(), 16, stride,
                                          flags | VK_QUERY_RESULT_PARTIAL_BIT);
            });
            for (uint32_t i = 0; i < kQueries; ++i) {
                const auto word = [&](VkDeviceSize at) {
                    uint64_t value = 0;
                    std::memcpy(&value, out.bytes() + 16 + i * stride + at, static_cast<size_t>(number));
                    return value;
                };
                EXPECT_EQ(word(0), i == 1 ? 0 : size);
                if (both) {
                    EXPECT_EQ(word(number), i == 1 ? 0u : 1u);
                }
                if (spare > 0) {
                    EXPECT_EQ(out.bytes()[16 + i * stride + stride - spare], 0xee);
                }
            }
        }
    }
}

// Two queues query and compact a micromap that rays meet meanwhile. All of them only read it, so nothing orders them.
TEST_F(QueueFamilies, CompactionsOnTwoQueuesDuringTraces)
{
    constexpr uint32_t kTriangles = 40, kPatterns = 4;
    Random random(3);
    std::vector<std::vector<uint8_t>> patterns;
    for (uint32_t i = 0; i < kPatterns; ++i)
        patterns.push_back(randomStates(random, 5, kTwoState));
    MicromapInput input;
    for (uint32_t i = 0; i < kTriangles; ++i)
        input.add(5, kTwoState, patterns[i % kPatterns]);
    Micromap source(gpu(), std::move(input), VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT);
    source.build();
    constexpr VkDeviceSize kCompacted = 64 + kTriangles * 8 + kPatterns * 128;
    const Micromap first(gpu(), source, kCompacted), second(gpu(), source, kCompacted);
    const QueryPool pool(gpu(), micromapQueryType(gpu(), VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT), 2);
    const auto compact = [&](VkQueueFlags purposes, uint32_t query, const Micromap &target) {
        return start(family(purposes | VK_QUEUE_COMPUTE_BIT | VK_QUEUE_TRANSFER_BIT), [&](VkCommandBuffer commands) {
            vkCmdResetQueryPool(commands, pool, query, 1);
            recordMicromapProperties(gpu(), commands, std::array{source.handle()}, pool.type(), pool, query);
            recordMicromapCopy(gpu(), commands, source.handle(), target.handle(), VK_COPY_MICROMAP_MODE_COMPACT_EXT);
        });
    };
    // What rays see that hit the middle of one micro-triangle of each triangle.
    const auto traced = [&](const Micromap &micromap) {
        constexpr uint32_t kState = 77;
        Geometry geometry{.vertices = triangleRow(kTriangles)};
        geometry.micromap = Attachment{&micromap};
        const Blas blas(gpu(), {geometry});
        const Tlas tlas(gpu(), {instance(blas, {}, 1)});
        const auto centre = microTriangleCentre(kState, 5);
        std::vector<Ray> rays(kTriangles);
        for (uint32_t t = 0; t < kTriangles; ++t)
            rays[t].origin = {1.5f * static_cast<float>(t) + static_cast<float>(centre[0]),
                              static_cast<float>(centre[1]), 1};
        const std::vector<Result> results = Tracer(gpu()).trace(tlas, rays);
        for (uint32_t t = 0; t < kTriangles; ++t)
            EXPECT_EQ(results[t].committed == kTriangle, patterns[t % kPatterns][kState] == 1) << t;
    };
    const Submission one = compact(VK_QUEUE_GRAPHICS_BIT, 0, first);
    const Submission other = compact(0, 1, second);
    traced(source);
    finish(one);
    finish(other);
    for (const uint32_t query : {0u, 1u})
        EXPECT_EQ(pool.value(query), reportedSize(gpu(), kCompacted));
    traced(first);
    traced(second);
}

class QueueFamiliesKhr : public QueueFamilies
{
protected:
    QueueFamiliesKhr() : QueueFamilies({.quirks = "queues", .api = Api::Khr}) {}
};

// Transfers by address are recorded for the queue that an application uploads with, and say nothing of compute there.
TEST_F(QueueFamiliesKhr, AddressCommandsOnATransferQueue)
{
    const Buffer from(gpu(), 1024,
                      VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
                          VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const Buffer to(gpu(), 1024, VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    submit(family(VK_QUEUE_TRANSFER_BIT), [&](VkCommandBuffer commands) {
        const VkDeviceAddressRangeKHR filled{from.address(), 512};
        gpu().vk().CmdFillMemoryKHR(commands, &filled, 0, 0x01020304);
        auto range = vkInit<VkMemoryRangeBarrierKHR>();
        range.srcStageMask = range.dstStageMask = VK_PIPELINE_STAGE_2_COPY_BIT | VK_PIPELINE_STAGE_2_CLEAR_BIT;
        range.srcAccessMask = range.dstAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT | VK_ACCESS_2_TRANSFER_READ_BIT;
        range.srcQueueFamilyIndex = range.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
        range.addressRange = {from.address(), 1024};
        auto ranges =
            vkInit<VkMemoryRangeBarriersInfoKHR>({.memoryRangeBarrierCount = 1, .pMemoryRangeBarriers = &range});
        auto dependency = vkInit<VkDependencyInfo>({.pNext = &ranges});
        vkCmdPipelineBarrier2(commands, &dependency);
        auto region =
            vkInit<VkDeviceMemoryCopyKHR>({.srcRange = {from.address(), 512}, .dstRange = {to.address() + 512, 512}});
        auto copy = vkInit<VkCopyDeviceMemoryInfoKHR>({.regionCount = 1, .pRegions = &region});
        gpu().vk().CmdCopyMemoryKHR(commands, &copy);
    });
    EXPECT_EQ(to.as<uint32_t>()[0], 0u);
    EXPECT_EQ(to.as<uint32_t>()[128], 0x01020304u);
}

} // namespace
