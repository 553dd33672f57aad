// SPDX-License-Identifier: Apache-2.0
// Modules, stages and groups in the combinations that applications make of them, and binding tables.
#include <algorithm>

#include "pipelines/pipeline_scene.h"

#include "harness/program/labels.h"
#include "shaders/pipeline_linked.h"
#include "shaders/pipeline_merged.h"
#include "shaders/pipeline_wide_any_hit.h"
#include "shaders/pipeline_wide_closest_hit.h"
#include "shaders/pipeline_wide_intersection.h"

namespace
{

const vt::Labels kPipelineGroupsLabels{{"PipelineGroups.*", "slow forcing"}};

using namespace vt;

class PipelineGroups : public PipelineSceneTest
{
protected:
    PipelineGroups() : PipelineSceneTest({.shared = true}) {}

    void expectAll(PipelineTracer &tracer, const PipelineScene::View &view)
    {
        for (const uint32_t flags : opacityRayFlags())
            scene_->expect(tracer, flags, view);
    }
    void expectAll(PipelineTracer &tracer) { expectAll(tracer, {}); }

    // All stages of one module.
    void expectOneModule(std::span<const uint32_t> words, bool sharedModules)
    {
        const auto make = [&](Device &g, const PipelineSetup &from) {
            PipelineSetup setup = from;
            setup.sharedModules = sharedModules;
            constexpr std::array names{"raygen", "miss", "closest_hit", "any_hit", "intersection", "intersection"};
            for (size_t i = 0; i < names.size(); ++i) {
                setup.stages[i].words = words;
                setup.stages[i].entry = names[i];
            }
            // Boxes have an any-hit shader of their own, in the same module.
            setup.stages.push_back({VK_SHADER_STAGE_ANY_HIT_BIT_KHR, words, "any_hit_2"});
            for (PipelineGroup &group : setup.groups) {
                if (group.intersection != kUnused && group.anyHit != kUnused)
                    group.anyHit = static_cast<uint32_t>(setup.stages.size()) - 1;
            }
            return MadePipeline{RayPipeline(g, setup), {}};
        };
        PipelineTracer tracer(gpu(), {.make = make});
        expectAll(tracer);
        PipelineTracer without(gpu(), {.groups = {{.anyHit = false}, {.box = true, .anyHit = false}}, .make = make});
        expectAll(without, {.triangleAnyHit = false, .boxAnyHit = false});
        PipelineTracer unmapped(gpu(), {.flags = 0, .make = make});
        const PipelineScene plain(gpu(), {.micromaps = false});
        for (const uint32_t flags : opacityRayFlags(false))
            plain.expect(unmapped, flags);
    }
};

TEST_F(PipelineGroups, OneModuleWithAllEntryPoints)
{
    expectOneModule(pipeline_linked, true);
}

TEST_F(PipelineGroups, EntryPointsThatShareVariablesAndFunctions)
{
    expectOneModule(pipeline_merged, true);
    expectOneModule(pipeline_merged, false);
}

// The stages once more each, so that every group has its own.
TEST_F(PipelineGroups, StagesOfTheirOwn)
{
    PipelineTracer tracer(gpu(), {.make = [](Device &g, const PipelineSetup &from) {
                              PipelineSetup setup = from;
                              setup.sharedModules = true;
                              const auto again = [&setup](uint32_t &stage) {
                                  if (stage == kUnused)
                                      return;
                                  setup.stages.push_back(setup.stages[stage]);
                                  stage = static_cast<uint32_t>(setup.stages.size()) - 1;
                              };
                              for (PipelineGroup &group : setup.groups) {
                                  again(group.general);
                                  again(group.closestHit);
                                  again(group.anyHit);
                                  again(group.intersection);
                              }
                              return MadePipeline{RayPipeline(g, setup), {}};
                          }});
    expectAll(tracer);
}

// The same stages in groups with and without the other stages, hit in turns.
TEST_F(PipelineGroups, OneStageInManyGroups)
{
    const std::vector<TracerGroup> groups{{},
                                          {.anyHit = false},
                                          {.closestHit = false},
                                          {.anyHit = false, .closestHit = false},
                                          {.box = true},
                                          {.box = true, .closestHit = false},
                                          {}};
    PipelineTracerSetup setup{.groups = groups, .records = {0, 1, 2, 3, std::nullopt, 6, 4, 5}};
    struct Case {
        uint32_t first; // the record of triangles
        PipelineScene::View view;
    };
    const std::array<Case, 6> cases{{
        {0, {}},
        {1, {.triangleAnyHit = false}},
        {2, {.triangleClosestHit = false}},
        {3, {.triangleAnyHit = false, .triangleClosestHit = false}},
        {4, {.triangleAnyHit = false, .triangleClosestHit = false}},
        {5, {}},
    }};
    for (const bool shared : {true, false}) {
        setup.make = [shared](Device &g, const PipelineSetup &from) {
            PipelineSetup pipeline = from;
            pipeline.sharedModules = shared;
            return MadePipeline{RayPipeline(g, pipeline), {}};
        };
        PipelineTracer tracer(gpu(), setup);
        for (const Case &c : cases) {
            SCOPED_TRACE(testing::Message() << "record " << c.first);
            for (const uint32_t box : {6u, 7u}) {
                const PipelineScene scene(gpu(), {.triangleRecord = c.first, .boxRecord = box});
                PipelineScene::View view = c.view;
                view.boxClosestHit = box == 6;
                for (const uint32_t flags : opacityRayFlags())
                    scene.expect(tracer, flags, view);
            }
        }
    }
}

// The largest hit attributes that lavapipe allows, in groups of boxes, with groups of triangles in the same pipeline.
TEST_F(PipelineGroups, WideHitAttributes)
{
    if (gpu().pipelineProperties().maxRayHitAttributeSize < 32)
        GTEST_SKIP() << "the attributes are too large";
    for (const bool triangleAnyHit : {true, false}) {
        for (const bool boxAnyHit : {true, false}) {
            PipelineTracer tracer(
                gpu(), {.groups = {{.anyHit = triangleAnyHit}, {.box = true, .anyHit = boxAnyHit}},
                        .make = [](Device &g, const PipelineSetup &from) {
                            PipelineSetup setup = from;
                            const auto first = static_cast<uint32_t>(setup.stages.size());
                            setup.stages.push_back({VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, pipeline_wide_closest_hit});
                            setup.stages.push_back({VK_SHADER_STAGE_ANY_HIT_BIT_KHR, pipeline_wide_any_hit});
                            setup.stages.push_back({VK_SHADER_STAGE_INTERSECTION_BIT_KHR, pipeline_wide_intersection});
                            PipelineGroup &boxes = setup.groups[3];
                            boxes.closestHit = first;
                            boxes.anyHit = boxes.anyHit == kUnused ? kUnused : first + 1;
                            boxes.intersection = first + 2;
                            return MadePipeline{RayPipeline(g, setup), {}};
                        }});
            expectAll(tracer, {.triangleAnyHit = triangleAnyHit, .boxAnyHit = boxAnyHit});
        }
    }
}

// Without hit records, traced with rays that hit nothing.
TEST_F(PipelineGroups, NoHitRecords)
{
    PipelineTracer tracer(gpu());
    std::vector<Ray> rays = scene_->rays(0);
    for (Ray &ray : rays)
        ray.cullMask = 0;
    tracer.prepare(scene_->tlas(), rays, 4);
    const BindingTable &binding = tracer.table();
    const VkStridedDeviceAddressRegionKHR none{};
    VkStridedDeviceAddressRegionKHR empty = binding.hit;
    empty.size = 0;
    for (const VkStridedDeviceAddressRegionKHR &hit : {none, empty}) {
        tracer.clearResults();
        gpu().submit([&](VkCommandBuffer commands) {
            tracer.bind(commands);
            gpu().vk().CmdTraceRaysKHR(commands, &binding.raygen, &binding.miss, &hit, &binding.callable,
                                       tracer.rayCount(), 1, 1);
            barrier(commands);
        });
        for (const PipelineResult &r : tracer.results()) {
            EXPECT_EQ(r.committed, kNone);
            EXPECT_EQ(r.candidateCount + r.visitCount, 0u);
        }
    }
}

// A trace of nothing, and one in three dimensions.
TEST_F(PipelineGroups, LaunchSizes)
{
    PipelineTracer tracer(gpu(), {.records = {std::nullopt, 1}});
    tracer.prepare(scene_->tlas(), scene_->rays(0x402), 4);
    tracer.clearResults();
    gpu().submit([&](VkCommandBuffer commands) {
        tracer.bind(commands);
        tracer.table().trace(commands, 0);
        tracer.table().trace(commands, 4, 0, 3);
        tracer.table().trace(commands, 8, tracer.rayCount() / 16 + 1, 2);
        barrier(commands);
    });
    scene_->expect(tracer.results(), 0x402, {.triangleAnyHit = false, .triangleClosestHit = false});
}

// The trace's own offset, on top of the instances'.
TEST_F(PipelineGroups, RecordOffset)
{
    PipelineTracer tracer(gpu(), {.records = {std::nullopt, std::nullopt, std::nullopt, 0, 1}, .sbtOffset = 3});
    expectAll(tracer, {.firstRecord = 3});
}

// Records of one group differ in their data only.
TEST_F(PipelineGroups, ManyRecords)
{
    std::vector<std::optional<uint32_t>> records;
    for (uint32_t i = 0; i < 5000; ++i)
        records.emplace_back(i % 3 == 0 ? std::optional<uint32_t>() : std::optional<uint32_t>(i % 3 - 1));
    PipelineTracer tracer(gpu(), {.records = records});
    const PipelineScene ordinary(gpu(), {.triangleRecord = 4198, .boxRecord = 4994});
    const PipelineScene zero(gpu(), {.triangleRecord = 4998, .boxRecord = 4997});
    for (const uint32_t flags : opacityRayFlags()) {
        if (4198 % 3 == 1)
            ordinary.expect(tracer, flags);
        zero.expect(tracer, flags, {.triangleAnyHit = false, .triangleClosestHit = false});
    }
}

// A pipeline's handles, by one and in ranges.
TEST_F(PipelineGroups, Handles)
{
    const PipelineTracer tracer(
        gpu(), {.groups = {{}, {.anyHit = false}, {.box = true}, {.anyHit = false, .closestHit = false}}});
    const size_t size = gpu().pipelineProperties().shaderGroupHandleSize;
    const std::vector<uint8_t> all = tracer.pipeline().groupHandles(0, 6);
    for (uint32_t first = 0; first < 6; ++first) {
        for (uint32_t count = 1; first + count <= 6; ++count) {
            const std::vector<uint8_t> some = tracer.pipeline().groupHandles(first, count);
            EXPECT_TRUE(std::equal(some.begin(), some.end(), all.begin() + static_cast<ptrdiff_t>(first * size)));
        }
    }
}

// A record buffer that the device writes, and changes between traces, of a command buffer that is submitted again.
TEST_F(PipelineGroups, TableThatChanges)
{
    PipelineTracer tracer(gpu());
    const auto &limits = gpu().pipelineProperties();
    const VkDeviceSize handle = limits.shaderGroupHandleSize;
    const VkDeviceSize stride = tracer.table().hit.stride;
    // Two contents: that of the tracer's table, and one with a zero record for triangles.
    std::vector<uint8_t> content(static_cast<size_t>(stride) * 4);
    const auto put = [&](size_t record, std::optional<uint32_t> group, uint32_t data) {
        uint8_t *at = content.data() + record * stride;
        if (group)
            std::memcpy(at, tracer.pipeline().groupHandles(*group).data(), static_cast<size_t>(handle));
        std::memcpy(at + handle, &data, sizeof data);
    };
    put(0, 2, 100);
    put(1, 3, 101);
    put(2, std::nullopt, 100);
    put(3, 3, 101);
    const Buffer source = gpu().upload(std::span<const uint8_t>(content), VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
    const Buffer table(gpu(), stride * 2 + 256,
                       VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
                           VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const VkDeviceSize base = (table.address() + 63) / 64 * 64;
    const VkStridedDeviceAddressRegionKHR hit{base, stride, stride * 2};
    const auto copy = [&](VkCommandBuffer commands, size_t which) {
        const VkBufferCopy region{which * 2 * stride, base - table.address(), stride * 2};
        vkCmdCopyBuffer(commands, source.handle(), table.handle(), 1, &region);
        // no more than the specification requires
        auto memory = vkInit<VkMemoryBarrier2>({.srcStageMask = VK_PIPELINE_STAGE_2_COPY_BIT,
                                                .srcAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT,
                                                .dstStageMask = VK_PIPELINE_STAGE_2_RAY_TRACING_SHADER_BIT_KHR,
                                                .dstAccessMask = VK_ACCESS_2_SHADER_READ_BIT});
        auto dependency = vkInit<VkDependencyInfo>({.memoryBarrierCount = 1, .pMemoryBarriers = &memory});
        vkCmdPipelineBarrier2(commands, &dependency);
    };
    for (const uint32_t last : {0u, 1u}) {
        for (const uint32_t flags : {0u, kRayCullOpaque, 0x400u}) {
            tracer.prepare(scene_->tlas(), scene_->rays(flags), 4);
            VkCommandBuffer commands = gpu().begin(0);
            const BindingTable &binding = tracer.table();
            for (const uint32_t which : {1 - last, last}) {
                barrier(commands);
                copy(commands, which);
                tracer.bind(commands);
                gpu().vk().CmdTraceRaysKHR(commands, &binding.raygen, &binding.miss, &hit, &binding.callable,
                                           tracer.rayCount(), 1, 1);
            }
            barrier(commands);
            gpu().end(commands);
            for (int i = 0; i < 2; ++i) {
                tracer.clearResults();
                gpu().execute(commands);
                scene_->expect(tracer.results(), flags, {.triangleAnyHit = last == 0, .triangleClosestHit = last == 0});
            }
            vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &commands);
        }
    }
}

// Written by the host after the trace was recorded.
TEST_F(PipelineGroups, TableWrittenAfterRecording)
{
    PipelineTracer tracer(gpu());
    const VkDeviceSize stride = tracer.table().hit.stride;
    const Buffer table(gpu(), stride * 2 + 256,
                       VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const VkDeviceSize base = (table.address() + 63) / 64 * 64;
    uint8_t *bytes = table.bytes() + (base - table.address());
    const VkStridedDeviceAddressRegionKHR hit{base, stride, stride * 2};
    const BindingTable &binding = tracer.table();
    tracer.prepare(scene_->tlas(), scene_->rays(0), 4);
    VkCommandBuffer commands = gpu().begin(VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT);
    tracer.bind(commands);
    gpu().vk().CmdTraceRaysKHR(commands, &binding.raygen, &binding.miss, &hit, &binding.callable, tracer.rayCount(), 1,
                               1);
    barrier(commands);
    gpu().end(commands);
    for (const bool zero : {false, true, false}) {
        const std::vector<uint8_t> handles = tracer.pipeline().groupHandles(2, 2);
        const size_t size = handles.size() / 2;
        for (uint32_t i = 0; i < 2; ++i) {
            const uint32_t data = 100 + i;
            std::memcpy(bytes + i * stride, handles.data() + i * size, size);
            std::memcpy(bytes + i * stride + size, &data, 4);
        }
        if (zero)
            std::memset(bytes, 0, size);
        tracer.clearResults();
        gpu().execute(commands);
        scene_->expect(tracer.results(), 0, {.triangleAnyHit = !zero, .triangleClosestHit = !zero});
    }
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &commands);
}

// Strides other than tight ones; 0 means that every index names the same record.
TEST_F(PipelineGroups, Strides)
{
    const PipelineScene triangles(gpu(), {.triangleRecord = 3, .boxRecord = 2});
    PipelineTracer tracer(gpu());
    const auto &limits = gpu().pipelineProperties();
    const size_t size = limits.shaderGroupHandleSize;
    for (const bool zero : {false, true}) {
        for (const VkDeviceSize stride :
             {VkDeviceSize{64}, VkDeviceSize{96}, VkDeviceSize{512}, VkDeviceSize{limits.maxShaderGroupStride}}) {
            SCOPED_TRACE(testing::Message() << "stride " << stride);
            const Buffer table(gpu(), stride * 4 + 256,
                               VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR |
                                   VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
            const VkDeviceSize base = (table.address() + 63) / 64 * 64;
            uint8_t *bytes = table.bytes() + (base - table.address());
            const std::vector<uint8_t> handles = tracer.pipeline().groupHandles(2, 2);
            for (const uint32_t record : {2u, 3u}) {
                const uint32_t data = 100 + record;
                if (!zero || record == 2)
                    std::memcpy(bytes + record * stride, handles.data() + (record == 3 ? 0 : size), size);
                std::memcpy(bytes + record * stride + size, &data, 4);
            }
            // The last record ends with its handle and data, not with its stride.
            const VkStridedDeviceAddressRegionKHR hit{base, stride, 3 * stride + size + 16};
            const BindingTable &binding = tracer.table();
            for (const uint32_t flags : {0u, kRayCullNoOpaque, 0x402u}) {
                tracer.prepare(triangles.tlas(), triangles.rays(flags), 4);
                gpu().submit([&](VkCommandBuffer commands) {
                    tracer.bind(commands);
                    gpu().vk().CmdTraceRaysKHR(commands, &binding.raygen, &binding.miss, &hit, &binding.callable,
                                               tracer.rayCount(), 1, 1);
                    barrier(commands);
                });
                triangles.expect(tracer.results(), flags, {.triangleAnyHit = !zero, .triangleClosestHit = !zero});
            }
        }
    }
}

TEST_F(PipelineGroups, StrideZero)
{
    // Without boxes, which need another record.
    PipelineTracer tracer(gpu());
    const PipelineScene scene(gpu(), {.triangleRecord = 0});
    const BindingTable &binding = tracer.table();
    VkStridedDeviceAddressRegionKHR hit = binding.hit;
    hit.stride = 0;
    hit.size = gpu().pipelineProperties().shaderGroupHandleSize + 16;
    for (const uint32_t flags : {kRaySkipBoxes, kRaySkipBoxes | kRayOpaque, kRaySkipBoxes | 0x440u}) {
        tracer.prepare(scene.tlas(), scene.rays(flags), 4);
        gpu().submit([&](VkCommandBuffer commands) {
            tracer.bind(commands);
            gpu().vk().CmdTraceRaysKHR(commands, &binding.raygen, &binding.miss, &hit, &binding.callable,
                                       tracer.rayCount(), 1, 1);
            barrier(commands);
        });
        scene.expect(tracer.results(), flags);
    }
}

} // namespace
