// SPDX-License-Identifier: Apache-2.0
// Threads that create, record and destroy their own objects, and share the layer's state of the device. Most errors
// that this finds are reported by ThreadSanitizer (scripts/test tsan).
#include <mutex>
#include <thread>

#include "command_buffer/state_scene.h"
#include "gpu/copies.h"
#include "gpu/pipeline_tracer.h"
#include "harness/harness.h"
#include "harness/program/labels.h"
#include "shaders/tracer_comp.h"

namespace
{

const vt::Labels kThreadsLabels{{"Threads.*", "threads"}};

using namespace vt;

class Threads : public GpuTest
{
protected:
    static constexpr size_t kThreads = 4;

    void onThreads(const std::function<void(size_t)> &work)
    {
        std::vector<std::thread> threads;
        for (size_t i = 0; i < kThreads; ++i)
            threads.emplace_back([&work, i] { work(i); });
        for (std::thread &thread : threads)
            thread.join();
    }

    // Records by a pool of the thread's, and waits for a fence while others submit.
    void submit(const std::function<void(VkCommandBuffer)> &record)
    {
        const auto poolInfo = vkInit<VkCommandPoolCreateInfo>({.queueFamilyIndex = gpu().family()});
        VkCommandPool pool = VK_NULL_HANDLE;
        VT_CHECK(vkCreateCommandPool(gpu().device(), &poolInfo, nullptr, &pool));
        const auto allocate = vkInit<VkCommandBufferAllocateInfo>(
            {.commandPool = pool, .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY, .commandBufferCount = 1});
        VkCommandBuffer commands = VK_NULL_HANDLE;
        VT_CHECK(vkAllocateCommandBuffers(gpu().device(), &allocate, &commands));
        const auto begin = vkInit<VkCommandBufferBeginInfo>();
        VT_CHECK(vkBeginCommandBuffer(commands, &begin));
        record(commands);
        VT_CHECK(vkEndCommandBuffer(commands));
        const auto fenceInfo = vkInit<VkFenceCreateInfo>();
        VkFence fence = VK_NULL_HANDLE;
        VT_CHECK(vkCreateFence(gpu().device(), &fenceInfo, nullptr, &fence));
        auto info = vkInit<VkSubmitInfo>({.commandBufferCount = 1, .pCommandBuffers = &commands});
        {
            std::lock_guard lock(queueMutex_);
            VT_CHECK(vkQueueSubmit(gpu().queue(), 1, &info, fence));
        }
        VT_CHECK(vkWaitForFences(gpu().device(), 1, &fence, VK_TRUE, UINT64_MAX));
        vkDestroyFence(gpu().device(), fence, nullptr);
        vkDestroyCommandPool(gpu().device(), pool, nullptr);
    }

    std::mutex queueMutex_;
};

// Micromaps, structures, modules, pipelines and queries come and go; what is left is right.
TEST_F(Threads, MakeEverythingAtOnce)
{
    std::array<std::unique_ptr<StateScene>, kThreads> scenes;
    onThreads([&](size_t thread) {
        for (int round = 0; round < 3; ++round) {
            scenes[thread] = std::make_unique<StateScene>(gpu());
            submit([&](VkCommandBuffer commands) { scenes[thread]->record(commands); });
            const VkShaderModule module = gpu().shader(tracer_comp);
            vkDestroyShaderModule(gpu().device(), module, nullptr);
            const PipelineTracer pipeline(gpu(), {.groups = {{.anyHit = thread % 2 == 0}}});
            const QueryPool sizes(gpu(), VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR);
            submit([&](VkCommandBuffer commands) {
                vkCmdResetQueryPool(commands, sizes, 0, 1);
                const VkAccelerationStructureKHR top = scenes[thread]->tlas().handle();
                gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 1, &top, sizes.type(), sizes, 0);
            });
            EXPECT_GT(sizes.value(), 56u); // the header that the specification gives
        }
    });
    for (const auto &scene : scenes)
        scene->expectRight();
}

// While one thread makes structures with so many instances that the tables grow, others make modules, which hold the
// address of the first table.
TEST_F(Threads, ModulesAreMadeWhileTablesGrow)
{
    const StateScene scene(gpu());
    onThreads([&](size_t thread) {
        if (thread > 0) {
            for (int i = 0; i < 40; ++i)
                vkDestroyShaderModule(gpu().device(), gpu().shader(tracer_comp), nullptr);
            return;
        }
        const std::vector<VkAccelerationStructureInstanceKHR> instances(70'000);
        std::vector<std::unique_ptr<Tlas>> structures;
        for (int i = 0; i < 3; ++i) {
            structures.push_back(std::make_unique<Tlas>(gpu()));
            structures.back()->prepare(instances);
            submit([&](VkCommandBuffer commands) { structures.back()->record(commands); });
        }
    });
}

} // namespace
