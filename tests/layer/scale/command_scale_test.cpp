// SPDX-License-Identifier: Apache-2.0
// Thousands of command buffers and query pools.
#include <barrier>

#include "gpu/pipeline_tracer.h"
#include "harness/harness.h"
#include "harness/program/labels.h"
#include "scale/scale.h"

namespace
{

const vt::Labels kCommandScaleLabels{{"CommandScale.*", "slow threads"}, {"DeviceScale.*", "threads"}};

using namespace vt;

class CommandScale : public Scale
{
protected:
    CommandScale() : patchwork_(gpu()), blas_(gpu(), patchwork_.geometries()), scene_(gpu(), {instance(blas_, {}, 77)})
    {
    }

    std::vector<VkCommandBuffer> allocate(size_t count)
    {
        auto info = vkInit<VkCommandBufferAllocateInfo>({.commandPool = gpu().pool(),
                                                         .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY,
                                                         .commandBufferCount = static_cast<uint32_t>(count)});
        std::vector<VkCommandBuffer> buffers(count);
        VT_CHECK(vkAllocateCommandBuffers(gpu().device(), &info, buffers.data()));
        return buffers;
    }
    static void begin(VkCommandBuffer commands)
    {
        auto info = vkInit<VkCommandBufferBeginInfo>();
        VT_CHECK(vkBeginCommandBuffer(commands, &info));
    }
    void submit(VkCommandBuffer commands)
    {
        auto info = vkInit<VkSubmitInfo>({.commandBufferCount = 1, .pCommandBuffers = &commands});
        VT_CHECK(vkQueueSubmit(gpu().queue(), 1, &info, VK_NULL_HANDLE));
        VT_CHECK(vkQueueWaitIdle(gpu().queue()));
    }
    void free(const std::vector<VkCommandBuffer> &buffers)
    {
        vkFreeCommandBuffers(gpu().device(), gpu().pool(), static_cast<uint32_t>(buffers.size()), buffers.data());
    }

