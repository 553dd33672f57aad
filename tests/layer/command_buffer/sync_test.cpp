// SPDX-License-Identifier: Apache-2.0
// The stage and access bits of micromaps, wherever an application can pass them, must not reach the driver or the
// validation layer above it.
#include "command_buffer/state_scene.h"
#include "harness/program/labels.h"

namespace
{

const vt::Labels kSyncLabels{{"SyncUnvalidated.*", "one_api"}, {"SyncWithoutLayer.*", "one_api"}};

using namespace vt;

// Stage and access of VK_EXT_opacity_micromap. VK_KHR_opacity_micromap uses the bits of acceleration structures.
constexpr VkPipelineStageFlags2 kMicromapBuild = VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT;
constexpr VkPipelineStageFlags2 kStructureBuild = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR;
constexpr VkAccessFlags2 kMicromapRead = VK_ACCESS_2_MICROMAP_READ_BIT_EXT;
constexpr VkAccessFlags2 kMicromapWrite = VK_ACCESS_2_MICROMAP_WRITE_BIT_EXT;

VkMemoryBarrier2 memoryBarrier(VkPipelineStageFlags2 from, VkAccessFlags2 written, VkPipelineStageFlags2 to,
                               VkAccessFlags2 read)
{
    return vkInit<VkMemoryBarrier2>(
        {.srcStageMask = from, .srcAccessMask = written, .dstStageMask = to, .dstAccessMask = read});
}

const VkMemoryBarrier2 kBefore = memoryBarrier(VK_PIPELINE_STAGE_2_HOST_BIT, VK_ACCESS_2_HOST_WRITE_BIT, kMicromapBuild,
                                               VK_ACCESS_2_SHADER_READ_BIT);
const VkMemoryBarrier2 kMicromapToMicromap =
    memoryBarrier(kMicromapBuild, kMicromapRead | kMicromapWrite, kMicromapBuild, kMicromapRead | kMicromapWrite);
const VkMemoryBarrier2 kMicromapToStructure =
    memoryBarrier(kMicromapBuild, kMicromapWrite, kStructureBuild, kMicromapRead);
const VkMemoryBarrier2 kMixed = memoryBarrier(
    kMicromapBuild | VK_PIPELINE_STAGE_2_TRANSFER_BIT, kMicromapWrite | VK_ACCESS_2_TRANSFER_WRITE_BIT,
    kStructureBuild | VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT, kMicromapRead | VK_ACCESS_2_SHADER_READ_BIT);
const VkMemoryBarrier2 kStructureToStructure =
    memoryBarrier(kStructureBuild, VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR, kStructureBuild,
                  VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR);
const VkMemoryBarrier2 kStructureToShader = memoryBarrier(
    kStructureBuild, VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR, VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT,
    VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR | VK_ACCESS_2_SHADER_READ_BIT);

class Sync : public GpuTest
{
protected:
    using Between = std::function<void(VkCommandBuffer, const VkMemoryBarrier2 &)>;

    // Builds and traces with `between` as what orders the steps.
    void run(const Between &between)
    {
        StateScene scene(gpu());
        Tracer tracer(gpu());
        tracer.prepare(scene.tlas(), scene.rays());
        gpu().submit([&](VkCommandBuffer commands) {
            const auto order = [&](VkCommandBuffer to, const VkMemoryBarrier2 &memory) { between(to, ofApi(memory)); };
            order(commands, kBefore);
            scene.recordStep(commands, 0);
            order(commands, kMicromapToMicromap);
            scene.recordStep(commands, 0);
            order(commands, kMicromapToStructure);
            order(commands, kMixed);
            scene.recordStep(commands, 1);
            order(commands, kStructureToStructure);
            scene.recordStep(commands, 2);
            order(commands, kStructureToShader);
            tracer.bind(commands);
            tracer.dispatch(commands);
            barrier(commands);
        });
        StateScene::expectRight(tracer.results());
        expectNoMessages();
    }

