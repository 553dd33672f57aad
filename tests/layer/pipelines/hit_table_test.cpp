// SPDX-License-Identifier: Apache-2.0
// Traces without a hit table, and hit tables that are shorter than the record indices of what rays meet. A ray whose
// hits are all opaque or culled, and that skips closest-hit shaders, reads no hit record ("Ray Intersection
// Confirmation", "Ray Result Determination"): applications need not have one for it.
#include <algorithm>
#include <array>

#include "command_buffer/inherited_state.h"
#include "pipelines/pipeline_scene.h"

#include "shaders/pipeline_constant_209.h"

namespace
{

using namespace vt;

enum class Command { Direct, Indirect, Indirect2 };
constexpr std::array kCommands{Command::Direct, Command::Indirect, Command::Indirect2};

// Intersection shaders would need a record.
constexpr uint32_t kTrianglesOnly = kRaySkipBoxes | kRaySkipClosestHit;

// Ray flags with which no hit record of triangles is read.
std::vector<uint32_t> recordlessFlags()
{
    std::vector<uint32_t> flags;
    for (const uint32_t opacity : {kRayOpaque, kRayCullNoOpaque}) {
        for (const uint32_t other : {0u, kRayTerminateOnFirstHit, kRayForceTwoState})
            flags.push_back(kRaySkipClosestHit | opacity | other);
    }
    return flags;
}

class HitTables : public PipelineTest
{
protected:
    explicit HitTables(const Options &options = {.maintenance = true}) : PipelineTest(options) {}

    // Without hit groups: only ray generation and miss shaders.
    static PipelineTracerSetup withoutHitGroups()
    {
        PipelineTracerSetup setup{.groups = {}};
        setup.make = [](Device &g, const PipelineSetup &from) {
            PipelineSetup pipeline = from;
            pipeline.stages.resize(2);
            return MadePipeline{RayPipeline(g, pipeline), {}};
        };
        return setup;
    }

    static VkTraceRaysIndirectCommand2KHR commandOf(const PipelineTracer &tracer,
                                                    const VkStridedDeviceAddressRegionKHR &hit)
    {
        const BindingTable &table = tracer.table();
        return {table.raygen.deviceAddress,
                table.raygen.size,
                table.miss.deviceAddress,
                table.miss.size,
                table.miss.stride,
                hit.deviceAddress,
                hit.size,
                hit.stride,
                0,
                0,
                0,
                tracer.rayCount(),
                1,
                1};
    }

    void trace(PipelineTracer &tracer, const VkStridedDeviceAddressRegionKHR &hit, Command command)
    {
        const BindingTable &table = tracer.table();
        const VkTraceRaysIndirectCommandKHR size{tracer.rayCount(), 1, 1};
        const VkTraceRaysIndirectCommand2KHR all = commandOf(tracer, hit);
        std::memcpy(command_.bytes(), &size, sizeof size);
        std::memcpy(command_.bytes() + 256, &all, sizeof all);
        tracer.clearResults();
        gpu().submit([&](VkCommandBuffer commands) {
            tracer.bind(commands);
            if (command == Command::Direct)
                gpu().vk().CmdTraceRaysKHR(commands, &table.raygen, &table.miss, &hit, &table.callable,
                                           tracer.rayCount(), 1, 1);
            else if (command == Command::Indirect)
                gpu().vk().CmdTraceRaysIndirectKHR(commands, &table.raygen, &table.miss, &hit, &table.callable,
                                                   command_.address());
            else
                gpu().vk().CmdTraceRaysIndirect2KHR(commands, command_.address() + 256);
            barrier(commands);
        });
    }

    // The rays of a scene, by every command.
    void expect(PipelineTracer &tracer, const PipelineScene &scene, const VkStridedDeviceAddressRegionKHR &hit,
                uint32_t flags, const PipelineScene::View &view = {})
    {
        for (const Command command : kCommands) {
            if (command == Command::Indirect2 && !gpu().vk().CmdTraceRaysIndirect2KHR)
                continue;
            SCOPED_TRACE(testing::Message() << "command " << static_cast<int>(command) << ", address "
                                            << hit.deviceAddress << ", stride " << hit.stride << ", size " << hit.size);
            tracer.prepare(scene.tlas(), scene.rays(view.runTimeFlags.value_or(flags)), 4);
            trace(tracer, hit, command);
            scene.expect(tracer.results(), flags, view);
        }
    }

