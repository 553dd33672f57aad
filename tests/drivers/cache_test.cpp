// SPDX-License-Identifier: Apache-2.0
// Names of code that a real driver gives and takes: RADV's identifiers of shader modules and binaries of pipelines, for
// a GPU that is not there.
#include "compiled.h"
#include "pipelines/pipeline_binaries.h"
#include "shaders/compiler_query.h"
#include "shaders/compiler_tracer_any_hit.h"
#include "shaders/compiler_tracer_closest_hit.h"
#include "shaders/compiler_tracer_intersection.h"
#include "shaders/compiler_tracer_miss.h"
#include "shaders/compiler_tracer_raygen.h"

namespace vellum::test
{
namespace
{

class CompilerNames : public testing::Test
{
protected:
    void SetUp() override
    {
        unsetenv("RADV_PERFTEST");
        vt::Options options{.validation = false, .spy = false};
        if (const std::string whyNot = useGpu("navi31", options); !whyNot.empty())
            GTEST_SKIP() << whyNot;
        options.newer = true;
        gpu_ = std::make_unique<vt::Gpu>(options);
    }
    void TearDown() override
    {
        if (!gpu_)
            return;
        for (const vt::Message &m : gpu_->takeUnexpectedMessages())
            ADD_FAILURE() << m.id << ": " << m.text;
    }
    vt::Gpu &gpu() { return *gpu_; }

private:
    std::unique_ptr<vt::Gpu> gpu_;
};

TEST_F(CompilerNames, IdentifierOfAQuery)
{
    if (!gpu().has(VK_EXT_SHADER_MODULE_IDENTIFIER_EXTENSION_NAME))
        GTEST_SKIP() << "the driver does not have VK_EXT_shader_module_identifier";
    const auto identify = reinterpret_cast<PFN_vkGetShaderModuleIdentifierEXT>(
        vkGetDeviceProcAddr(gpu().device(), "vkGetShaderModuleIdentifierEXT"));
    auto identifier = vkInit<VkShaderModuleIdentifierEXT>();
    const VkShaderModule module = gpu().shader(compiler_query);
    identify(gpu().device(), module, &identifier);
    const Layout layout(gpu(), {factsOf(compiler_query)});
    auto cacheInfo = vkInit<VkPipelineCacheCreateInfo>();
    VkPipelineCache cache = VK_NULL_HANDLE;
    VT_CHECK(vkCreatePipelineCache(gpu().device(), &cacheInfo, nullptr, &cache));

    auto name = vkInit<VkPipelineShaderStageModuleIdentifierCreateInfoEXT>(
        {.identifierSize = identifier.identifierSize, .pIdentifier = identifier.identifier});
    auto info = vkInit<VkComputePipelineCreateInfo>(
        {.stage = vkInit<VkPipelineShaderStageCreateInfo>({.stage = VK_SHADER_STAGE_COMPUTE_BIT, .pName = "main"}),
         .layout = layout.handle()});
    const auto create = [&](bool byName) {
        info.flags = byName ? 0u + VK_PIPELINE_CREATE_FAIL_ON_PIPELINE_COMPILE_REQUIRED_BIT : 0u;
        info.stage.module = byName ? VK_NULL_HANDLE : module;
        info.stage.pNext = byName ? &name : nullptr;
        VkPipeline pipeline = VK_NULL_HANDLE;
        const VkResult result = vkCreateComputePipelines(gpu().device(), cache, 1, &info, nullptr, &pipeline);
        vkDestroyPipeline(gpu().device(), pipeline, nullptr);
        return result;
    };
    EXPECT_EQ(create(true), VK_PIPELINE_COMPILE_REQUIRED);
    EXPECT_EQ(create(false), VK_SUCCESS);
    EXPECT_EQ(create(true), VK_SUCCESS);
    identifier.identifier[0] ^= 0x80;
    EXPECT_EQ(create(true), VK_PIPELINE_COMPILE_REQUIRED);
    vkDestroyPipelineCache(gpu().device(), cache, nullptr);
    vkDestroyShaderModule(gpu().device(), module, nullptr);
}

TEST_F(CompilerNames, BinariesOfARayTracingPipeline)
{
    if (!gpu().has("VK_KHR_pipeline_binary"))
        GTEST_SKIP() << "the driver does not have VK_KHR_pipeline_binary";
    vt::PipelineSetup setup;
    setup.stages = {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, compiler_tracer_raygen},
                    {VK_SHADER_STAGE_MISS_BIT_KHR, compiler_tracer_miss},
                    {VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, compiler_tracer_closest_hit},
                    {VK_SHADER_STAGE_ANY_HIT_BIT_KHR, compiler_tracer_any_hit},
                    {VK_SHADER_STAGE_INTERSECTION_BIT_KHR, compiler_tracer_intersection}};
    setup.groups = {{.general = 0},
                    {.general = 1},
                    {.closestHit = 2, .anyHit = 3},
                    {.closestHit = 2},
                    {.closestHit = 2, .anyHit = 3, .intersection = 4}};
    std::vector<ModuleFacts> facts;
    for (const vt::PipelineStage &stage : setup.stages)
        facts.push_back(factsOf(stage.words));
    const Layout layout(gpu(), facts);
    setup.layout = layout.handle();

    auto flags = vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = vt::kMicromapBit | vt::kCaptureData});
    vt::PipelineInfo described(gpu(), setup);
    VkRayTracingPipelineCreateInfoKHR info = described.get();
    info.pNext = &flags;
    const auto create = [&] {
        VkPipeline pipeline = VK_NULL_HANDLE;
        VT_CHECK(gpu().vk().CreateRayTracingPipelinesKHR(gpu().device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info,
                                                         nullptr, &pipeline));
        return pipeline;
    };
    vt::Binaries binaries(gpu());
    const auto key = binaries.key(&info);
    EXPECT_EQ(binaries.key(&info), key);
    const VkPipeline captured = create();
    const std::vector<VkPipelineBinaryKHR> first = binaries.allFrom(captured);
    ASSERT_GT(first.size(), 1u);
    vkDestroyPipeline(gpu().device(), captured, nullptr);
    std::vector<VkPipelineBinaryKHR> again;
    for (const VkPipelineBinaryKHR binary : first)
        again.push_back(binaries.from(binaries.keep(binary)));
    const auto made = vkInit<VkPipelineBinaryInfoKHR>(
        {.pNext = &flags, .binaryCount = static_cast<uint32_t>(again.size()), .pPipelineBinaries = again.data()});
    flags.flags = vt::kMicromapBit;
    std::vector<VkPipelineShaderStageCreateInfo> stages(info.pStages, info.pStages + info.stageCount);
    for (VkPipelineShaderStageCreateInfo &stage : stages)
        stage.module = VK_NULL_HANDLE;
    info.pNext = &made;
    info.pStages = stages.data();
    const vt::RayPipeline remade(gpu(), create());
    EXPECT_EQ(remade.groupHandles(0, 5).size(), 5u * 32);
}

} // namespace
} // namespace vellum::test