    VkPipelineStageFlags2 ofApi(VkPipelineStageFlags2 stages)
    {
        return gpu().khr() && (stages & kMicromapBuild) != 0 ? (stages & ~kMicromapBuild) | kStructureBuild : stages;
    }
    VkMemoryBarrier2 ofApi(VkMemoryBarrier2 memory)
    {
        const auto access = [this](VkAccessFlags2 mask) {
            VkAccessFlags2 out = mask & ~(kMicromapRead | kMicromapWrite);
            if ((mask & kMicromapRead) != 0)
                out |= VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR;
            if ((mask & kMicromapWrite) != 0)
                out |= VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR;
            return gpu().khr() ? out : mask;
        };
        return memoryBarrier(ofApi(memory.srcStageMask), access(memory.srcAccessMask), ofApi(memory.dstStageMask),
                             access(memory.dstAccessMask));
    }

    static VkDependencyInfo dependency(const VkMemoryBarrier2 &memory)
    {
        return vkInit<VkDependencyInfo>({.memoryBarrierCount = 1, .pMemoryBarriers = &memory});
    }

    VkSemaphore semaphore()
    {
        auto info = vkInit<VkSemaphoreCreateInfo>();
        VkSemaphore out = VK_NULL_HANDLE;
        VT_CHECK(vkCreateSemaphore(gpu().device(), &info, nullptr, &out));
        return out;
    }
};

// Checks that the spy below sees the faults that these tests are about.
TEST(SyncWithoutLayer, TheSpyIsAwake)
{
    Gpu gpu({.vellum = false, .validation = false, .micromaps = false});
    const VkMemoryBarrier2 memory = kMicromapToStructure;
    auto info = vkInit<VkDependencyInfo>({.memoryBarrierCount = 1, .pMemoryBarriers = &memory});
    gpu.submit([&](VkCommandBuffer commands) { vkCmdPipelineBarrier2(commands, &info); });
    const std::vector<Message> messages = gpu.takeMessages();
    EXPECT_EQ(messages.size(), 3u) << "one stage, two accesses";
    for (const Message &m : messages)
        EXPECT_EQ(m.id, "SPY");
}

TEST_F(Sync, PipelineBarriers)
{
    run([](VkCommandBuffer commands, const VkMemoryBarrier2 &memory) {
        const VkDependencyInfo info = dependency(memory);
        vkCmdPipelineBarrier2(commands, &info);
    });
}

TEST_F(Sync, PipelineBarriersByTheirExtensionName)
{
    const auto command =
        reinterpret_cast<PFN_vkCmdPipelineBarrier2KHR>(vkGetDeviceProcAddr(gpu().device(), "vkCmdPipelineBarrier2KHR"));
    if (command == nullptr)
        GTEST_SKIP() << "no VK_KHR_synchronization2";
    run([command](VkCommandBuffer commands, const VkMemoryBarrier2 &memory) {
        const VkDependencyInfo info = dependency(memory);
        command(commands, &info);
    });
}

TEST_F(Sync, BufferBarriers)
{
    const Buffer some(gpu(), 256, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
    run([&some](VkCommandBuffer commands, const VkMemoryBarrier2 &memory) {
        auto buffer = vkInit<VkBufferMemoryBarrier2>({.srcStageMask = memory.srcStageMask,
                                                      .srcAccessMask = memory.srcAccessMask,
                                                      .dstStageMask = memory.dstStageMask,
                                                      .dstAccessMask = memory.dstAccessMask});
        buffer.srcQueueFamilyIndex = buffer.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
        buffer.buffer = some.handle();
        buffer.size = VK_WHOLE_SIZE;
        VkDependencyInfo info = dependency(memory);
        info.bufferMemoryBarrierCount = 1;
        info.pBufferMemoryBarriers = &buffer;
        vkCmdPipelineBarrier2(commands, &info);
    });
}

TEST_F(Sync, Events)
{
    auto create = vkInit<VkEventCreateInfo>({.flags = VK_EVENT_CREATE_DEVICE_ONLY_BIT});
    std::vector<VkEvent> events;
    run([&](VkCommandBuffer commands, const VkMemoryBarrier2 &memory) {
        VkDependencyInfo info = dependency(memory);
        if ((memory.srcStageMask & VK_PIPELINE_STAGE_2_HOST_BIT) != 0) {
            vkCmdPipelineBarrier2(commands, &info);
            return;
        }
        VkEvent event = VK_NULL_HANDLE;
        VT_CHECK(vkCreateEvent(gpu().device(), &create, nullptr, &event));
        events.push_back(event);
        vkCmdSetEvent2(commands, event, &info);
        vkCmdWaitEvents2(commands, 1, &event, &info);
        vkCmdResetEvent2(commands, event, memory.dstStageMask);
        vkCmdPipelineBarrier2(commands, &info);
    });
    for (const VkEvent event : events)
        vkDestroyEvent(gpu().device(), event, nullptr);
}

TEST_F(Sync, Submissions)
{
    StateScene scene(gpu());
    const VkSemaphore ready = semaphore();
    VkCommandBuffer builds = gpu().begin();
    scene.recordStep(builds, 0);
    gpu().end(builds);
    VkCommandBuffer rest = gpu().begin();
    scene.recordStep(rest, 1);
    barrier(rest);
    scene.recordStep(rest, 2);
    barrier(rest);
    gpu().end(rest);
    std::array<VkCommandBufferSubmitInfo, 2> commands{};
    std::array<VkSemaphoreSubmitInfo, 2> semaphores{};
    for (size_t i = 0; i < 2; ++i) {
        commands[i] = vkInit<VkCommandBufferSubmitInfo>({.commandBuffer = i == 0 ? builds : rest});
        semaphores[i] = vkInit<VkSemaphoreSubmitInfo>(
            {.semaphore = ready, .stageMask = ofApi(i == 0 ? kMicromapBuild : kMicromapBuild | kStructureBuild)});
    }
    std::array<VkSubmitInfo2, 2> submissions{};
    for (size_t i = 0; i < 2; ++i) {
        submissions[i] = vkInit<VkSubmitInfo2>({.commandBufferInfoCount = 1, .pCommandBufferInfos = &commands[i]});
    }
    submissions[0].signalSemaphoreInfoCount = 1;
    submissions[0].pSignalSemaphoreInfos = &semaphores[0];
    submissions[1].waitSemaphoreInfoCount = 1;
    submissions[1].pWaitSemaphoreInfos = &semaphores[1];
    VT_CHECK(vkQueueSubmit2(gpu().queue(), 2, submissions.data(), VK_NULL_HANDLE));
    VT_CHECK(vkQueueWaitIdle(gpu().queue()));
    scene.expectRight();
    vkDestroySemaphore(gpu().device(), ready, nullptr);
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &builds);
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &rest);
}

