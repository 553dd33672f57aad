// SPDX-License-Identifier: Apache-2.0
// Builds recorded between an application's state commands must not change that state.
#include "command_buffer/state_scene.h"
#include "gpu/programs/graphics.h"

#include "harness/program/labels.h"
#include "shaders/plain_fragment.h"
#include "shaders/state_compute.h"
#include "shaders/state_compute_few.h"
#include "shaders/state_vertex.h"

namespace
{

const vt::Labels kStateLabels{{"State.*", "quirks forcing"}};

using namespace vt;

constexpr VkBufferUsageFlags kStorage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
constexpr VkShaderStageFlags kBoth = VK_SHADER_STAGE_COMPUTE_BIT | VK_SHADER_STAGE_VERTEX_BIT;

// Push constants: 64 bytes for the vertex shader, 192 for the compute shader, or 64 where the driver has no more; set 0
// bound, set 1 pushed or bound.
class State : public GpuTest
{
protected:
    void SetUp() override
    {
        VkPhysicalDeviceProperties properties;
        vkGetPhysicalDeviceProperties(gpu().physical(), &properties);
        const bool few = properties.limits.maxPushConstantsSize < 256;
        computeBytes_ = few ? 64 : 192;
        pushed_ = gpu().has(VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME);
        setLayouts_[0] = setLayout(2, 0);
        setLayouts_[1] = setLayout(1, pushed_ ? VK_DESCRIPTOR_SET_LAYOUT_CREATE_PUSH_DESCRIPTOR_BIT_KHR : 0);
        const std::array<VkPushConstantRange, 2> ranges{
            {{VK_SHADER_STAGE_VERTEX_BIT, 0, 64}, {VK_SHADER_STAGE_COMPUTE_BIT, 64, computeBytes_}}};
        auto info = vkInit<VkPipelineLayoutCreateInfo>({.setLayoutCount = 2,
                                                        .pSetLayouts = setLayouts_.data(),
                                                        .pushConstantRangeCount = 2,
                                                        .pPushConstantRanges = ranges.data()});
        VT_CHECK(vkCreatePipelineLayout(gpu().device(), &info, nullptr, &layout_));

        auto pipeline = vkInit<VkComputePipelineCreateInfo>(
            {.stage = vkInit<VkPipelineShaderStageCreateInfo>(
                 {.stage = VK_SHADER_STAGE_COMPUTE_BIT,
                  .module = few ? gpu().shader(state_compute_few) : gpu().shader(state_compute),
                  .pName = "main"}),
             .layout = layout_});
        VT_CHECK(vkCreateComputePipelines(gpu().device(), VK_NULL_HANDLE, 1, &pipeline, nullptr, &pipeline_));
        vkDestroyShaderModule(gpu().device(), pipeline.stage.module, nullptr);
        graphics_ = std::make_unique<Graphics>(
            gpu(), layout_, Graphics::Shaders{state_vertex, plain_fragment, false, VK_PRIMITIVE_TOPOLOGY_POINT_LIST},
            4);

        const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 8};
        auto pool = vkInit<VkDescriptorPoolCreateInfo>({.maxSets = 2, .poolSizeCount = 1, .pPoolSizes = &size});
        VT_CHECK(vkCreateDescriptorPool(gpu().device(), &pool, nullptr, &pool_));
        auto allocation = vkInit<VkDescriptorSetAllocateInfo>(
            {.descriptorPool = pool_, .descriptorSetCount = pushed_ ? 1u : 2u, .pSetLayouts = setLayouts_.data()});
        VT_CHECK(vkAllocateDescriptorSets(gpu().device(), &allocation, sets_.data()));
        seen_ = Buffer(gpu(), 128 * 4, kStorage);
        first_ = gpu().upload(std::span<const uint32_t>(std::array{0xabcd0001u}), kStorage);
        second_ = gpu().upload(std::span<const uint32_t>(std::array{0xabcd0002u}), kStorage);
        const std::array<VkDescriptorBufferInfo, 3> buffers{{{seen_.handle(), 0, VK_WHOLE_SIZE},
                                                             {first_.handle(), 0, VK_WHOLE_SIZE},
                                                             {second_.handle(), 0, VK_WHOLE_SIZE}}};
        for (uint32_t i = 0; i < (pushed_ ? 2u : 3u); ++i) {
            VkWriteDescriptorSet write = storageWrite(i == 2 ? 0 : i, &buffers[i]);
            write.dstSet = sets_[i == 2 ? 1 : 0];
            vkUpdateDescriptorSets(gpu().device(), 1, &write, 0, nullptr);
        }
        for (uint32_t i = 0; i < words_.size(); ++i)
            words_[i] = 0x1234567 * (i + 1);
        scene_ = std::make_unique<StateScene>(gpu());
    }

