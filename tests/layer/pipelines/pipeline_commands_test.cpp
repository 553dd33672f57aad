// SPDX-License-Identifier: Apache-2.0
// Traces in command buffers: indirect ones, secondary command buffers, several submissions, and the application's other
// state, which no trace may change.
#include "pipelines/pipeline_scene.h"

#include "harness/program/labels.h"
#include "shaders/pipeline_state.h"

namespace
{

const vt::Labels kPipelineCommandsLabels{{"PipelineCommandsMaintenance.*", "forcing"},
                                         {"PipelineState.*", "forcing"},
                                         {"PipelineCommands.*", "quirks stacked forcing"}};

using namespace vt;

class PipelineCommands : public PipelineSceneTest
{
protected:
    explicit PipelineCommands(const Options &options = {}) : PipelineSceneTest(options) {}

    // A pipeline that needs everything: groups without any-hit shader, and a zero record.
    [[nodiscard]] static PipelineTracerSetup zeroRecords() { return {.records = {std::nullopt, 1}}; }
    static constexpr PipelineScene::View kZeroView{.triangleAnyHit = false, .triangleClosestHit = false};
};

// The size that traces read from memory, written by the device in the same command buffer.
TEST_F(PipelineCommands, Indirect)
{
    PipelineTracer tracer(gpu(), zeroRecords());
    const Buffer command(gpu(), 256,
                         VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
                             VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    for (const uint32_t flags : opacityRayFlags()) {
        tracer.prepare(scene_->tlas(), scene_->rays(flags), 4);
        gpu().submit([&](VkCommandBuffer commands) {
            const VkTraceRaysIndirectCommandKHR size{tracer.rayCount(), 1, 1};
            vkCmdUpdateBuffer(commands, command.handle(), 64, sizeof size, &size);
            barrier(commands);
            tracer.bind(commands);
            const BindingTable &table = tracer.table();
            gpu().vk().CmdTraceRaysIndirectKHR(commands, &table.raygen, &table.miss, &table.hit, &table.callable,
                                               command.address() + 64);
            barrier(commands);
        });
        scene_->expect(tracer.results(), flags, kZeroView);
    }
}

class PipelineCommandsMaintenance : public PipelineCommands
{
protected:
    PipelineCommandsMaintenance() : PipelineCommands({.maintenance = true}) {}

    static VkTraceRaysIndirectCommand2KHR command(const PipelineTracer &tracer)
    {
        const BindingTable &t = tracer.table();
        VkTraceRaysIndirectCommand2KHR c{};
        c.raygenShaderRecordAddress = t.raygen.deviceAddress;
        c.raygenShaderRecordSize = t.raygen.size;
        c.missShaderBindingTableAddress = t.miss.deviceAddress;
        c.missShaderBindingTableSize = t.miss.size;
        c.missShaderBindingTableStride = t.miss.stride;
        c.hitShaderBindingTableAddress = t.hit.deviceAddress;
        c.hitShaderBindingTableSize = t.hit.size;
        c.hitShaderBindingTableStride = t.hit.stride;
        c.callableShaderBindingTableAddress = t.callable.deviceAddress;
        c.callableShaderBindingTableSize = t.callable.size;
        c.callableShaderBindingTableStride = t.callable.stride;
        c.width = tracer.rayCount();
        c.height = c.depth = 1;
        return c;
    }
};

// The whole binding table comes from memory, which the device writes.
TEST_F(PipelineCommandsMaintenance, Indirect2)
{
    if (gpu().vk().CmdTraceRaysIndirect2KHR == nullptr)
        GTEST_SKIP() << "no vkCmdTraceRaysIndirect2KHR";
    for (const bool zero : {false, true}) {
        PipelineTracer tracer(gpu(), zero ? zeroRecords() : PipelineTracerSetup{});
        const Buffer buffer(gpu(), 1024,
                            VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
                                VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
        for (const uint32_t flags : opacityRayFlags()) {
            tracer.prepare(scene_->tlas(), scene_->rays(flags), 4);
            const VkTraceRaysIndirectCommand2KHR c = command(tracer);
            gpu().submit([&](VkCommandBuffer commands) {
                vkCmdUpdateBuffer(commands, buffer.handle(), 128, sizeof c, &c);
                barrier(commands);
                tracer.bind(commands);
                gpu().vk().CmdTraceRaysIndirect2KHR(commands, buffer.address() + 128);
                barrier(commands);
            });
            scene_->expect(tracer.results(), flags, zero ? kZeroView : PipelineScene::View{});
        }
    }
}

// The same command buffer is submitted several times, each time with another command and table in memory.
TEST_F(PipelineCommandsMaintenance, Indirect2ChangesBetweenSubmissions)
{
    if (gpu().vk().CmdTraceRaysIndirect2KHR == nullptr)
        GTEST_SKIP() << "no vkCmdTraceRaysIndirect2KHR";
    PipelineTracer tracer(gpu(), {.records = {0, 1, std::nullopt, 1}});
    const Buffer buffer(gpu(), 1024, VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    tracer.prepare(scene_->tlas(), scene_->rays(0), 4);
    VkCommandBuffer commands = gpu().begin(0);
    tracer.bind(commands);
    gpu().vk().CmdTraceRaysIndirect2KHR(commands, buffer.address() + 256);
    barrier(commands);
    gpu().end(commands);
    for (const uint32_t first : {0u, 2u, 0u, 2u}) {
        VkTraceRaysIndirectCommand2KHR c = command(tracer);
        c.hitShaderBindingTableAddress += first * c.hitShaderBindingTableStride;
        c.hitShaderBindingTableSize = 2 * c.hitShaderBindingTableStride;
        // A table must start at the base alignment, which this record may lack.
        if (c.hitShaderBindingTableAddress % gpu().pipelineProperties().shaderGroupBaseAlignment != 0)
            GTEST_SKIP() << "records are not aligned as tables are";
        std::memcpy(buffer.bytes() + 256, &c, sizeof c);
        tracer.clearResults();
        gpu().execute(commands);
        scene_->expect(tracer.results(), 0,
                       {.triangleAnyHit = first == 0, .triangleClosestHit = first == 0, .firstData = 100 + first});
    }
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &commands);
}

// More records than the scene uses.
TEST_F(PipelineCommandsMaintenance, Indirect2WithManyRecords)
{
    if (gpu().vk().CmdTraceRaysIndirect2KHR == nullptr)
        GTEST_SKIP() << "no vkCmdTraceRaysIndirect2KHR";
    for (const uint32_t count : {100u, 1000u, 10000u, 30000u}) {
        SCOPED_TRACE(testing::Message() << count << " records");
        std::vector<std::optional<uint32_t>> records(count);
        records[count - 1] = 1;
        PipelineTracer tracer(gpu(), {.records = records});
        const PipelineScene scene(gpu(), {.triangleRecord = count - 2, .boxRecord = count - 1});
        const Buffer buffer(gpu(), 1024,
                            VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
        tracer.prepare(scene.tlas(), scene.rays(0), 4);
        const VkTraceRaysIndirectCommand2KHR c = command(tracer);
        std::memcpy(buffer.bytes(), &c, sizeof c);
        gpu().submit([&](VkCommandBuffer commands) {
            tracer.bind(commands);
            gpu().vk().CmdTraceRaysIndirect2KHR(commands, buffer.address());
            barrier(commands);
        });
        scene.expect(tracer.results(), 0, kZeroView);
    }
}

// A compute pipeline of the application whose push constants share a layout with those of the ray tracing pipelines.
class ComputeState
{
public:
    static constexpr VkPushConstantRange kRange{VK_SHADER_STAGE_COMPUTE_BIT, 64, 192};

    ComputeState(Gpu &gpu, uint32_t rayTracingPushSize) : gpu_(gpu)
    {
        const VkDescriptorSetLayoutBinding binding{0, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT,
                                                   nullptr};
        auto set = vkInit<VkDescriptorSetLayoutCreateInfo>({.bindingCount = 1, .pBindings = &binding});
        VT_CHECK(vkCreateDescriptorSetLayout(gpu.device(), &set, nullptr, &setLayout_));
        // The same ranges as in the ray tracing pipelines' layout, so that push constants stay valid for both.
        const std::array<VkPushConstantRange, 2> ranges{{{PipelineResources::kStages, 0, rayTracingPushSize}, kRange}};
        auto layout =
            vkInit<VkPipelineLayoutCreateInfo>({.setLayoutCount = 1,
                                                .pSetLayouts = &setLayout_,
                                                .pushConstantRangeCount = static_cast<uint32_t>(ranges.size()),
                                                .pPushConstantRanges = ranges.data()});
        VT_CHECK(vkCreatePipelineLayout(gpu.device(), &layout, nullptr, &layout_));
        auto pipeline = vkInit<VkComputePipelineCreateInfo>(
            {.stage = vkInit<VkPipelineShaderStageCreateInfo>(
                 {.stage = VK_SHADER_STAGE_COMPUTE_BIT, .module = gpu.shader(pipeline_state), .pName = "main"}),
             .layout = layout_});
        VT_CHECK(vkCreateComputePipelines(gpu.device(), VK_NULL_HANDLE, 1, &pipeline, nullptr, &pipeline_));
        vkDestroyShaderModule(gpu.device(), pipeline.stage.module, nullptr);
        const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1};
        auto pool = vkInit<VkDescriptorPoolCreateInfo>({.maxSets = 1, .poolSizeCount = 1, .pPoolSizes = &size});
        VT_CHECK(vkCreateDescriptorPool(gpu.device(), &pool, nullptr, &pool_));
        auto allocation = vkInit<VkDescriptorSetAllocateInfo>(
            {.descriptorPool = pool_, .descriptorSetCount = 1, .pSetLayouts = &setLayout_});
        VT_CHECK(vkAllocateDescriptorSets(gpu.device(), &allocation, &set_));
        seen_ = Buffer(gpu, 48 * 4, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT);
        const VkDescriptorBufferInfo buffer{seen_.handle(), 0, VK_WHOLE_SIZE};
        auto write = vkInit<VkWriteDescriptorSet>({.dstSet = set_,
                                                   .descriptorCount = 1,
                                                   .descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
                                                   .pBufferInfo = &buffer});
        vkUpdateDescriptorSets(gpu.device(), 1, &write, 0, nullptr);
        for (uint32_t i = 0; i < words_.size(); ++i)
            words_[i] = 0x3254761 * (i + 1);
    }
    ComputeState(const ComputeState &) = delete;
    ComputeState &operator=(const ComputeState &) = delete;
    ~ComputeState()
    {
        vkDestroyPipeline(gpu_.device(), pipeline_, nullptr);
        vkDestroyDescriptorPool(gpu_.device(), pool_, nullptr);
        vkDestroyPipelineLayout(gpu_.device(), layout_, nullptr);
        vkDestroyDescriptorSetLayout(gpu_.device(), setLayout_, nullptr);
    }

    void push(VkCommandBuffer commands, uint32_t first = 0, uint32_t count = 48) const
    {
        vkCmdPushConstants(commands, layout_, VK_SHADER_STAGE_COMPUTE_BIT, 64 + 4 * first, 4 * count,
                           words_.data() + first);
    }
    void bind(VkCommandBuffer commands) const
    {
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline_);
        vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout_, 0, 1, &set_, 0, nullptr);
    }
    static void dispatch(VkCommandBuffer commands)
    {
        barrier(commands);
        vkCmdDispatch(commands, 1, 1, 1);
        barrier(commands);
    }
    void expectSeen() const
    {
        for (uint32_t i = 0; i < words_.size(); ++i)
            ASSERT_EQ(seen_.as<uint32_t>()[i], words_[i]) << "word " << i;
        std::memset(seen_.bytes(), 0, static_cast<size_t>(seen_.size()));
    }

private:
    Gpu &gpu_;
    VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
    VkDescriptorPool pool_ = VK_NULL_HANDLE;
    VkDescriptorSet set_ = VK_NULL_HANDLE;
    Buffer seen_;
    std::array<uint32_t, 48> words_{};
};

class PipelineState : public PipelineCommands
{
protected:
    explicit PipelineState(const Options &options = {}) : PipelineCommands(options) {}
    void SetUp() override
    {
        PipelineCommands::SetUp();
        if (IsSkipped())
            return;
        VkPhysicalDeviceProperties properties;
        vkGetPhysicalDeviceProperties(gpu().physical(), &properties);
        if (properties.limits.maxPushConstantsSize < ComputeState::kRange.offset + ComputeState::kRange.size)
            GTEST_SKIP() << "too few push constants for shaders of both kinds";
        PipelineTracerSetup setup = zeroRecords();
        setup.otherPushConstants = {ComputeState::kRange};
        tracer_ = std::make_unique<PipelineTracer>(gpu(), setup);
        compute_ = std::make_unique<ComputeState>(gpu(), PipelineTracer::kPushSize);
        tracer_->prepare(scene_->tlas(), scene_->rays(0), 4);
    }
    void TearDown() override
    {
        tracer_.reset();
        compute_.reset();
        PipelineCommands::TearDown();
    }
    void expectTraced()
    {
        scene_->expect(tracer_->results(), 0, kZeroView);
        tracer_->clearResults();
    }
    void run(const std::function<void(VkCommandBuffer)> &record)
    {
        tracer_->clearResults();
        gpu().submit(record);
        expectTraced();
        compute_->expectSeen();
    }