TEST_F(Sync, Timestamps)
{
    StateScene scene(gpu());
    const QueryPool pool(gpu(), VK_QUERY_TYPE_TIMESTAMP, 2);
    gpu().submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, 2);
        vkCmdWriteTimestamp2(commands, ofApi(kMicromapBuild), pool, 0);
        scene.record(commands);
        vkCmdWriteTimestamp2(commands, ofApi(kMicromapBuild), pool, 1);
    });
    std::array<uint64_t, 2> times{};
    VT_CHECK(vkGetQueryPoolResults(gpu().device(), pool, 0, 2, sizeof(times), times.data(), 8,
                                   VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT));
    EXPECT_LE(times[0], times[1]);
    scene.expectRight();
}

class SyncUnvalidated : public GpuTest
{
protected:
    SyncUnvalidated() : GpuTest(Options{.validation = false, .api = Api::Ext}) {}
};

// The spy has the command where the driver has not, and looks at the stage.
TEST_F(SyncUnvalidated, BufferMarkers)
{
    const auto write = reinterpret_cast<PFN_vkCmdWriteBufferMarker2AMD>(
        vkGetDeviceProcAddr(gpu().device(), "vkCmdWriteBufferMarker2AMD"));
    if (write == nullptr)
        GTEST_SKIP() << "the loader hides the command";
    const Buffer marker(gpu(), 16, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    gpu().submit([&](VkCommandBuffer commands) {
        write(commands, VK_PIPELINE_STAGE_2_MICROMAP_BUILD_BIT_EXT, marker.handle(), 0, 1);
    });
}

// VK_ARM_tensors, which lavapipe ignores.
TEST_F(SyncUnvalidated, TensorBarriers)
{
    const VkTensorMemoryBarrierARM barrier{VK_STRUCTURE_TYPE_TENSOR_MEMORY_BARRIER_ARM,
                                           nullptr,
                                           kMicromapBuild,
                                           kMicromapWrite,
                                           kMicromapBuild,
                                           kMicromapRead,
                                           VK_QUEUE_FAMILY_IGNORED,
                                           VK_QUEUE_FAMILY_IGNORED,
                                           VK_NULL_HANDLE};
    const std::array barriers{barrier, barrier};
    const VkTensorDependencyInfoARM several{VK_STRUCTURE_TYPE_TENSOR_DEPENDENCY_INFO_ARM, &barrier, 2, barriers.data()};
    auto info = vkInit<VkDependencyInfo>({.pNext = &several});
    gpu().submit([&](VkCommandBuffer commands) { vkCmdPipelineBarrier2(commands, &info); });
    EXPECT_EQ(barriers[1].srcStageMask, kMicromapBuild) << "the application's structures are its own";
}

TEST_F(Sync, RenderPassDependencies)
{
    auto attachment = vkInit<VkAttachmentDescription2>({.format = VK_FORMAT_R8G8B8A8_UNORM,
                                                        .samples = VK_SAMPLE_COUNT_1_BIT,
                                                        .loadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE,
                                                        .finalLayout = VK_IMAGE_LAYOUT_GENERAL});
    auto reference = vkInit<VkAttachmentReference2>(
        {.layout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL, .aspectMask = VK_IMAGE_ASPECT_COLOR_BIT});
    auto subpass = vkInit<VkSubpassDescription2>({.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS,
                                                  .colorAttachmentCount = 1,
                                                  .pColorAttachments = &reference});
    const VkMemoryBarrier2 in = ofApi(memoryBarrier(
        kMicromapBuild | kStructureBuild, kMicromapWrite | VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
        VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT, VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR));
    const VkMemoryBarrier2 out =
        ofApi(memoryBarrier(VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT, 0, kMicromapBuild, kMicromapWrite));
    std::array<VkSubpassDependency2, 2> dependencies{};
    for (size_t i = 0; i < 2; ++i) {
        dependencies[i] = vkInit<VkSubpassDependency2>({.pNext = i == 0 ? &in : &out,
                                                        .srcSubpass = i == 0 ? VK_SUBPASS_EXTERNAL : 0,
                                                        .dstSubpass = i == 0 ? 0 : VK_SUBPASS_EXTERNAL});
    }
    auto info = vkInit<VkRenderPassCreateInfo2>({.attachmentCount = 1,
                                                 .pAttachments = &attachment,
                                                 .subpassCount = 1,
                                                 .pSubpasses = &subpass,
                                                 .dependencyCount = 2,
                                                 .pDependencies = dependencies.data()});
    VkRenderPass pass = VK_NULL_HANDLE;
    VT_CHECK(vkCreateRenderPass2(gpu().device(), &info, nullptr, &pass));
    vkDestroyRenderPass(gpu().device(), pass, nullptr);
    EXPECT_EQ(dependencies[0].pNext, &in) << "the application's structures are its own";
    EXPECT_EQ(in.srcStageMask, ofApi(kMicromapBuild | kStructureBuild));
}

} // namespace