    void TearDown() override
    {
        scene_.reset();
        graphics_.reset();
        vkDestroyPipeline(gpu().device(), pipeline_, nullptr);
        vkDestroyPipelineLayout(gpu().device(), layout_, nullptr);
        vkDestroyDescriptorPool(gpu().device(), pool_, nullptr);
        for (const VkDescriptorSetLayout l : setLayouts_)
            vkDestroyDescriptorSetLayout(gpu().device(), l, nullptr);
        seen_ = {};
        first_ = {};
        second_ = {};
        GpuTest::TearDown();
    }

    void bindAll(VkCommandBuffer commands)
    {
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline_);
        graphics_->bind(commands);
        for (const VkPipelineBindPoint point : {VK_PIPELINE_BIND_POINT_COMPUTE, VK_PIPELINE_BIND_POINT_GRAPHICS}) {
            vkCmdBindDescriptorSets(commands, point, layout_, 0, pushed_ ? 1 : 2, sets_.data(), 0, nullptr);
            const VkDescriptorBufferInfo buffer{second_.handle(), 0, VK_WHOLE_SIZE};
            const VkWriteDescriptorSet write = storageWrite(0, &buffer);
            if (pushed_)
                gpu().vk().CmdPushDescriptorSetKHR(commands, point, layout_, 1, 1, &write);
        }
        pushVertex(commands);
        pushCompute(commands, 0, computeBytes_);
    }
    void pushVertex(VkCommandBuffer commands)
    {
        vkCmdPushConstants(commands, layout_, VK_SHADER_STAGE_VERTEX_BIT, 0, 64, words_.data());
    }
    void pushCompute(VkCommandBuffer commands, uint32_t offset, uint32_t size)
    {
        vkCmdPushConstants(commands, layout_, VK_SHADER_STAGE_COMPUTE_BIT, 64 + offset, size,
                           words_.data() + 16 + offset / 4);
    }
    void useAll(VkCommandBuffer commands)
    {
        barrier(commands);
        vkCmdDispatch(commands, 1, 1, 1);
        barrier(commands);
        graphics_->draw(commands, 1);
        barrier(commands);
    }

    void expectSeen()
    {
        const auto seen = seen_.as<uint32_t>();
        for (uint32_t i = 0; i < computeBytes_ / 4; ++i)
            EXPECT_EQ(seen[i], words_[16 + i]) << "compute push constant word " << i;
        for (uint32_t i = 0; i < 16; ++i)
            EXPECT_EQ(seen[64 + i], words_[i]) << "vertex push constant word " << i;
        for (const uint32_t stage : {0u, 64u}) {
            EXPECT_EQ(seen[stage + 62], 0xabcd0001u);
            EXPECT_EQ(seen[stage + 63], 0xabcd0002u);
        }
        std::memset(seen_.bytes(), 0, static_cast<size_t>(seen_.size()));
    }

    std::unique_ptr<StateScene> scene_;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    uint32_t computeBytes_ = 0;

private:
    VkDescriptorSetLayout setLayout(uint32_t count, VkDescriptorSetLayoutCreateFlags flags)
    {
        std::array<VkDescriptorSetLayoutBinding, 2> bindings{};
        for (uint32_t i = 0; i < count; ++i)
            bindings[i] = {i, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, kBoth, nullptr};
        auto info = vkInit<VkDescriptorSetLayoutCreateInfo>(
            {.flags = flags, .bindingCount = count, .pBindings = bindings.data()});
        VkDescriptorSetLayout layout = VK_NULL_HANDLE;
        VT_CHECK(vkCreateDescriptorSetLayout(gpu().device(), &info, nullptr, &layout));
        return layout;
    }
    static VkWriteDescriptorSet storageWrite(uint32_t binding, const VkDescriptorBufferInfo *buffer)
    {
        return vkInit<VkWriteDescriptorSet>({.dstBinding = binding,
                                             .descriptorCount = 1,
                                             .descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
                                             .pBufferInfo = buffer});
    }

    bool pushed_ = false;
    std::array<VkDescriptorSetLayout, 2> setLayouts_{};
    std::array<VkDescriptorSet, 2> sets_{};
    VkDescriptorPool pool_ = VK_NULL_HANDLE;
    VkPipeline pipeline_ = VK_NULL_HANDLE;
    std::unique_ptr<Graphics> graphics_;
    Buffer seen_, first_, second_;
    std::array<uint32_t, 64> words_{};
};