    std::unique_ptr<PipelineTracer> tracer_;
    std::unique_ptr<ComputeState> compute_;
};

TEST_F(PipelineState, ComputeStateSurvivesATrace)
{
    run([&](VkCommandBuffer commands) {
        compute_->bind(commands);
        compute_->push(commands);
        tracer_->bind(commands);
        tracer_->dispatch(commands);
        ComputeState::dispatch(commands);
    });
}

TEST_F(PipelineState, RayTracingStateSurvivesDispatchesAndTraces)
{
    run([&](VkCommandBuffer commands) {
        tracer_->bind(commands);
        compute_->bind(commands);
        compute_->push(commands);
        tracer_->dispatch(commands);
        ComputeState::dispatch(commands);
        tracer_->dispatch(commands);
        ComputeState::dispatch(commands);
        tracer_->dispatch(commands);
        barrier(commands);
    });
}

TEST_F(PipelineState, PushedInPiecesAndBeforeAnyPipeline)
{
    run([&](VkCommandBuffer commands) {
        compute_->push(commands, 0, 16);
        tracer_->bind(commands);
        tracer_->dispatch(commands);
        compute_->push(commands, 16, 20);
        barrier(commands);
        tracer_->dispatch(commands);
        compute_->push(commands, 36, 12);
        compute_->bind(commands);
        ComputeState::dispatch(commands);
    });
}

TEST_F(PipelineState, SecondaryCommandBuffers)
{
    VkCommandBuffer secondary = gpu().begin(0, VK_COMMAND_BUFFER_LEVEL_SECONDARY);
    compute_->bind(secondary);
    compute_->push(secondary);
    tracer_->bind(secondary);
    tracer_->dispatch(secondary);
    ComputeState::dispatch(secondary);
    gpu().end(secondary);
    for (int i = 0; i < 2; ++i) {
        run([&](VkCommandBuffer commands) {
            vkCmdExecuteCommands(commands, 1, &secondary);
            barrier(commands);
        });
    }
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &secondary);
}