    Patchwork patchwork_;
    Blas blas_;
    Tlas scene_;
};

// Each trace has its own hit records in memory of the layer.
TEST_F(CommandScale, TracesInThousandsOfCommandBuffers)
{
    if (!gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        GTEST_SKIP() << "no ray tracing pipelines";
    PipelineTracer tracer(gpu());
    const auto rays = Patchwork::rays();
    tracer.prepare(scene_, rays);
    const uint64_t before = allocations();
    const auto buffers = allocate(scaled(4000));
    for (int round = 0; round < 3; ++round) {
        timed("record" + std::to_string(round), buffers.size(), [&](size_t i) {
            begin(buffers[i]);
            tracer.bind(buffers[i]);
            tracer.dispatch(buffers[i]);
            VT_CHECK(vkEndCommandBuffer(buffers[i]));
        });
        EXPECT_LT(allocations() - before, 16u);
    }
    RecordProperty("allocations", static_cast<int>(allocations() - before));
    // Any of the command buffers can be submitted, in any order.
    std::vector<std::string> expected;
    for (const size_t i : {buffers.size() - 1, size_t{0}, buffers.size() / 2}) {
        tracer.clearResults();
        submit(buffers[i]);
        std::vector<std::string> now;
        for (const PipelineResult &r : tracer.results())
            now.push_back(std::to_string(r.committed) + "/" + std::to_string(r.candidateCount) + "/" +
                          std::to_string(r.primitive));
        if (expected.empty())
            expected = now;
        EXPECT_EQ(now, expected);
    }
    EXPECT_NE(std::set<std::string>(expected.begin(), expected.end()).size(), 1u);
    free(buffers);
    vkTrimCommandPool(gpu().device(), gpu().pool(), 0); // some unused memory is kept until then
    EXPECT_LE(allocations() - before, 1u);
}

// Each copy of a top-level structure has instances and scratch memory of its own there.
TEST_F(CommandScale, CopiesInThousandsOfCommandBuffers)
{
    const auto expected = seen(gpu(), scene_, Patchwork::rays());
    std::vector<std::unique_ptr<Structure>> targets;
    for (int i = 0; i < 3; ++i) {
        targets.push_back(std::make_unique<Structure>(gpu(), VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR));
        targets.back()->create(scene_.size());
    }
    const auto buffers = allocate(scaled(2000));
    const uint64_t before = allocations();
    timed("record", buffers.size(), [&](size_t i) {
        begin(buffers[i]);
        recordCopy(gpu(), buffers[i], scene_.handle(), targets[i % targets.size()]->handle());
        VT_CHECK(vkEndCommandBuffer(buffers[i]));
    });
    EXPECT_LT(allocations() - before, 16u);
    RecordProperty("allocations", static_cast<int>(allocations() - before));
    for (size_t i = 0; i < targets.size(); ++i) {
        submit(buffers[buffers.size() - targets.size() + i]);
        EXPECT_EQ(seen(gpu(), *targets[(buffers.size() - targets.size() + i) % targets.size()], Patchwork::rays()),
                  expected);
    }
    free(buffers);
    vkTrimCommandPool(gpu().device(), gpu().pool(), 0); // some unused memory is kept until then
    EXPECT_LE(allocations() - before, 1u);
}

// Freed one by one or with their pool, and allocated again while others are recorded: states of freed ones are gone,
// whatever a thread has looked up last.
TEST_F(CommandScale, PoolsComeAndGo)
{
    const auto poolInfo = vkInit<VkCommandPoolCreateInfo>(
        {.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT, .queueFamilyIndex = gpu().family()});
    const Tracer tracer(gpu());
    const auto record = [&](VkCommandBuffer commands) {
        begin(commands);
        const uint32_t pushed[4] = {};
        vkCmdPushConstants(commands, tracer.layout(), VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof pushed, pushed);
        VT_CHECK(vkEndCommandBuffer(commands));
    };
    std::vector<std::thread> threads;
    std::barrier allWarm(4);
    uint64_t warm = 0;
    for (int t = 0; t < 4; ++t) {
        threads.emplace_back([&, t] {
            std::vector<VkCommandPool> pools(16, VK_NULL_HANDLE);
            for (size_t i = 0; i < scaled(2000); ++i) {
                VkCommandPool &pool = pools[i % pools.size()];
                vkDestroyCommandPool(gpu().device(), pool, nullptr);
                VT_CHECK(vkCreateCommandPool(gpu().device(), &poolInfo, nullptr, &pool));
                auto info = vkInit<VkCommandBufferAllocateInfo>({.commandPool = pool, .commandBufferCount = 8});
                VkCommandBuffer buffers[8] = {};
                VT_CHECK(vkAllocateCommandBuffers(gpu().device(), &info, buffers));
                for (const VkCommandBuffer commands : buffers)
                    record(commands);
                vkFreeCommandBuffers(gpu().device(), pool, 4, buffers);
                VT_CHECK(vkAllocateCommandBuffers(gpu().device(), &info, buffers));
                for (const VkCommandBuffer commands : buffers)
                    record(commands);
                if (i == scaled(2000) / 4) {
                    allWarm.arrive_and_wait();
                    if (t == 0)
                        warm = Footprint::now().resident;
                }
            }
            for (const VkCommandPool pool : pools)
                vkDestroyCommandPool(gpu().device(), pool, nullptr);
        });
    }
    for (std::thread &thread : threads)
        thread.join();
    if (kResidentIsMeaningful) {
        EXPECT_LT(Footprint::now().resident, warm + (gpu().onLavapipe26() ? 16u << 20 : 8u << 20));
    }
}

TEST_F(CommandScale, ThousandsOfQueryPools)
{
    constexpr auto kType = VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;
    const Blas compactable(gpu(), patchwork_.geometries(), VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR);
    const VkDeviceSize expected = queried(gpu(), compactable, kType);
    const uint64_t before = allocations();
    uint64_t kept = 0; // memory of pools that were destroyed, for others
    for (int round = 0; round < 2; ++round) {
        std::vector<QueryPool> pools;
        timed("create" + std::to_string(round), scaled(2000), [&](size_t) { pools.emplace_back(gpu(), kType, 2); });
        EXPECT_LT(allocations() - before, 16u);
        for (size_t i = 0; i < pools.size(); i += pools.size() / 7) {
            // A pool that reused memory of another is reset in the same way as that, here by a command.
            gpu().submit([&](VkCommandBuffer commands) {
                vkCmdResetQueryPool(commands, pools[i], 0, 2);
                const VkAccelerationStructureKHR structure = compactable.handle();
                gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 1, &structure, kType, pools[i], 1);
            });
            EXPECT_EQ(pools[i].value(1), expected);
            uint64_t nothing[2] = {7, 7};
            EXPECT_EQ(vkGetQueryPoolResults(gpu().device(), pools[i], 0, 1, sizeof nothing, nothing, sizeof nothing,
                                            VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WITH_AVAILABILITY_BIT),
                      VK_NOT_READY);
            EXPECT_EQ(nothing[1], 0u);
        }
        pools.clear();
        if (round == 0)
            kept = allocations() - before;
    }
    EXPECT_EQ(allocations() - before, kept);
}

// More devices than are looked up without a lock (entry/device.cpp), created and destroyed in turns.
TEST(DeviceScale, TwentyDevicesAtATime)
{
    std::vector<std::unique_ptr<Gpu>> gpus(20);
    const auto works = [](Gpu &gpu) {
        Buffer buffer(gpu, 64, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
        gpu.submit([&](VkCommandBuffer commands) {
            vkCmdFillBuffer(commands, buffer.handle(), 0, 64, 0x1234567);
            barrier(commands);
        });
        EXPECT_EQ(buffer.as<uint32_t>()[7], 0x1234567u);
        const Blas blas(gpu, {Geometry{.vertices = triangleRow(1)}});
        EXPECT_NE(blas.address(), 0u);
    };
    for (int round = 0; round < 2; ++round) {
        for (auto &gpu : gpus) {
            if (gpu == nullptr)
                gpu = std::make_unique<Gpu>(Options{.validation = false, .spy = false});
        }
        for (const auto &gpu : gpus)
            works(*gpu);
        for (size_t i = 0; i < gpus.size(); i += 3)
            gpus[i].reset();
        for (const auto &gpu : gpus) {
            if (gpu != nullptr)
                works(*gpu);
        }
    }
}

} // namespace