    void SetUp() override
    {
        PipelineTest::SetUp();
        if (!IsSkipped())
            command_ =
                Buffer(gpu(), 1024, VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    }
    void TearDown() override
    {
        command_ = {};
        PipelineTest::TearDown();
    }

    Buffer command_;
};

// Without hit groups, the table is a null region, one of no bytes, or one that is too small for a record.
TEST_F(HitTables, NoRecords)
{
    PipelineTracer tracer(gpu(), withoutHitGroups());
    const PipelineTracer other(gpu());
    const VkStridedDeviceAddressRegionKHR &region = other.table().hit;
    for (const uint32_t record : {0u, 50u, 10'000'000u}) {
        SCOPED_TRACE(testing::Message() << "record " << record);
        const PipelineScene scene(gpu(), {.triangleRecord = record});
        for (const uint32_t flags : recordlessFlags()) {
            for (const VkDeviceSize size : {VkDeviceSize{0}, VkDeviceSize{16}})
                expect(tracer, scene, {region.deviceAddress, region.stride, size}, flags | kRaySkipBoxes,
                       {.missFlags = false});
            expect(tracer, scene, {}, flags | kRaySkipBoxes, {.missFlags = false});
        }
    }
}

// Constant flags, and hit groups that no table names.
TEST_F(HitTables, NoRecordsWithConstantFlags)
{
    PipelineTracer tracer(gpu(), {.raygen = pipeline_constant_209, .groups = {{}}});
    constexpr uint32_t kFlags = kRayOpaque | kTrianglesOnly;
    const PipelineScene scene(gpu(), {.triangleRecord = 50});
    const PipelineScene::View view{.runTimeFlags = 0, .constantFlags = true};
    expect(tracer, scene, {}, kFlags, view);
    expect(tracer, scene, tracer.table().hit, kFlags, view);
}

// Geometry without any micromap.
TEST_F(HitTables, NoRecordsWithoutMicromaps)
{
    PipelineTracer tracer(gpu(), withoutHitGroups());
    const PipelineScene scene(gpu(), {.micromaps = false, .triangleRecord = 50});
    expect(tracer, scene, {}, kRayOpaque | kTrianglesOnly, {.missFlags = false});
}

// A null region has null hit records: every non-opaque hit is confirmed, and no shader runs.
TEST_F(HitTables, NoRecordsForAnyRay)
{
    PipelineTracer tracer(gpu(), withoutHitGroups());
    const PipelineScene scene(gpu(), {.triangleRecord = 7});
    for (const uint32_t flags : opacityRayFlags())
        expect(tracer, scene, {}, flags | kRaySkipBoxes,
               {.triangleAnyHit = false, .triangleClosestHit = false, .missFlags = false});
}

// The only record is record 0 of the scene.
TEST_F(HitTables, OneRecord)
{
    for (const bool zero : {false, true}) {
        PipelineTracer tracer(gpu(), {.groups = {{}}, .records = {zero ? std::nullopt : std::optional(0u)}});
        for (const uint32_t record : {0u, 1u, 50u, 100'000u, 10'000'000u}) {
            SCOPED_TRACE(testing::Message() << "record " << record);
            const PipelineScene scene(gpu(), {.triangleRecord = record});
            const PipelineScene::View view{.triangleAnyHit = !zero, .triangleClosestHit = !zero};
            for (const uint32_t flags : record == 0 ? opacityRayFlags() : recordlessFlags())
                expect(tracer, scene, tracer.table().hit, flags | kRaySkipBoxes, view);
        }
    }
}

// The only record is of a procedural hit group: those of triangles are beyond it.
TEST_F(HitTables, OneRecordOfBoxes)
{
    PipelineTracer tracer(gpu(), {.groups = {{.box = true}}});
    for (const uint32_t record : {1u, 50u, 100'000u}) {
        SCOPED_TRACE(testing::Message() << "record " << record);
        const PipelineScene scene(gpu(), {.triangleRecord = record, .boxRecord = 0});
        for (const uint32_t flags : recordlessFlags())
            expect(tracer, scene, tracer.table().hit, flags);
    }
}

// As above, with a procedural hit group of a library.
TEST_F(HitTables, OneRecordOfALibrary)
{
    if (!gpu().has(VK_KHR_PIPELINE_LIBRARY_EXTENSION_NAME))
        GTEST_SKIP() << "no pipeline libraries";
    std::optional<RayPipeline> library;
    PipelineTracerSetup setup{.groups = {{.box = true}}};
    setup.make = [&](Device &g, const PipelineSetup &from) {
        PipelineSetup part = from;
        part.flags |= VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
        part.groups.erase(part.groups.begin(), part.groups.begin() + 2);
        library.emplace(g, part);
        PipelineSetup linking = from;
        linking.stages.resize(2);
        linking.groups.resize(2);
        linking.libraries = {library->handle()};
        return MadePipeline{RayPipeline(g, linking), {}};
    };
    PipelineTracer tracer(gpu(), setup);
    const PipelineScene scene(gpu(), {.triangleRecord = 3, .boxRecord = 0});
    for (const uint32_t flags : recordlessFlags())
        expect(tracer, scene, tracer.table().hit, flags);
}

// Two records, one of which boxes use.
TEST_F(HitTables, SomeRecords)
{
    PipelineTracer tracer(gpu());
    for (const uint32_t record : {2u, 50u, 5000u, 100'000u}) {
        SCOPED_TRACE(testing::Message() << "record " << record);
        const PipelineScene scene(gpu(), {.triangleRecord = record});
        for (const uint32_t flags : recordlessFlags())
            expect(tracer, scene, tracer.table().hit, flags);
    }
    // Records in the table are still used.
    const PipelineScene scene(gpu());
    for (const uint32_t flags : opacityRayFlags())
        expect(tracer, scene, tracer.table().hit, flags);
}

// A size that is not a multiple of the stride: the remainder holds no handle.
TEST_F(HitTables, PartOfARecord)
{
    PipelineTracer tracer(gpu(), {.records = {0, 1, 1}});
    VkStridedDeviceAddressRegionKHR hit = tracer.table().hit;
    hit.size = 2 * hit.stride + 16;
    const PipelineScene scene(gpu(), {.triangleRecord = 2});
    for (const uint32_t flags : recordlessFlags())
        expect(tracer, scene, hit, flags);
}

// Indices beyond the table by what the trace adds: its offset, and its stride for the second geometry.
TEST_F(HitTables, OffsetAndStrideOfTheTrace)
{
    const PipelineScene scene(gpu());
    for (const bool one : {false, true}) {
        PipelineTracerSetup setup{.sbtOffset = 15, .sbtStride = 15};
        if (one)
            setup.groups = {{}};
        PipelineTracer tracer(gpu(), setup);
        for (const uint32_t flags : recordlessFlags())
            expect(tracer, scene, tracer.table().hit, flags | kRaySkipBoxes);
    }
}

// A command buffer that two queues may execute at once: no trace writes what another one reads. The spy looks at that
// (layers/spy_pipelines.cpp), since lavapipe has one queue.
TEST_F(HitTables, SimultaneousUse)
{
    PipelineTracer tracer(gpu(), {.records = {0, 1, 0}});
    const PipelineScene scene(gpu());
    const BindingTable &table = tracer.table();
    const VkDeviceSize stride = table.hit.stride;
    for (const bool indirect : {false, true}) {
        if (indirect && !gpu().vk().CmdTraceRaysIndirect2KHR)
            continue;
        tracer.prepare(scene.tlas(), scene.rays(0), 4);
        tracer.clearResults();
        VkCommandBuffer commands = gpu().begin(VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT);
        tracer.bind(commands);
        for (const uint32_t records : {3u, 2u}) {
            const VkStridedDeviceAddressRegionKHR hit{table.hit.deviceAddress, stride, records * stride};
            const VkTraceRaysIndirectCommand2KHR command = commandOf(tracer, hit);
            const VkDeviceSize offset = VkDeviceSize{256} * records;
            std::memcpy(command_.bytes() + offset, &command, sizeof command);
            if (indirect)
                gpu().vk().CmdTraceRaysIndirect2KHR(commands, command_.address() + offset);
            else
                gpu().vk().CmdTraceRaysKHR(commands, &table.raygen, &table.miss, &hit, &table.callable,
                                           tracer.rayCount(), 1, 1);
            barrier(commands);
        }
        gpu().end(commands);
        gpu().execute(commands);
        scene.expect(tracer.results(), 0);
        vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &commands);
    }
}

// As above, with a table so large that the driver copies it for other command buffers, null records included.
TEST_F(HitTables, SimultaneousUseOfALargeTable)
{
    PipelineTracerSetup setup;
    setup.records.assign(2000, std::nullopt);
    PipelineTracer tracer(gpu(), setup);
    const PipelineScene scene(gpu(), {.triangleRecord = 1999, .boxRecord = 1998});
    constexpr uint32_t kFlags = kTrianglesOnly | kRayOpaque;
    tracer.prepare(scene.tlas(), scene.rays(kFlags), 4);
    tracer.clearResults();
    VkCommandBuffer commands = gpu().begin(VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT);
    tracer.bind(commands);
    tracer.dispatch(commands);
    barrier(commands);
    gpu().end(commands);
    gpu().execute(commands);
    scene.expect(tracer.results(), kFlags);
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &commands);
}

// A table that changes between two traces of a command buffer, which is submitted twice. Each kind of dependency that
// makes the change visible is as weak as the specification allows.
class ChangedHitTables : public HitTables
{
protected:
    void SetUp() override
    {
        HitTables::SetUp();
        if (IsSkipped())
            return;
        tracer_.emplace(gpu());
        scene_.emplace(gpu());
        stride_ = tracer_->table().hit.stride;
        source_ = Buffer(gpu(), stride_ * 4, VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
        table_ = Buffer(gpu(), stride_ * 2 + 256,
                        VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
                            VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
        base_ = (table_.address() + 63) / 64 * 64;
        std::memset(source_.bytes(), 0, stride_ * 4);
        put(0, 2, 100);
        put(1, 3, 101);
        put(2, std::nullopt, 100);
        put(3, 3, 101);
    }
    void TearDown() override
    {
        table_ = {};
        source_ = {};
        scene_.reset();
        tracer_.reset();
        HitTables::TearDown();
    }

    void put(size_t record, std::optional<uint32_t> group, uint32_t data)
    {
        const size_t handle = gpu().pipelineProperties().shaderGroupHandleSize;
        uint8_t *at = source_.bytes() + record * stride_;
        if (group)
            std::memcpy(at, tracer_->pipeline().groupHandles(*group).data(), handle);
        std::memcpy(at + handle, &data, sizeof data);
    }

    // Copies a content into the table: one that has all records, or one that lacks that of triangles.
    void write(VkCommandBuffer commands, bool lacks) const
    {
        const VkBufferCopy region{lacks ? 2 * stride_ : 0, base_ - table_.address(), stride_ * 2};
        vkCmdCopyBuffer(commands, source_.handle(), table_.handle(), 1, &region);
    }

    void traceOnce(VkCommandBuffer commands)
    {
        const BindingTable &own = tracer_->table();
        const VkStridedDeviceAddressRegionKHR hit{base_, stride_, stride_ * 2};
        tracer_->bind(commands);
        gpu().vk().CmdTraceRaysKHR(commands, &own.raygen, &own.miss, &hit, &own.callable, tracer_->rayCount(), 1, 1);
    }

    // A barrier that makes nothing visible to reads of tables.
    static void order(VkCommandBuffer commands, VkPipelineStageFlags from, VkPipelineStageFlags to,
                      VkAccessFlags written, VkAccessFlags writes)
    {
        const auto memory = vkInit<VkMemoryBarrier>({.srcAccessMask = written, .dstAccessMask = writes});
        vkCmdPipelineBarrier(commands, from, to, 0, 1, &memory, 0, nullptr, 0, nullptr);
    }

    // Traces, changes the table, calls show(commands), and traces again.
    template <typename Show>
    void expectChange(const char *name, Show show)
    {
        SCOPED_TRACE(name);
        for (const bool lacks : {false, true}) {
            tracer_->prepare(scene_->tlas(), scene_->rays(0), 4);
            VkCommandBuffer commands = gpu().begin(0);
            write(commands, !lacks);
            barrier(commands);
            traceOnce(commands);
            order(commands, kTraces, VK_PIPELINE_STAGE_TRANSFER_BIT, 0, VK_ACCESS_TRANSFER_WRITE_BIT);
            write(commands, lacks);
            show(commands);
            order(commands, kTraces, kTraces, VK_ACCESS_SHADER_WRITE_BIT, VK_ACCESS_SHADER_WRITE_BIT);
            traceOnce(commands);
            barrier(commands);
            gpu().end(commands);
            for (int i = 0; i < 2; ++i) {
                tracer_->clearResults();
                gpu().execute(commands);
                scene_->expect(tracer_->results(), 0, {.triangleAnyHit = !lacks, .triangleClosestHit = !lacks});
            }
            vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &commands);
        }
    }

    static constexpr VkPipelineStageFlags kCopies = VK_PIPELINE_STAGE_TRANSFER_BIT;
    static constexpr VkPipelineStageFlags kTraces = VK_PIPELINE_STAGE_RAY_TRACING_SHADER_BIT_KHR;
    const VkMemoryBarrier memory_ = vkInit<VkMemoryBarrier>(
        {.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT, .dstAccessMask = VK_ACCESS_SHADER_READ_BIT});
    std::optional<PipelineTracer> tracer_;
    std::optional<PipelineScene> scene_;
    VkDeviceSize stride_ = 0;
    VkDeviceAddress base_ = 0;
    Buffer source_, table_;
};

TEST_F(ChangedHitTables, ShownByBarriers)
{
    expectChange("memory barrier", [&](VkCommandBuffer commands) {
        vkCmdPipelineBarrier(commands, kCopies, kTraces, 0, 1, &memory_, 0, nullptr, 0, nullptr);
    });
    expectChange("buffer barrier", [&](VkCommandBuffer commands) {
        const auto buffer = vkInit<VkBufferMemoryBarrier>({.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT,
                                                           .dstAccessMask = VK_ACCESS_SHADER_READ_BIT,
                                                           .srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                                           .dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
                                                           .buffer = table_.handle(),
                                                           .offset = 0,
                                                           .size = VK_WHOLE_SIZE});
        vkCmdPipelineBarrier(commands, kCopies, kTraces, 0, 0, nullptr, 1, &buffer, 0, nullptr);
    });
    const std::pair<VkPipelineStageFlags2, VkAccessFlags2> kinds[] = {
        {VK_PIPELINE_STAGE_2_RAY_TRACING_SHADER_BIT_KHR, VK_ACCESS_2_SHADER_BINDING_TABLE_READ_BIT_KHR},
        {VK_PIPELINE_STAGE_2_RAY_TRACING_SHADER_BIT_KHR, VK_ACCESS_2_SHADER_READ_BIT},
        {VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, VK_ACCESS_2_MEMORY_READ_BIT}};
    for (const auto &[stage, access] : kinds)
        expectChange("barrier 2", [stage, access](VkCommandBuffer commands) {
            const auto memory = vkInit<VkMemoryBarrier2>({.srcStageMask = VK_PIPELINE_STAGE_2_COPY_BIT,
                                                          .srcAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT,
                                                          .dstStageMask = stage,
                                                          .dstAccessMask = access});
            const auto info = vkInit<VkDependencyInfo>({.memoryBarrierCount = 1, .pMemoryBarriers = &memory});
            vkCmdPipelineBarrier2(commands, &info);
        });
}

TEST_F(ChangedHitTables, ShownByEvents)
{
    const auto eventInfo = vkInit<VkEventCreateInfo>();
    VkEvent event = VK_NULL_HANDLE;
    VT_CHECK(vkCreateEvent(gpu().device(), &eventInfo, nullptr, &event));
    expectChange("event", [&](VkCommandBuffer commands) {
        vkCmdResetEvent(commands, event, kCopies);
        vkCmdPipelineBarrier(commands, kCopies, kCopies, 0, 0, nullptr, 0, nullptr, 0, nullptr);
        vkCmdSetEvent(commands, event, kCopies);
        vkCmdWaitEvents(commands, 1, &event, kCopies, kTraces, 1, &memory_, 0, nullptr, 0, nullptr);
    });
    expectChange("event 2", [&](VkCommandBuffer commands) {
        const auto memory = vkInit<VkMemoryBarrier2>({.srcStageMask = VK_PIPELINE_STAGE_2_COPY_BIT,
                                                      .srcAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT,
                                                      .dstStageMask = VK_PIPELINE_STAGE_2_RAY_TRACING_SHADER_BIT_KHR,
                                                      .dstAccessMask = VK_ACCESS_2_SHADER_READ_BIT});
        const auto info = vkInit<VkDependencyInfo>({.memoryBarrierCount = 1, .pMemoryBarriers = &memory});
        vkCmdResetEvent2(commands, event, VK_PIPELINE_STAGE_2_COPY_BIT);
        vkCmdPipelineBarrier(commands, kCopies, kCopies, 0, 0, nullptr, 0, nullptr, 0, nullptr);
        vkCmdSetEvent2(commands, event, &info);
        vkCmdWaitEvents2(commands, 1, &event, &info);
    });
    vkDestroyEvent(gpu().device(), event, nullptr);
}

// The dependencies of a render pass without attachments.
TEST_F(ChangedHitTables, ShownByRenderPasses)
{
    const VkSubpassDescription subpass{.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS};
    constexpr VkPipelineStageFlags kGraphics = VK_PIPELINE_STAGE_ALL_GRAPHICS_BIT;
    const VkSubpassDependency dependencies[] = {
        {VK_SUBPASS_EXTERNAL, 0, kCopies, kGraphics, VK_ACCESS_TRANSFER_WRITE_BIT, VK_ACCESS_SHADER_READ_BIT, 0},
        {0, VK_SUBPASS_EXTERNAL, kGraphics, kTraces, 0, VK_ACCESS_SHADER_READ_BIT, 0}};
    const auto passInfo = vkInit<VkRenderPassCreateInfo>(
        {.subpassCount = 1, .pSubpasses = &subpass, .dependencyCount = 2, .pDependencies = dependencies});
    VkRenderPass pass = VK_NULL_HANDLE;
    VT_CHECK(vkCreateRenderPass(gpu().device(), &passInfo, nullptr, &pass));
    const auto framebufferInfo =
        vkInit<VkFramebufferCreateInfo>({.renderPass = pass, .width = 1, .height = 1, .layers = 1});
    VkFramebuffer framebuffer = VK_NULL_HANDLE;
    VT_CHECK(vkCreateFramebuffer(gpu().device(), &framebufferInfo, nullptr, &framebuffer));
    const auto beginInfo =
        vkInit<VkRenderPassBeginInfo>({.renderPass = pass, .framebuffer = framebuffer, .renderArea = {{0, 0}, {1, 1}}});
    expectChange("render pass", [&](VkCommandBuffer commands) {
        vkCmdBeginRenderPass(commands, &beginInfo, VK_SUBPASS_CONTENTS_INLINE);
        vkCmdEndRenderPass(commands);
    });
    expectChange("render pass 2", [&](VkCommandBuffer commands) {
        const auto subpassBegin = vkInit<VkSubpassBeginInfo>({.contents = VK_SUBPASS_CONTENTS_INLINE});
        const auto subpassEnd = vkInit<VkSubpassEndInfo>();
        vkCmdBeginRenderPass2(commands, &beginInfo, &subpassBegin);
        vkCmdEndRenderPass2(commands, &subpassEnd);
    });
    vkDestroyFramebuffer(gpu().device(), framebuffer, nullptr);
    vkDestroyRenderPass(gpu().device(), pass, nullptr);
}

// The barrier is in a secondary command buffer.
TEST_F(ChangedHitTables, ShownBySecondaryCommandBuffers)
{
    const auto info = vkInit<VkCommandBufferAllocateInfo>(
        {.commandPool = gpu().pool(), .level = VK_COMMAND_BUFFER_LEVEL_SECONDARY, .commandBufferCount = 1});
    VkCommandBuffer secondary = VK_NULL_HANDLE;
    VT_CHECK(vkAllocateCommandBuffers(gpu().device(), &info, &secondary));
    const auto inherited = vkInit<VkCommandBufferInheritanceInfo>();
    const auto begin = vkInit<VkCommandBufferBeginInfo>(
        {.flags = VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT, .pInheritanceInfo = &inherited});
    VT_CHECK(vkBeginCommandBuffer(secondary, &begin));
    vkCmdPipelineBarrier(secondary, kCopies, kTraces, 0, 1, &memory_, 0, nullptr, 0, nullptr);
    VT_CHECK(vkEndCommandBuffer(secondary));
    expectChange("secondary", [&](VkCommandBuffer commands) { vkCmdExecuteCommands(commands, 1, &secondary); });
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &secondary);
}

// Traces of two tables in turns, with nothing between that could change them; another pipeline with the same table, and
// a top-level structure whose instances reach further, built between two traces.
TEST_F(ChangedHitTables, TablesInTurns)
{
    constexpr uint32_t kRecord = 5000;
    PipelineTracer other(gpu());
    const PipelineScene far(gpu(), {.triangleRecord = kRecord});
    tracer_->prepare(scene_->tlas(), scene_->rays(0), 4);
    other.prepare(far.tlas(), far.rays(kRaySkipClosestHit | kRayOpaque), 4);
    VkCommandBuffer commands = gpu().begin(0);
    write(commands, true);
    barrier(commands);
    for (int i = 0; i < 3; ++i) {
        traceOnce(commands);
        other.bind(commands);
        other.dispatch(commands);
        order(commands, kTraces, kTraces, VK_ACCESS_SHADER_WRITE_BIT, VK_ACCESS_SHADER_WRITE_BIT);
    }
    barrier(commands);
    gpu().end(commands);
    tracer_->clearResults();
    other.clearResults();
    gpu().execute(commands);
    scene_->expect(tracer_->results(), 0, {.triangleAnyHit = false, .triangleClosestHit = false});
    far.expect(other.results(), kRaySkipClosestHit | kRayOpaque);
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &commands);
}

// Memory for the tables of indirect traces, whose size only the GPU knows, on a device with 8 GiB.
class HitTablesOfManyCommandBuffers : public HitTables
{
protected:
    HitTablesOfManyCommandBuffers() : HitTables({.validation = false, .quirks = "discrete", .maintenance = true}) {}
};

// Each pool's command buffers need 3 GiB, which a reset releases, with or without their other resources.
TEST_F(HitTablesOfManyCommandBuffers, GoBack)
{
    if (!gpu().vk().CmdTraceRaysIndirect2KHR)
        GTEST_SKIP() << "no vkCmdTraceRaysIndirect2KHR";
    constexpr uint32_t kCommandBuffers = 190;
    const PipelineTracer tracer(gpu());
    const auto poolInfo = vkInit<VkCommandPoolCreateInfo>(
        {.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT, .queueFamilyIndex = gpu().family()});
    std::vector<VkCommandPool> pools;
    enum class Reset { Pool, WholePool, CommandBuffers, WholeCommandBuffers, AndTrim };
    for (const Reset reset : {Reset::Pool, Reset::WholePool, Reset::CommandBuffers, Reset::WholeCommandBuffers,
                              Reset::AndTrim, Reset::Pool}) {
        VkCommandPool pool = VK_NULL_HANDLE;
        VT_CHECK(vkCreateCommandPool(gpu().device(), &poolInfo, nullptr, &pool));
        pools.push_back(pool); // they stay, with all command buffers
        const auto info =
            vkInit<VkCommandBufferAllocateInfo>({.commandPool = pool, .commandBufferCount = kCommandBuffers});
        std::vector<VkCommandBuffer> buffers(kCommandBuffers);
        VT_CHECK(vkAllocateCommandBuffers(gpu().device(), &info, buffers.data()));
        for (const VkCommandBuffer commands : buffers) {
            const auto begin = vkInit<VkCommandBufferBeginInfo>();
            VT_CHECK(vkBeginCommandBuffer(commands, &begin));
            tracer.bind(commands);
            gpu().vk().CmdTraceRaysIndirect2KHR(commands, command_.address());
            VT_CHECK(vkEndCommandBuffer(commands));
        }
        if (reset == Reset::CommandBuffers || reset == Reset::WholeCommandBuffers) {
            for (const VkCommandBuffer commands : buffers)
                VT_CHECK(vkResetCommandBuffer(
                    commands, reset == Reset::CommandBuffers ? 0 : VK_COMMAND_BUFFER_RESET_RELEASE_RESOURCES_BIT));
        } else {
            VT_CHECK(vkResetCommandPool(gpu().device(), pool,
                                        reset == Reset::WholePool ? VK_COMMAND_POOL_RESET_RELEASE_RESOURCES_BIT : 0));
        }
        if (reset == Reset::AndTrim)
            vkTrimCommandPool(gpu().device(), pool, 0);
        for (const Message &m : gpu().takeUnexpectedMessages())
            ADD_FAILURE() << "reset " << static_cast<int>(reset) << ": " << m.id << ": " << m.text;
    }
    for (const VkCommandPool pool : pools)
        vkDestroyCommandPool(gpu().device(), pool, nullptr);
}

// In command buffers that inherit conditional rendering, the layer injects no work.
class HitTablesInherited : public HitTables
{
protected:
    HitTablesInherited() : HitTables({.validation = false}) {}
};

TEST_F(HitTablesInherited, ConditionalRendering)
{
    if (!gpu().has(VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME))
        GTEST_SKIP() << "no VK_EXT_conditional_rendering";
    constexpr uint32_t kFlags = kTrianglesOnly | kRayOpaque;
    PipelineTracer tracer(gpu(), {.groups = {{}}});
    const PipelineScene scene(gpu(), {.triangleRecord = 1000});
    const BindingTable &table = tracer.table();
    for (const VkStridedDeviceAddressRegionKHR &hit : {VkStridedDeviceAddressRegionKHR{}, table.hit}) {
        tracer.prepare(scene.tlas(), scene.rays(kFlags), 4);
        tracer.clearResults();
        VkCommandBuffer secondary = beginInheritingCondition(gpu());
        tracer.bind(secondary);
        gpu().vk().CmdTraceRaysKHR(secondary, &table.raygen, &table.miss, &hit, &table.callable, tracer.rayCount(), 1,
                                   1);
        barrier(secondary);
        VT_CHECK(vkEndCommandBuffer(secondary));
        gpu().submit([&](VkCommandBuffer commands) { vkCmdExecuteCommands(commands, 1, &secondary); });
        scene.expect(tracer.results(), kFlags);
        vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &secondary);
    }
}

// A region that reaches further than its buffer.
class HitTablesBadInput : public HitTables
{
protected:
    HitTablesBadInput() : HitTables({.validation = false, .maintenance = true}) {}
};

TEST_F(HitTablesBadInput, BeyondTheBuffer)
{
    PipelineTracer tracer(gpu());
    VkStridedDeviceAddressRegionKHR hit = tracer.table().hit;
    hit.size = hit.stride << 24; // VUID-VkStridedDeviceAddressRegionKHR-size-04631
    const PipelineScene scene(gpu());
    tracer.prepare(scene.tlas(), scene.rays(0), 4);
    trace(tracer, hit, Command::Direct);
    scene.expect(tracer.results(), 0);
}

// Triangles in a row, each a geometry of its own, every second one transparent.
class HitTablesOfGeometries : public HitTables
{
protected:
    // `together`: the top-level structure is built in the submission that traces; `before`: so that it has traced with
    // the same table before.
    void expectHits(uint32_t geometries, uint32_t record, const PipelineTracerSetup &setup, bool together,
                    bool before = false)
    {
        std::vector<Geometry> row(geometries);
        std::vector<Ray> rays(geometries);
        for (uint32_t g = 0; g < geometries; ++g) {
            const float x = 1.5f * static_cast<float>(g);
            appendTriangle(row[g].vertices, {x, 0, 0});
            Attachment attachment;
            attachment.indexType = VK_INDEX_TYPE_UINT32;
            attachment.indices = {g % 2 == 0 ? VK_OPACITY_MICROMAP_SPECIAL_INDEX_FULLY_TRANSPARENT_EXT
                                             : VK_OPACITY_MICROMAP_SPECIAL_INDEX_FULLY_OPAQUE_EXT};
            row[g].micromap = attachment;
            rays[g].origin = {x + 0.25f, 0.25f, 1};
            rays[g].flags = kTrianglesOnly | kRayOpaque;
        }
        const Blas blas(gpu(), row);
        VkAccelerationStructureInstanceKHR only = instance(blas, {0, 0, 0}, 3);
        only.instanceShaderBindingTableRecordOffset = record & 0xffffffu;
        Tlas tlas(gpu());
        if (!together)
            tlas.build(std::array{only});
        else
            tlas.prepare(std::array{only});
        PipelineTracer tracer(gpu(), setup);
        tracer.prepare(tlas, rays, 4);
        tracer.clearResults();
        gpu().submit([&](VkCommandBuffer commands) {
            if (before) {
                const BindingTable &table = tracer.table();
                tracer.bind(commands);
                gpu().vk().CmdTraceRaysKHR(commands, &table.raygen, &table.miss, &table.hit, &table.callable, 0, 1, 1);
            }
            if (together)
                tlas.record(commands);
            const auto memory =
                vkInit<VkMemoryBarrier>({.srcAccessMask = VK_ACCESS_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
                                         .dstAccessMask = VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR});
            vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                                 VK_PIPELINE_STAGE_RAY_TRACING_SHADER_BIT_KHR, 0, 1, &memory, 0, nullptr, 0, nullptr);
            tracer.bind(commands);
            tracer.dispatch(commands);
            barrier(commands);
        });
        const std::vector<PipelineResult> results = tracer.results();
        ASSERT_EQ(results.size(), geometries);
        for (uint32_t g = 0; g < geometries; ++g)
            EXPECT_EQ(results[g].committed, g % 2 == 0 ? kNone : kUnknownResult) << "geometry " << g;
    }
};

// More records than the table ever has in reserve.
TEST_F(HitTablesOfGeometries, Many)
{
    expectHits(700, 0, {.sbtOffset = 15, .sbtStride = 15}, false);
}

// The layer copies so long a table in several pieces.
TEST_F(HitTablesOfGeometries, InPieces)
{
    PipelineTracerSetup setup{.sbtStride = 1};
    setup.records.assign(100'000, std::nullopt);
    for (const uint32_t record : {0u, 16'383u, 32'767u, 65'535u, 99'998u})
        expectHits(2, record, setup, false);
}

// The device does not know the offset before the trace is recorded.
TEST_F(HitTablesOfGeometries, BuiltInTheSameSubmission)
{
    expectHits(3, 200, {}, true, true);
    expectHits(3, 220, {}, true);
    expectHits(3, 10'000'000, {.groups = {{}}}, true);
}

} // namespace
