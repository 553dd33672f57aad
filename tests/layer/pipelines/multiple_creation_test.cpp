// SPDX-License-Identifier: Apache-2.0
// Several pipelines or shaders in one create command, one of which the layer rejects ("Multiple Pipeline Creation").
#include <algorithm>
#include <array>

#include "command_buffer/compute_pipeline.h"
#include "command_buffer/shader_objects.h"
#include "gpu/pipeline_builder.h"
#include "harness/harness.h"
#include "harness/program/labels.h"

#include "shaders/address_draws_fragment.h"
#include "shaders/empty.h"
#include "shaders/query_raygen.h"
#include "shaders/tracer_comp.h"

namespace
{

const vt::Labels kMultipleCreationLabels{{"MultipleCreation.*", "translated"}};

using namespace vt;

constexpr uint32_t kCount = 3, kBad = 1;
constexpr auto kUnknownType = static_cast<VkStructureType>(0x7ffffff0); // a structure of the future
constexpr VkPipelineCreateFlags kEarly = VK_PIPELINE_CREATE_EARLY_RETURN_ON_FAILURE_BIT;

// A stage's chain with its code; where that is bad, it traces rays and lies behind a structure of the future, where the
// layer can neither change it nor leave it to the driver.
class InlineModule
{
public:
    InlineModule(const Gpu &gpu, std::span<const uint32_t> words, bool bad) : code_(gpu.code(words))
    {
        info_ = vkInit<VkShaderModuleCreateInfo>({.codeSize = code_.size() * sizeof(uint32_t), .pCode = code_.data()});
        chain_ = bad ? static_cast<const void *>(&unknown_) : &info_;
    }
    InlineModule(const InlineModule &) = delete;
    InlineModule &operator=(const InlineModule &) = delete;
    [[nodiscard]] const void *chain() const { return chain_; }

private:
    std::vector<uint32_t> code_;
    VkShaderModuleCreateInfo info_{};
    VkBaseInStructure unknown_{kUnknownType, reinterpret_cast<const VkBaseInStructure *>(&info_)};
    const void *chain_ = nullptr;
};

VkPipelineShaderStageCreateInfo stageOf(VkShaderStageFlagBits stage, const InlineModule &module)
{
    return vkInit<VkPipelineShaderStageCreateInfo>({.pNext = module.chain(), .stage = stage, .pName = "main"});
}

class MultipleCreation : public GpuTest
{
protected:
    explicit MultipleCreation(const Options &options = {.validation = false, .newer = true}) : GpuTest(options) {}