TEST_F(PipelineState, SubmittedAgainAndAgain)
{
    VkCommandBuffer commands = gpu().begin(VK_COMMAND_BUFFER_USAGE_SIMULTANEOUS_USE_BIT);
    barrier(commands);
    compute_->bind(commands);
    compute_->push(commands);
    tracer_->bind(commands);
    tracer_->dispatch(commands);
    ComputeState::dispatch(commands);
    gpu().end(commands);
    for (int i = 0; i < 3; ++i) {
        tracer_->clearResults();
        gpu().execute(commands);
        expectTraced();
        compute_->expectSeen();
    }
    // Twice at the same time.
    auto submission = vkInit<VkSubmitInfo>({.commandBufferCount = 1, .pCommandBuffers = &commands});
    const std::array<VkSubmitInfo, 2> both{submission, submission};
    VT_CHECK(vkQueueSubmit(gpu().queue(), 2, both.data(), VK_NULL_HANDLE));
    VT_CHECK(vkQueueWaitIdle(gpu().queue()));
    expectTraced();
    compute_->expectSeen();
    // The command buffer is recorded again after a reset, with other content.
    auto begin = vkInit<VkCommandBufferBeginInfo>();
    for (int i = 0; i < 3; ++i) {
        VT_CHECK(vkBeginCommandBuffer(commands, &begin));
        tracer_->bind(commands);
        for (int k = 0; k < 10; ++k)
            tracer_->dispatch(commands);
        barrier(commands);
        gpu().end(commands);
        gpu().execute(commands);
        expectTraced();
    }
    VT_CHECK(vkResetCommandPool(gpu().device(), gpu().pool(), 0));
    run([&](VkCommandBuffer fresh) {
        compute_->bind(fresh);
        compute_->push(fresh);
        tracer_->bind(fresh);
        tracer_->dispatch(fresh);
        ComputeState::dispatch(fresh);
    });
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &commands);
}

