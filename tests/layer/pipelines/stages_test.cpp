// SPDX-License-Identifier: Apache-2.0
// Ray queries outside compute shaders.
#include "gpu/programs/graphics.h"
#include "harness/columns.h"

#include "harness/program/labels.h"
#include "shaders/plain_fragment.h"
#include "shaders/plain_vertex.h"
#include "shaders/query_fragment.h"
#include "shaders/query_raygen.h"
#include "shaders/query_vertex.h"
#include "shaders/tracer_comp.h"

namespace
{

const vt::Labels kStagesLabels{
    {"Stages.*", "forcing"}, {"StagesOfLibraries.*", "forcing"}, {"StagesOfGroups.*", "one_api"}};

using namespace vt;

class Stages : public GpuTest
{
protected:
    explicit Stages(const Options &options = {}) : GpuTest(options) {}

    // Columns, traced by whatever `record` does with the tracer's descriptor set.
    void expectColumns(const std::function<void(VkCommandBuffer, const Tracer &)> &record)
    {
        const Columns columns(gpu(), 4, kAlways);
        tracer_.prepare(columns.scene(), columns.rays(), 1);
        gpu().submit([&](VkCommandBuffer commands) {
            barrier(commands);
            record(commands, tracer_);
            barrier(commands);
        });
        const std::vector<Result> results = tracer_.results();
        for (uint32_t i = 0; i < Columns::kColumns; ++i) {
            SCOPED_TRACE(testing::Message() << "column " << i);
            Columns::expectCommitted(results[i], columns.nearest(i, true));
        }
    }

    void expectGraphics(const Graphics::Shaders &shaders, uint32_t vertices)
    {
        const Graphics graphics(gpu(), tracer_.layout(), shaders, Columns::kColumns);
        expectColumns([&](VkCommandBuffer commands, const Tracer &tracer) {
            graphics.bind(commands);
            const VkDescriptorSet set = tracer.set();
            vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, tracer.layout(), 0, 1, &set, 0, nullptr);
            graphics.draw(commands, vertices);
        });
    }

    Tracer tracer_{gpu()};
};

TEST_F(Stages, Vertex)
{
    expectGraphics({query_vertex, plain_fragment, false, VK_PRIMITIVE_TOPOLOGY_POINT_LIST}, Columns::kColumns);
}

TEST_F(Stages, Fragment)
{
    expectGraphics({plain_vertex, query_fragment, false}, 3);
}

TEST_F(Stages, InlineModules)
{
    if (!gpu().has(VK_EXT_GRAPHICS_PIPELINE_LIBRARY_EXTENSION_NAME))
        GTEST_SKIP() << "no way to pass a shader module in the stage";
    expectGraphics({query_vertex, plain_fragment, true, VK_PRIMITIVE_TOPOLOGY_POINT_LIST}, Columns::kColumns);
    expectGraphics({plain_vertex, query_fragment, true}, 3);
}

// 1.3.239 of the validation layer misses in linked pipelines what their libraries have.
class StagesOfLibraries : public Stages
{
protected:
    StagesOfLibraries() : Stages({.oldValidation = false}) {}
};

// VK_EXT_graphics_pipeline_library: the shaders are in two libraries, as modules or as code.
TEST_F(StagesOfLibraries, VertexAndFragment)
{
    if (!gpu().has(VK_EXT_GRAPHICS_PIPELINE_LIBRARY_EXTENSION_NAME))
        GTEST_SKIP() << "no graphics pipeline libraries";
    for (const bool inlineModules : {false, true}) {
        expectGraphics({.vertex = query_vertex,
                        .fragment = plain_fragment,
                        .inlineModules = inlineModules,
                        .topology = VK_PRIMITIVE_TOPOLOGY_POINT_LIST,
                        .libraries = true},
                       Columns::kColumns);
        expectGraphics(
            {.vertex = plain_vertex, .fragment = query_fragment, .inlineModules = inlineModules, .libraries = true}, 3);
    }
}

// Stages of VK_NV_device_generated_commands, which lavapipe lacks and ignores: the spy looks at them.
class StagesOfGroups : public Stages
{
protected:
    StagesOfGroups() : Stages({.validation = false, .api = Api::Khr}) {}
};