TEST_F(State, SurvivesAllBuilds)
{
    gpu().submit([this](VkCommandBuffer commands) {
        bindAll(commands);
        scene_->record(commands);
        useAll(commands);
    });
    expectSeen();
    scene_->expectRight();
}

TEST_F(State, SurvivesEachBuildAlone)
{
    for (uint32_t step = 0; step < StateScene::kSteps; ++step) {
        SCOPED_TRACE(testing::Message() << "step " << step);
        gpu().submit([&](VkCommandBuffer commands) {
            bindAll(commands);
            scene_->recordStep(commands, step);
            useAll(commands);
        });
        expectSeen();
    }
    scene_->expectRight();
}

TEST_F(State, PushedInPieces)
{
    gpu().submit([this](VkCommandBuffer commands) {
        bindAll(commands);
        scene_->recordStep(commands, 0);
        pushCompute(commands, 0, computeBytes_ / 2);
        barrier(commands);
        scene_->recordStep(commands, 1);
        pushCompute(commands, computeBytes_ / 2, computeBytes_ / 2);
        barrier(commands);
        pushVertex(commands);
        scene_->recordStep(commands, 2);
        useAll(commands);
    });
    expectSeen();
    scene_->expectRight();
}

TEST_F(State, PushConstantsBeforeAnyPipeline)
{
    gpu().submit([this](VkCommandBuffer commands) {
        pushVertex(commands);
        pushCompute(commands, 0, computeBytes_);
        scene_->record(commands);
        bindAll(commands);
        useAll(commands);
    });
    expectSeen();
    scene_->expectRight();
}

TEST_F(State, SecondaryCommandBuffers)
{
    VkCommandBuffer secondary = gpu().begin(0, VK_COMMAND_BUFFER_LEVEL_SECONDARY);
    bindAll(secondary);
    scene_->record(secondary);
    useAll(secondary);
    gpu().end(secondary);
    for (int i = 0; i < 2; ++i) {
        gpu().submit([&](VkCommandBuffer commands) {
            vkCmdExecuteCommands(commands, 1, &secondary);
            barrier(commands);
        });
        expectSeen();
        scene_->expectRight();
    }
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &secondary);
}

TEST_F(State, CommandBufferSubmittedTwice)
{
    VkCommandBuffer commands = gpu().begin(0);
    bindAll(commands);
    scene_->record(commands);
    useAll(commands);
    gpu().end(commands);
    for (int i = 0; i < 2; ++i) {
        gpu().execute(commands);
        expectSeen();
        scene_->expectRight();
    }
    // The command buffer is recorded again after a reset, with other content.
    auto info = vkInit<VkCommandBufferBeginInfo>();
    VT_CHECK(vkBeginCommandBuffer(commands, &info));
    scene_->record(commands);
    bindAll(commands);
    useAll(commands);
    gpu().end(commands);
    gpu().execute(commands);
    expectSeen();
    scene_->expectRight();
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &commands);
}

// A predicate does not affect builds (vk.xml: conditionalrendering="false"). Lavapipe 26 skips parts of a build where
// conditional rendering discards commands, and crashes, also without the layer.
TEST_F(State, ConditionalRendering)
{
    if (!gpu().has(VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME))
        GTEST_SKIP() << "no VK_EXT_conditional_rendering";
    for (const uint32_t predicate : {1u, 0u}) {
        SCOPED_TRACE(testing::Message() << "predicate " << predicate);
        StateScene fresh(gpu());
        Buffer condition(gpu(), 16, VK_BUFFER_USAGE_CONDITIONAL_RENDERING_BIT_EXT);
        condition.as<uint32_t>()[0] = predicate;
        auto begin = vkInit<VkConditionalRenderingBeginInfoEXT>({.buffer = condition.handle()});
        gpu().submit([&](VkCommandBuffer commands) {
            bindAll(commands);
            gpu().vk().CmdBeginConditionalRenderingEXT(commands, &begin);
            const uint32_t inside = predicate == 1 || !gpu().onLavapipe26() ? StateScene::kSteps : 1;
            for (uint32_t step = 0; step < StateScene::kSteps; ++step) {
                if (step == inside)
                    gpu().vk().CmdEndConditionalRenderingEXT(commands);
                fresh.recordStep(commands, step);
                barrier(commands);
            }
            if (inside == StateScene::kSteps)
                gpu().vk().CmdEndConditionalRenderingEXT(commands);
            useAll(commands);
        });
        expectSeen();
        fresh.expectRight();
    }
}

} // namespace
