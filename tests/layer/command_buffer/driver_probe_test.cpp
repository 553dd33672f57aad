// SPDX-License-Identifier: Apache-2.0
// Driver probes run on the application's queue when something first depends on their result: while the application uses
// that queue, and from whichever threads need the result.
#include <array>
#include <atomic>
#include <chrono>
#include <future>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "gpu/pipeline_tracer.h"
#include "gpu/scene.h"
#include "harness/harness.h"
#include "harness/program/labels.h"
#include "vk/newer.h"

using namespace vt;

namespace
{

const vt::Labels kDriverProbeLabels{{"Probes.*", "threads forcing"}, {"SynchronizedQueue.*", "threads one_api"}};

// On a new device, on which no quirk was probed. The validation layer below checks that no two threads use the queue at
// the same time.
class Probes : public GpuTest
{
protected:
    // Works while the queue is in use by this thread.
    void besideSubmissions(const std::function<void(size_t thread)> &work)
    {
        constexpr size_t kThreads = 4;
        std::atomic<size_t> running = kThreads;
        std::vector<std::thread> threads;
        for (size_t i = 0; i < kThreads; ++i)
            threads.emplace_back([&, i] {
                work(i);
                --running;
            });
        auto submit = vkInit<VkSubmitInfo>();
        while (running > 0) {
            VT_CHECK(vkQueueSubmit(gpu().queue(), 1, &submit, VK_NULL_HANDLE));
            VT_CHECK(vkQueueWaitIdle(gpu().queue()));
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        for (std::thread &thread : threads)
            thread.join();
    }
};

// Recorded first of all, so that the driver's way to serialize is not known yet.
TEST_F(Probes, SerializationRunsDuringSubmissions)
{
    const Blas blas(gpu(), {Geometry{.vertices = triangleRow(1)}});
    const QueryPool pool(gpu(), VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR, 4);
    std::vector<VkCommandPool> pools(4);
    std::vector<VkCommandBuffer> commands(4);
    besideSubmissions([&](size_t thread) {
        const auto poolInfo = vkInit<VkCommandPoolCreateInfo>({.queueFamilyIndex = gpu().family()});
        VT_CHECK(vkCreateCommandPool(gpu().device(), &poolInfo, nullptr, &pools[thread]));
        const auto allocate = vkInit<VkCommandBufferAllocateInfo>(
            {.commandPool = pools[thread], .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY, .commandBufferCount = 1});
        VT_CHECK(vkAllocateCommandBuffers(gpu().device(), &allocate, &commands[thread]));
        const auto begin = vkInit<VkCommandBufferBeginInfo>();
        VT_CHECK(vkBeginCommandBuffer(commands[thread], &begin));
        const auto query = static_cast<uint32_t>(thread);
        vkCmdResetQueryPool(commands[thread], pool, query, 1);
        const VkAccelerationStructureKHR structure = blas.handle();
        gpu().vk().CmdWriteAccelerationStructuresPropertiesKHR(commands[thread], 1, &structure, pool.type(), pool,
                                                               query);
        VT_CHECK(vkEndCommandBuffer(commands[thread]));
    });
    std::vector<uint64_t> sizes(4);
    for (size_t i = 0; i < sizes.size(); ++i) {
        gpu().execute(commands[i]);
        VT_CHECK(vkGetQueryPoolResults(gpu().device(), pool, static_cast<uint32_t>(i), 1, 8, &sizes[i], 8,
                                       VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT));
        EXPECT_GT(sizes[i], 56u); // the header that the specification gives
        EXPECT_EQ(sizes[i], sizes[0]);
        vkDestroyCommandPool(gpu().device(), pools[i], nullptr);
    }
}

// The application signals what the queue waits for after it has made shaders and a pipeline, in the same thread.
// Nothing that these need of the driver may be found out on the queue.
TEST_F(Probes, CreationOfShadersDoesNotWaitForTheQueue)
{
    auto type = vkInit<VkSemaphoreTypeCreateInfo>({.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE});
    const auto semaphoreInfo = vkInit<VkSemaphoreCreateInfo>({.pNext = &type});
    VkSemaphore semaphore = VK_NULL_HANDLE;
    VT_CHECK(vkCreateSemaphore(gpu().device(), &semaphoreInfo, nullptr, &semaphore));
    const uint64_t value = 1;
    auto values = vkInit<VkTimelineSemaphoreSubmitInfo>({.waitSemaphoreValueCount = 1, .pWaitSemaphoreValues = &value});
    const VkPipelineStageFlags stage = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
    auto submit = vkInit<VkSubmitInfo>(
        {.pNext = &values, .waitSemaphoreCount = 1, .pWaitSemaphores = &semaphore, .pWaitDstStageMask = &stage});
    VT_CHECK(vkQueueSubmit(gpu().queue(), 1, &submit, VK_NULL_HANDLE));
    // A probe would end with the message VELLUM-busy-queue, which no test expects.
    const PipelineTracer pipelines(gpu(), {.groups = {{.anyHit = true}}});
    const Tracer queries(gpu());
    const auto signal = vkInit<VkSemaphoreSignalInfo>({.semaphore = semaphore, .value = value});
    VT_CHECK(vkSignalSemaphore(gpu().device(), &signal));
    VT_CHECK(vkQueueWaitIdle(gpu().queue()));
    vkDestroySemaphore(gpu().device(), semaphore, nullptr);
}

// On a queue that the driver synchronizes (VK_KHR_internally_synchronized_queues), other threads may submit while one
// waits for it, and it may wait for what they submit.
TEST(SynchronizedQueue, SubmissionWhileAnotherThreadWaits)
{
    Gpu gpu(Options{.validation = false});
    const float priority = 1;
    const auto queueInfo =
        vkInit<VkDeviceQueueCreateInfo>({.flags = VK_DEVICE_QUEUE_CREATE_INTERNALLY_SYNCHRONIZED_BIT_KHR,
                                         .queueFamilyIndex = gpu.family(),
                                         .queueCount = 1,
                                         .pQueuePriorities = &priority});
    const std::array extensions{VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
                                VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME, VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME};
    auto micromaps = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesEXT>({.micromap = VK_TRUE});
    auto structures = vkInit<VkPhysicalDeviceAccelerationStructureFeaturesKHR>(
        {.pNext = &micromaps, .accelerationStructure = VK_TRUE});
    auto vulkan12 = vkInit<VkPhysicalDeviceVulkan12Features>({.pNext = &structures, .timelineSemaphore = VK_TRUE});
    const auto info = vkInit<VkDeviceCreateInfo>({.pNext = &vulkan12,
                                                  .queueCreateInfoCount = 1,
                                                  .pQueueCreateInfos = &queueInfo,
                                                  .enabledExtensionCount = static_cast<uint32_t>(extensions.size()),
                                                  .ppEnabledExtensionNames = extensions.data()});
    VkDevice device = VK_NULL_HANDLE;
    VT_CHECK(vkCreateDevice(gpu.physical(), &info, nullptr, &device));
    const auto query = vkInit<VkDeviceQueueInfo2>({.flags = queueInfo.flags, .queueFamilyIndex = gpu.family()});
    VkQueue queue = VK_NULL_HANDLE;
    vkGetDeviceQueue2(device, &query, &queue);
    ASSERT_NE(queue, VK_NULL_HANDLE);
    auto type = vkInit<VkSemaphoreTypeCreateInfo>({.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE});
    const auto semaphoreInfo = vkInit<VkSemaphoreCreateInfo>({.pNext = &type});
    VkSemaphore semaphore = VK_NULL_HANDLE;
    VT_CHECK(vkCreateSemaphore(device, &semaphoreInfo, nullptr, &semaphore));
    const uint64_t value = 1;
    auto values = vkInit<VkTimelineSemaphoreSubmitInfo>({.waitSemaphoreValueCount = 1, .pWaitSemaphoreValues = &value});
    const VkPipelineStageFlags stage = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
    auto blocked = vkInit<VkSubmitInfo>(
        {.pNext = &values, .waitSemaphoreCount = 1, .pWaitSemaphores = &semaphore, .pWaitDstStageMask = &stage});
    VT_CHECK(vkQueueSubmit(queue, 1, &blocked, VK_NULL_HANDLE));
    auto waited = std::async(std::launch::async, [&] { return vkQueueWaitIdle(queue); });
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    auto submitted = std::async(std::launch::async, [&] {
        const auto empty = vkInit<VkSubmitInfo>();
        return vkQueueSubmit(queue, 1, &empty, VK_NULL_HANDLE);
    });
    EXPECT_EQ(submitted.wait_for(std::chrono::seconds(10)), std::future_status::ready);
    const auto signal = vkInit<VkSemaphoreSignalInfo>({.semaphore = semaphore, .value = value});
    VT_CHECK(vkSignalSemaphore(device, &signal));
    VT_CHECK(submitted.get());
    VT_CHECK(waited.get());
    vkDestroySemaphore(device, semaphore, nullptr);
    vkDestroyDevice(device, nullptr);
    gpu.takeMessages();
}

} // namespace