TEST_F(StagesOfGroups, InlineModules)
{
    const std::vector<uint32_t> code = gpu().code(query_fragment);
    const auto module =
        vkInit<VkShaderModuleCreateInfo>({.codeSize = code.size() * sizeof(uint32_t), .pCode = code.data()});
    const auto stage = vkInit<VkPipelineShaderStageCreateInfo>(
        {.pNext = &module, .stage = VK_SHADER_STAGE_FRAGMENT_BIT, .pName = "main"});
    const auto group = vkInit<VkGraphicsShaderGroupCreateInfoNV>({.stageCount = 1, .pStages = &stage});
    const auto groups = vkInit<VkGraphicsPipelineShaderGroupsCreateInfoNV>({.groupCount = 1, .pGroups = &group});
    const Graphics graphics(gpu(), tracer_.layout(),
                            {.vertex = plain_vertex, .fragment = plain_fragment, .pNext = &groups}, 1);
}

// VK_NV_device_generated_commands_compute: the memory is for the pipeline of rewritten code.
TEST_F(StagesOfGroups, MemoryRequirements)
{
    const std::vector<uint32_t> code = gpu().code(tracer_comp);
    const auto module =
        vkInit<VkShaderModuleCreateInfo>({.codeSize = code.size() * sizeof(uint32_t), .pCode = code.data()});
    const auto info = vkInit<VkComputePipelineCreateInfo>(
        {.stage = vkInit<VkPipelineShaderStageCreateInfo>(
             {.pNext = &module, .stage = VK_SHADER_STAGE_COMPUTE_BIT, .pName = "main"}),
         .layout = tracer_.layout()});
    const auto get = reinterpret_cast<PFN_vkGetPipelineIndirectMemoryRequirementsNV>(
        vkGetDeviceProcAddr(gpu().device(), "vkGetPipelineIndirectMemoryRequirementsNV"));
    auto requirements = vkInit<VkMemoryRequirements2>();
    get(gpu().device(), &info, &requirements);
    EXPECT_EQ(requirements.memoryRequirements.size, 256u);
}

TEST_F(Stages, RayGeneration)
{
    if (!gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        GTEST_SKIP() << "no ray tracing pipelines";
    auto group = vkInit<VkRayTracingShaderGroupCreateInfoKHR>({.type = VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR});
    group.closestHitShader = group.anyHitShader = group.intersectionShader = VK_SHADER_UNUSED_KHR;
    auto stage = vkInit<VkPipelineShaderStageCreateInfo>(
        {.stage = VK_SHADER_STAGE_RAYGEN_BIT_KHR, .module = gpu().shader(query_raygen), .pName = "main"});
    auto info = vkInit<VkRayTracingPipelineCreateInfoKHR>({.stageCount = 1,
                                                           .pStages = &stage,
                                                           .groupCount = 1,
                                                           .pGroups = &group,
                                                           .maxPipelineRayRecursionDepth = 1,
                                                           .layout = tracer_.layout()});
    VkPipeline pipeline = VK_NULL_HANDLE;
    VT_CHECK(gpu().vk().CreateRayTracingPipelinesKHR(gpu().device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info, nullptr,
                                                     &pipeline));
    vkDestroyShaderModule(gpu().device(), stage.module, nullptr);

    const auto &limits = gpu().pipelineProperties();
    const Guarded table(gpu(), limits.shaderGroupHandleSize, std::max(limits.shaderGroupBaseAlignment, 64u),
                        VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    VT_CHECK(gpu().vk().GetRayTracingShaderGroupHandlesKHR(gpu().device(), pipeline, 0, 1, limits.shaderGroupHandleSize,
                                                           table.bytes()));
    const VkStridedDeviceAddressRegionKHR raygen{table.address(), limits.shaderGroupHandleSize,
                                                 limits.shaderGroupHandleSize};
    const VkStridedDeviceAddressRegionKHR none{};
    expectColumns([&](VkCommandBuffer commands, const Tracer &tracer) {
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, pipeline);
        const VkDescriptorSet set = tracer.set();
        vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR, tracer.layout(), 0, 1, &set, 0,
                                nullptr);
        gpu().vk().CmdTraceRaysKHR(commands, &raygen, &none, &none, &none, Columns::kColumns, 1, 1);
    });
    vkDestroyPipeline(gpu().device(), pipeline, nullptr);
}

} // namespace