    // `create(flags, pipelines)` makes kCount pipelines, with these flags, of which the one kBad is bad.
    template <class Create>
    void expectOthers(Create create)
    {
        for (const VkPipelineCreateFlags flags : {VkPipelineCreateFlags{0}, kEarly}) {
            SCOPED_TRACE(flags);
            std::array<VkPipeline, kCount> pipelines;
            pipelines.fill(reinterpret_cast<VkPipeline>(this)); // to be overwritten
            EXPECT_LT(create(flags, pipelines.data()), VK_SUCCESS);
            EXPECT_TRUE(pipelines[0]);
            EXPECT_FALSE(pipelines[kBad]);
            EXPECT_EQ(pipelines[2] != VK_NULL_HANDLE, flags == 0);
            for (const VkPipeline pipeline : pipelines)
                vkDestroyPipeline(gpu().device(), pipeline, nullptr);
            expectOneMessage("VELLUM-shader-rewrite");
        }
    }
    void expectOneMessage(const char *id)
    {
        const std::vector<Message> messages = gpu().takeUnexpectedMessages();
        EXPECT_EQ(messages.size(), 1u);
        for (const Message &message : messages)
            EXPECT_EQ(message.id, id) << message.text;
    }
};

TEST_F(MultipleCreation, Compute)
{
    const Tracer tracer(gpu()); // for its layout
    const InlineModule good(gpu(), empty, false), bad(gpu(), tracer_comp, true);
    expectOthers([&](VkPipelineCreateFlags flags, VkPipeline *pipelines) {
        std::array<VkComputePipelineCreateInfo, kCount> infos{};
        for (uint32_t i = 0; i < kCount; ++i) {
            infos[i] = vkInit<VkComputePipelineCreateInfo>(
                {.flags = flags | VK_PIPELINE_CREATE_ALLOW_DERIVATIVES_BIT,
                 .stage = stageOf(VK_SHADER_STAGE_COMPUTE_BIT, i == kBad ? bad : good),
                 .layout = tracer.layout(),
                 .basePipelineIndex = -1});
        }
        infos[2].flags |= VK_PIPELINE_CREATE_DERIVATIVE_BIT;
        infos[2].basePipelineIndex = 0;
        return vkCreateComputePipelines(gpu().device(), VK_NULL_HANDLE, kCount, infos.data(), nullptr, pipelines);
    });
}

// A derivative of a pipeline that fails also fails.
TEST_F(MultipleCreation, DerivativesOfOneThatFails)
{
    const Tracer tracer(gpu());
    const InlineModule good(gpu(), empty, false), bad(gpu(), tracer_comp, true);
    std::array<VkComputePipelineCreateInfo, 2> infos{};
    for (VkComputePipelineCreateInfo &info : infos) {
        info = vkInit<VkComputePipelineCreateInfo>({.layout = tracer.layout()});
    }
    infos[0].flags = VK_PIPELINE_CREATE_ALLOW_DERIVATIVES_BIT;
    infos[0].basePipelineIndex = -1;
    infos[0].stage = stageOf(VK_SHADER_STAGE_COMPUTE_BIT, bad);
    infos[1].flags = VK_PIPELINE_CREATE_DERIVATIVE_BIT;
    infos[1].stage = stageOf(VK_SHADER_STAGE_COMPUTE_BIT, good);
    std::array<VkPipeline, 2> pipelines;
    pipelines.fill(reinterpret_cast<VkPipeline>(this));
    EXPECT_LT(vkCreateComputePipelines(gpu().device(), VK_NULL_HANDLE, 2, infos.data(), nullptr, pipelines.data()),
              VK_SUCCESS);
    EXPECT_FALSE(pipelines[0]);
    EXPECT_FALSE(pipelines[1]);
    expectOneMessage("VELLUM-shader-rewrite");
}

// Flags that the driver does not know, where the layer cannot take them out.
TEST_F(MultipleCreation, FlagsBehindAnUnknownStructure)
{
    const Tracer tracer(gpu());
    const InlineModule module(gpu(), empty, false);
    const auto flags = vkInit<VkPipelineCreateFlags2CreateInfoKHR>(
        {.flags = VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR});
    const VkBaseInStructure unknown{kUnknownType, reinterpret_cast<const VkBaseInStructure *>(&flags)};
    std::array<VkComputePipelineCreateInfo, 2> infos{};
    for (VkComputePipelineCreateInfo &info : infos) {
        info = vkInit<VkComputePipelineCreateInfo>(
            {.stage = stageOf(VK_SHADER_STAGE_COMPUTE_BIT, module), .layout = tracer.layout()});
    }
    infos[0].pNext = &unknown;
    std::array<VkPipeline, 2> pipelines{};
    EXPECT_LT(vkCreateComputePipelines(gpu().device(), VK_NULL_HANDLE, 2, infos.data(), nullptr, pipelines.data()),
              VK_SUCCESS);
    EXPECT_FALSE(pipelines[0]);
    EXPECT_TRUE(pipelines[1]);
    vkDestroyPipeline(gpu().device(), pipelines[1], nullptr);
    std::vector<Message> messages = gpu().takeUnexpectedMessages();
    std::erase_if(messages, [](const Message &message) {
        return message.id == "VELLUM-VUID-VkComputePipelineCreateInfo-flags-11593"; // the feature of the flag
    });
    ASSERT_EQ(messages.size(), 1u);
    EXPECT_EQ(messages[0].id, "VELLUM-pipeline-flags") << messages[0].text;
}

// VkComputePipelineIndirectBufferInfoNV, which the oldest supported headers lack.
TEST_F(MultipleCreation, FlagsBehindANewerStructure)
{
    const Tracer tracer(gpu());
    const InlineModule module(gpu(), empty, false);
    const auto flags = vkInit<VkPipelineCreateFlags2CreateInfoKHR>(
        {.flags = VK_PIPELINE_CREATE_2_OPACITY_MICROMAP_DISALLOW_MIXED_SPECIAL_INDEX_BIT_KHR});
    const struct {
        VkStructureType sType;
        const void *pNext;
        VkDeviceAddress addresses[3];
    } newer{static_cast<VkStructureType>(1000428001), &flags, {}};
    const auto info = vkInit<VkComputePipelineCreateInfo>(
        {.pNext = &newer, .stage = stageOf(VK_SHADER_STAGE_COMPUTE_BIT, module), .layout = tracer.layout()});
    VkPipeline pipeline = VK_NULL_HANDLE;
    EXPECT_EQ(vkCreateComputePipelines(gpu().device(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline), VK_SUCCESS);
    vkDestroyPipeline(gpu().device(), pipeline, nullptr);
    for (const Message &message : gpu().takeUnexpectedMessages())
        EXPECT_EQ(message.id, "VELLUM-VUID-VkComputePipelineCreateInfo-flags-11593") << message.text; // the feature
}

// Libraries of fragment shaders, which have least to be filled in.
TEST_F(MultipleCreation, Graphics)
{
    if (!gpu().has(VK_EXT_GRAPHICS_PIPELINE_LIBRARY_EXTENSION_NAME))
        GTEST_SKIP() << "no graphics pipeline libraries";
    const Tracer tracer(gpu());
    const InlineModule good(gpu(), address_draws_fragment, false), bad(gpu(), tracer_comp, true);
    expectOthers([&](VkPipelineCreateFlags flags, VkPipeline *pipelines) {
        auto rendering = vkInit<VkPipelineRenderingCreateInfo>();
        auto library = vkInit<VkGraphicsPipelineLibraryCreateInfoEXT>(
            {.pNext = &rendering, .flags = VK_GRAPHICS_PIPELINE_LIBRARY_FRAGMENT_SHADER_BIT_EXT});
        auto depth = vkInit<VkPipelineDepthStencilStateCreateInfo>();
        auto samples = vkInit<VkPipelineMultisampleStateCreateInfo>({.rasterizationSamples = VK_SAMPLE_COUNT_1_BIT});
        std::array<VkPipelineShaderStageCreateInfo, kCount> stages{};
        std::array<VkGraphicsPipelineCreateInfo, kCount> infos{};
        for (uint32_t i = 0; i < kCount; ++i) {
            stages[i] = stageOf(VK_SHADER_STAGE_FRAGMENT_BIT, i == kBad ? bad : good);
            infos[i] = vkInit<VkGraphicsPipelineCreateInfo>({.pNext = &library,
                                                             .flags = flags | VK_PIPELINE_CREATE_LIBRARY_BIT_KHR,
                                                             .stageCount = 1,
                                                             .pStages = &stages[i],
                                                             .pMultisampleState = &samples,
                                                             .pDepthStencilState = &depth,
                                                             .layout = tracer.layout(),
                                                             .basePipelineIndex = -1});
        }
        return vkCreateGraphicsPipelines(gpu().device(), VK_NULL_HANDLE, kCount, infos.data(), nullptr, pipelines);
    });
}

TEST_F(MultipleCreation, RayTracing)
{
    if (!gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        GTEST_SKIP() << "no ray tracing pipelines";
    const Tracer tracer(gpu());
    const InlineModule good(gpu(), query_raygen, false), bad(gpu(), query_raygen, true);
    for (const VkPipelineCreateFlags micromaps : {VkPipelineCreateFlags{0}, kMicromapBit}) {
        SCOPED_TRACE(micromaps);
        expectOthers([&](VkPipelineCreateFlags flags, VkPipeline *pipelines) {
            PipelineSetup setup;
            setup.stages = {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, query_raygen}};
            setup.groups = {{.general = 0}};
            setup.layout = tracer.layout();
            setup.flags = flags | micromaps;
            const PipelineInfo info(gpu(), setup);
            const std::array stages{stageOf(VK_SHADER_STAGE_RAYGEN_BIT_KHR, good),
                                    stageOf(VK_SHADER_STAGE_RAYGEN_BIT_KHR, bad)};
            std::array<VkRayTracingPipelineCreateInfoKHR, kCount> infos;
            infos.fill(info.get());
            for (uint32_t i = 0; i < kCount; ++i)
                infos[i].pStages = &stages[i == kBad ? 1 : 0];
            return gpu().vk().CreateRayTracingPipelinesKHR(gpu().device(), VK_NULL_HANDLE, VK_NULL_HANDLE, kCount,
                                                           infos.data(), nullptr, pipelines);
        });
    }
}

class MultipleShaders : public MultipleCreation
{
protected:
    MultipleShaders() : MultipleCreation({.validation = false, .shaderObject = true}) {}
};

// "the application can determine which shader the returned error pertains to by locating the first VK_NULL_HANDLE
// element": those before the bad one are made.
TEST_F(MultipleShaders, BeforeTheBadOne)
{
    if (!gpu().has("VK_EXT_shader_object"))
        GTEST_SKIP() << "no VK_EXT_shader_object";
    const auto create = reinterpret_cast<CreateShaders>(vkGetDeviceProcAddr(gpu().device(), "vkCreateShadersEXT"));
    const auto destroy = reinterpret_cast<DestroyShader>(vkGetDeviceProcAddr(gpu().device(), "vkDestroyShaderEXT"));
    const Tracer tracer(gpu());
    const TracerShader description(gpu(), tracer);
    std::array<ShaderCreateInfo, kCount> infos;
    infos.fill(description.info);
    infos[kBad].codeSize -= sizeof(uint32_t); // in the middle of an instruction
    std::array<ShaderHandle, kCount> shaders;
    shaders.fill(7); // to be overwritten
    EXPECT_EQ(create(gpu().device(), kCount, infos.data(), nullptr, shaders.data()), VK_ERROR_INITIALIZATION_FAILED);
    EXPECT_NE(shaders[0], 0u);
    EXPECT_NE(shaders[0], 7u);
    EXPECT_EQ(shaders[1], 0u);
    EXPECT_EQ(shaders[2], 0u);
    destroy(gpu().device(), shaders[0], nullptr);
    expectOneMessage("VELLUM-shader-rewrite");
}

} // namespace
