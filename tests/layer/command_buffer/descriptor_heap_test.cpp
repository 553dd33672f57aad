// SPDX-License-Identifier: Apache-2.0
// VK_EXT_descriptor_heap: heaps and push data survive work that the layer adds between binding and use, and so does
// what descriptor sets need on a device with heaps.
#include "command_buffer/compute_pipeline.h"
#include "command_buffer/inherited_state.h"
#include "command_buffer/state_scene.h"
#include "gpu/pipeline_builder.h"

#include "harness/mock_driver.h"
#include "harness/program/labels.h"
#include "shaders/descriptor_heap_any_hit.h"
#include "shaders/descriptor_heap_closest_hit.h"
#include "shaders/descriptor_heap_compute.h"
#include "shaders/descriptor_heap_miss.h"
#include "shaders/descriptor_heap_raygen.h"

namespace
{

const vt::Labels kHeapLabels{{"DescriptorHeaps*", "translated packed forcing"}};

using namespace vt;
using vellum::gpu::BindingTable;
using vellum::gpu::kUnused;
using vellum::gpu::RayPipeline;

constexpr VkFlags64 kHeapBit = VK_PIPELINE_CREATE_2_DESCRIPTOR_HEAP_BIT_EXT;
constexpr uint32_t kLast = 0xabcd1234; // of what is pushed, behind what the layer's shaders need
constexpr uint32_t kLastAt = 248;

template <class Function>
Function commandOf(const Gpu &gpu, const char *name)
{
    return reinterpret_cast<Function>(vkGetDeviceProcAddr(gpu.device(), name));
}

class DescriptorHeaps : public GpuTest
{
protected:
    explicit DescriptorHeaps(bool validate = false)
        : GpuTest({.oldValidation = false, .quirks = "heaps", .validate = validate, .newer = true})
    {
    }
    void SetUp() override
    {
        ASSERT_TRUE(gpu().has(VK_EXT_DESCRIPTOR_HEAP_EXTENSION_NAME));
        bindResourceHeap_ = commandOf<PFN_vkCmdBindResourceHeapEXT>(gpu(), "vkCmdBindResourceHeapEXT");
        bindSamplerHeap_ = commandOf<PFN_vkCmdBindSamplerHeapEXT>(gpu(), "vkCmdBindSamplerHeapEXT");
        pushData_ = commandOf<PFN_vkCmdPushDataEXT>(gpu(), "vkCmdPushDataEXT");
        const VkPushConstantRange range{VK_SHADER_STAGE_COMPUTE_BIT, 0, 256};
        auto set = vkInit<VkDescriptorSetLayoutCreateInfo>();
        VT_CHECK(vkCreateDescriptorSetLayout(gpu().device(), &set, nullptr, &setLayout_));
        auto layout = vkInit<VkPipelineLayoutCreateInfo>({.setLayoutCount = 1,
                                                          .pSetLayouts = &setLayout_,
                                                          .pushConstantRangeCount = 1,
                                                          .pPushConstantRanges = &range});
        VT_CHECK(vkCreatePipelineLayout(gpu().device(), &layout, nullptr, &layout_));
        const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1};
        auto pool = vkInit<VkDescriptorPoolCreateInfo>({.maxSets = 1, .poolSizeCount = 1, .pPoolSizes = &size});
        VT_CHECK(vkCreateDescriptorPool(gpu().device(), &pool, nullptr, &pool_));
        auto allocation = vkInit<VkDescriptorSetAllocateInfo>(
            {.descriptorPool = pool_, .descriptorSetCount = 1, .pSetLayouts = &setLayout_});
        VT_CHECK(vkAllocateDescriptorSets(gpu().device(), &allocation, &set_));
        heap_ = Buffer(gpu(), 4096, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
        seen_ = Buffer(gpu(), 20, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
        scene_ = std::make_unique<StateScene>(gpu());
    }
    void TearDown() override
    {
        scene_.reset();
        heap_ = {};
        seen_ = {};
        vkDestroyDescriptorPool(gpu().device(), pool_, nullptr);
        vkDestroyPipelineLayout(gpu().device(), layout_, nullptr);
        vkDestroyDescriptorSetLayout(gpu().device(), setLayout_, nullptr);
        GpuTest::TearDown();
    }

    [[nodiscard]] VkBindHeapInfoEXT heap() const
    {
        return vkInit<VkBindHeapInfoEXT>({.heapRange = {heap_.address(), heap_.size()}});
    }
    void bindHeap(VkCommandBuffer commands)
    {
        const VkBindHeapInfoEXT info = heap();
        bindResourceHeap_(commands, &info);
        bindSamplerHeap_(commands, &info);
    }
    [[nodiscard]] std::array<VkDeviceAddress, 2> addresses() const
    {
        return {scene_->tlas().address(), seen_.address()};
    }
    void push(VkCommandBuffer commands, uint32_t offset, const void *data, size_t bytes)
    {
        auto info = vkInit<VkPushDataInfoEXT>({.offset = offset, .data = {data, bytes}});
        pushData_(commands, &info);
    }
    void pushAll(VkCommandBuffer commands)
    {
        const auto words = addresses();
        push(commands, 0, words.data(), sizeof words);
        push(commands, kLastAt, &kLast, sizeof kLast);
    }
    void bindSet(VkCommandBuffer commands)
    {
        vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, layout_, 0, 1, &set_, 0, nullptr);
    }
    void pushConstants(VkCommandBuffer commands)
    {
        const auto words = addresses();
        vkCmdPushConstants(commands, layout_, VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof words, words.data());
        vkCmdPushConstants(commands, layout_, VK_SHADER_STAGE_COMPUTE_BIT, kLastAt, sizeof kLast, &kLast);
    }
    static void dispatch(VkCommandBuffer commands)
    {
        vkCmdDispatch(commands, 1, 1, 1);
        barrier(commands);
    }
    // The triangles of StateScene are transparent, opaque and unknown.
    void expectSeen()
    {
        const auto seen = seen_.as<uint32_t>();
        EXPECT_EQ(std::vector(seen.begin(), seen.end()), (std::vector<uint32_t>{0, 1, 2, 2, kLast}));
        std::memset(seen_.bytes(), 0, static_cast<size_t>(seen_.size()));
    }