// Traces are no commands that a predicate switches off (vk.xml: conditionalrendering="false"), but lavapipe (Mesa
// 25.0.7) does: then at least no more than on the driver alone goes wrong.
bool tracesUnderPredicate(Gpu &gpu, uint32_t predicate)
{
    const PipelineScene scene(gpu, {.micromaps = false});
    PipelineTracer tracer(gpu, {.flags = 0});
    tracer.prepare(scene.tlas(), scene.rays(0), 4);
    tracer.clearResults();
    Buffer condition(gpu, 16, VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT);
    condition.as<uint32_t>()[0] = predicate;
    auto begin = vkInit<VkConditionalRenderingBeginInfoEXT>({.buffer = condition.handle()});
    gpu.submit([&](VkCommandBuffer commands) {
        tracer.bind(commands);
        gpu.vk().CmdBeginConditionalRenderingEXT(commands, &begin);
        tracer.dispatch(commands);
        gpu.vk().CmdEndConditionalRenderingEXT(commands);
        barrier(commands);
    });
    return tracer.results()[0].visitCount != 0xcccccccc;
}

TEST_F(PipelineState, ConditionalRendering)
{
    if (!gpu().has(VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME))
        GTEST_SKIP() << "no VK_EXT_conditional_rendering";
    Gpu alone({.vellum = false, .validation = false, .micromaps = false});
    for (const uint32_t predicate : {1u, 0u}) {
        SCOPED_TRACE(testing::Message() << "predicate " << predicate);
        const bool traces = tracesUnderPredicate(alone, predicate);
        EXPECT_EQ(tracesUnderPredicate(gpu(), predicate), traces);
        Buffer condition(gpu(), 16, VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT);
        condition.as<uint32_t>()[0] = predicate;
        auto begin = vkInit<VkConditionalRenderingBeginInfoEXT>({.buffer = condition.handle()});
        tracer_->clearResults();
        gpu().submit([&](VkCommandBuffer commands) {
            compute_->bind(commands);
            compute_->push(commands);
            tracer_->bind(commands);
            gpu().vk().CmdBeginConditionalRenderingEXT(commands, &begin);
            tracer_->dispatch(commands);
            gpu().vk().CmdEndConditionalRenderingEXT(commands);
            ComputeState::dispatch(commands);
        });
        if (traces)
            expectTraced();
        else
            EXPECT_EQ(tracer_->results()[0].visitCount, 0xcccccccc);
        compute_->expectSeen();
    }
}

} // namespace