    // Everything is built after it was bound.
    void expectQuery()
    {
        const ComputePipeline pipeline = heapPipeline();
        gpu().submit([&](VkCommandBuffer commands) {
            bindHeap(commands);
            bind(commands, pipeline);
            pushAll(commands);
            scene_->record(commands);
            dispatch(commands);
        });
        expectSeen();
    }

    ComputePipeline heapPipeline() { return {gpu(), VK_NULL_HANDLE, descriptor_heap_compute, kHeapBit}; }
    ComputePipeline setPipeline() { return {gpu(), layout_, descriptor_heap_compute, 0}; }
    static void bind(VkCommandBuffer commands, const ComputePipeline &pipeline)
    {
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline.handle());
    }

    PFN_vkCmdBindResourceHeapEXT bindResourceHeap_ = nullptr;
    PFN_vkCmdBindSamplerHeapEXT bindSamplerHeap_ = nullptr;
    PFN_vkCmdPushDataEXT pushData_ = nullptr;
    VkDescriptorSetLayout setLayout_ = VK_NULL_HANDLE;
    VkPipelineLayout layout_ = VK_NULL_HANDLE;
    VkDescriptorPool pool_ = VK_NULL_HANDLE;
    VkDescriptorSet set_ = VK_NULL_HANDLE;
    Buffer heap_, seen_;
    std::unique_ptr<StateScene> scene_;
};

TEST_F(DescriptorHeaps, Query)
{
    expectQuery();
}

// Before each trace the layer copies the hit records by a dispatch.
TEST_F(DescriptorHeaps, RayTracingPipeline)
{
    if (!gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        GTEST_SKIP() << "no ray tracing pipelines";
    vellum::gpu::PipelineSetup setup{.stages = {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, descriptor_heap_raygen},
                                                {VK_SHADER_STAGE_MISS_BIT_KHR, descriptor_heap_miss},
                                                {VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, descriptor_heap_closest_hit},
                                                {VK_SHADER_STAGE_ANY_HIT_BIT_KHR, descriptor_heap_any_hit}},
                                     .groups = {{.general = 0}, {.general = 1}, {.closestHit = 2, .anyHit = 3}},
                                     .flags = kHeapBit | vellum::gpu::kMicromapBit,
                                     .flags2 = true};
    const RayPipeline pipeline(gpu(), setup);
    const BindingTable table(gpu(), pipeline, {.miss = {{1, {}}}, .hit = {{2, {}}}});
    gpu().submit([&](VkCommandBuffer commands) {
        bindHeap(commands);
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, pipeline.handle());
        pushAll(commands);
        scene_->record(commands);
        table.trace(commands, 4);
        barrier(commands);
    });
    expectSeen();
}

TEST_F(DescriptorHeaps, SetsAfterHeaps)
{
    const ComputePipeline pipeline = setPipeline();
    gpu().submit([&](VkCommandBuffer commands) {
        bindHeap(commands);
        pushAll(commands);
        bindSet(commands);
        scene_->recordStep(commands, 0);
        barrier(commands);
        pushConstants(commands);
        bind(commands, pipeline);
        for (uint32_t step = 1; step < StateScene::kSteps; ++step) {
            scene_->recordStep(commands, step);
            barrier(commands);
        }
        dispatch(commands);
    });
    expectSeen();
}

TEST_F(DescriptorHeaps, HeapsAfterSets)
{
    const ComputePipeline pipeline = heapPipeline();
    gpu().submit([&](VkCommandBuffer commands) {
        bindSet(commands);
        pushConstants(commands);
        scene_->recordStep(commands, 0);
        barrier(commands);
        bind(commands, pipeline);
        pushAll(commands);
        for (uint32_t step = 1; step < StateScene::kSteps; ++step) {
            scene_->recordStep(commands, step);
            barrier(commands);
        }
        dispatch(commands);
    });
    expectSeen();
}

// A heap that secondary command buffers inherit stays bound in the primary one, whatever the layer adds to them.
TEST_F(DescriptorHeaps, Inherited)
{
    const ComputePipeline pipeline = heapPipeline();
    const VkBindHeapInfoEXT bound = heap();
    const auto heaps = vkInit<VkCommandBufferInheritanceDescriptorHeapInfoEXT>({.pResourceHeapBindInfo = &bound});
    VkCommandBuffer secondary = beginInheriting(gpu(), &heaps);
    scene_->record(secondary);
    VT_CHECK(vkEndCommandBuffer(secondary));
    gpu().submit([&](VkCommandBuffer commands) {
        bindResourceHeap_(commands, &bound);
        vkCmdExecuteCommands(commands, 1, &secondary);
        bind(commands, pipeline);
        pushAll(commands);
        dispatch(commands);
    });
    expectSeen();
    vkFreeCommandBuffers(gpu().device(), gpu().pool(), 1, &secondary);
}

// Checks on the GPU are work of the layer as well.
class DescriptorHeapsValidated : public DescriptorHeaps
{
protected:
    DescriptorHeapsValidated() : DescriptorHeaps(true) {}
};

TEST_F(DescriptorHeapsValidated, Query)
{
    expectQuery();
}

} // namespace
