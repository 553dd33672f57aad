// VK_EXT_shader_module_identifier: pipelines of which the driver knows the code. It knows it in this process, whichever
// device compiled it (layers/cache_trait.cpp).
#include "commands/compute_pipeline.h"
#include "commands/state_scene.h"
#include "pipelines/pipeline_scene.h"

#include "shaders/empty.h"
#include "shaders/tracer_comp.h"

namespace
{

using namespace vt;

using Words = std::span<const std::uint32_t>;
using Identifier = std::vector<std::uint8_t>;

Options cachingDriver(bool vellum = true)
{
    return {.vellum = vellum, .oldValidation = false, .traits = "caching", .micromaps = vellum, .newer = true};
}

VkShaderModuleIdentifierEXT emptyIdentifier()
{
    VkShaderModuleIdentifierEXT identifier{};
    identifier.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_IDENTIFIER_EXT;
    return identifier;
}

Identifier bytesOf(const VkShaderModuleIdentifierEXT &identifier)
{
    return {identifier.identifier, identifier.identifier + identifier.identifierSize};
}

Identifier ofModule(const Gpu &gpu, Words words)
{
    const auto get = reinterpret_cast<PFN_vkGetShaderModuleIdentifierEXT>(
        vkGetDeviceProcAddr(gpu.device(), "vkGetShaderModuleIdentifierEXT"));
    const VkShaderModule module = gpu.shader(words);
    VkShaderModuleIdentifierEXT identifier = emptyIdentifier();
    get(gpu.device(), module, &identifier);
    vkDestroyShaderModule(gpu.device(), module, nullptr);
    return bytesOf(identifier);
}

Identifier ofInfo(const Gpu &gpu, Words words)
{
    const auto get = reinterpret_cast<PFN_vkGetShaderModuleCreateInfoIdentifierEXT>(
        vkGetDeviceProcAddr(gpu.device(), "vkGetShaderModuleCreateInfoIdentifierEXT"));
    const std::vector<std::uint32_t> code = gpu.code(words);
    VkShaderModuleCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO;
    info.codeSize = code.size() * 4;
    info.pCode = code.data();
    VkShaderModuleIdentifierEXT identifier = emptyIdentifier();
    get(gpu.device(), &info, &identifier);
    return bytesOf(identifier);
}

VkPipelineShaderStageModuleIdentifierCreateInfoEXT nameOf(const Identifier &identifier)
{
    VkPipelineShaderStageModuleIdentifierCreateInfoEXT name{};
    name.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_MODULE_IDENTIFIER_CREATE_INFO_EXT;
    name.identifierSize = static_cast<std::uint32_t>(identifier.size());
    name.pIdentifier = identifier.data();
    return name;
}

// Null where the driver does not know the code.
VkPipeline computePipeline(const Gpu &gpu, VkPipelineLayout layout, const Identifier &identifier)
{
    const auto name = nameOf(identifier);
    VkComputePipelineCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO;
    info.flags = VK_PIPELINE_CREATE_FAIL_ON_PIPELINE_COMPILE_REQUIRED_BIT;
    info.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    info.stage.pNext = &name;
    info.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
    info.stage.pName = "main";
    info.layout = layout;
    VkPipeline pipeline = VK_NULL_HANDLE;
    const VkResult result = vkCreateComputePipelines(gpu.device(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline);
    EXPECT_EQ(result, pipeline == VK_NULL_HANDLE ? VK_PIPELINE_COMPILE_REQUIRED : VK_SUCCESS);
    return pipeline;
}

class ModuleIdentifiers : public PipelineSceneTest
{
protected:
    ModuleIdentifiers() : PipelineSceneTest(cachingDriver()) {}

    // A pipeline of that code, so that the driver has compiled it, destroyed.
    static void compile(Gpu &gpu, const Tracer &tracer, Words words)
    {
        const ComputePipeline pipeline(gpu, tracer.layout(), words, 0);
    }
    static void expectTraces(Gpu &gpu, const Identifier &identifier)
    {
        StateScene scene(gpu);
        Tracer tracer(gpu);
        const VkPipeline pipeline = computePipeline(gpu, tracer.layout(), identifier);
        ASSERT_TRUE(pipeline != VK_NULL_HANDLE);
        tracer.prepare(scene.tlas(), StateScene::rays());
        gpu.submit([&](VkCommandBuffer commands) {
            scene.record(commands);
            tracer.bind(commands);
            vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, pipeline);
            tracer.dispatch(commands);
            barrier(commands);
        });
        StateScene::expectRight(tracer.results());
        vkDestroyPipeline(gpu.device(), pipeline, nullptr);
    }
    static bool known(Gpu &gpu, const Tracer &tracer, const Identifier &identifier)
    {
        const VkPipeline pipeline = computePipeline(gpu, tracer.layout(), identifier);
        vkDestroyPipeline(gpu.device(), pipeline, nullptr);
        return pipeline != VK_NULL_HANDLE;
    }
};

TEST_F(ModuleIdentifiers, AreThoseOfTheCode)
{
    EXPECT_EQ(ofModule(gpu(), tracer_comp), ofInfo(gpu(), tracer_comp));
    EXPECT_EQ(ofModule(gpu(), empty), ofInfo(gpu(), empty));
    EXPECT_NE(ofModule(gpu(), tracer_comp), ofModule(gpu(), empty));
    EXPECT_EQ(ofModule(gpu(), tracer_comp).size(), 32u);
}

TEST_F(ModuleIdentifiers, NameAQuery)
{
    const Tracer tracer(gpu()); // compiles it
    expectTraces(gpu(), ofModule(gpu(), tracer_comp));
    expectTraces(gpu(), ofInfo(gpu(), tracer_comp));
}

TEST_F(ModuleIdentifiers, NameShadersThatTraceNoRays)
{
    const Tracer tracer(gpu());
    compile(gpu(), tracer, empty);
    EXPECT_TRUE(known(gpu(), tracer, ofModule(gpu(), empty)));
    Identifier other = ofModule(gpu(), empty);
    other[7] ^= 1;
    EXPECT_FALSE(known(gpu(), tracer, other));
}

// Code with other tables in it: on another device of the process. Shaders that trace no rays are the same.
TEST_F(ModuleIdentifiers, OfAnotherDevice)
{
    Gpu other(cachingDriver());
    const Tracer tracer(gpu());
    const Tracer otherTracer(other);
    compile(other, otherTracer, empty);
    EXPECT_FALSE(known(gpu(), tracer, ofModule(other, tracer_comp)));
    EXPECT_TRUE(known(other, otherTracer, ofModule(other, tracer_comp)));
    EXPECT_TRUE(known(gpu(), tracer, ofModule(other, empty)));
}

// What was compiled without the layer would find wrong custom indices, and see no micromaps.
TEST_F(ModuleIdentifiers, OfADeviceWithoutTheLayer)
{
    Gpu bare(cachingDriver(false));
    const Tracer tracer(gpu());
    const Tracer bareTracer(bare);
    ASSERT_TRUE(known(bare, bareTracer, ofModule(bare, tracer_comp)));
    EXPECT_FALSE(known(gpu(), tracer, ofModule(bare, tracer_comp)));
}

TEST_F(ModuleIdentifiers, TellTheirAlgorithm)
{
    const auto algorithm = [](const Gpu &gpu) {
        VkPhysicalDeviceShaderModuleIdentifierPropertiesEXT own{};
        own.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_MODULE_IDENTIFIER_PROPERTIES_EXT;
        VkPhysicalDeviceProperties2 properties{};
        properties.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2;
        properties.pNext = &own;
        vkGetPhysicalDeviceProperties2(gpu.physical(), &properties);
        return std::to_array(own.shaderModuleIdentifierAlgorithmUUID);
    };
    const Gpu bare(cachingDriver(false));
    EXPECT_NE(algorithm(gpu()), algorithm(bare));
}

// An application that has kept an identifier does not ask for it again. Devices have their tables at the same address
// in each run, as here one after the other, where the driver lets the layer choose it.
class KeptIdentifiers : public testing::Test
{
};

TEST_F(KeptIdentifiers, OfAnEarlierDevice)
{
    Identifier query, other;
    std::vector<std::uint32_t> words;
    {
        Gpu gpu(cachingDriver());
        const Tracer tracer(gpu);
        query = ofModule(gpu, tracer_comp);
        const ComputePipeline pipeline(gpu, tracer.layout(), empty, 0);
        other = ofModule(gpu, empty);
    }
    Gpu gpu(cachingDriver());
    const Tracer tracer(gpu);
    const VkPipeline plain = computePipeline(gpu, tracer.layout(), other);
    const VkPipeline traces = computePipeline(gpu, tracer.layout(), query);
    EXPECT_TRUE(plain != VK_NULL_HANDLE);
    EXPECT_EQ(traces != VK_NULL_HANDLE, ofModule(gpu, tracer_comp) == query);
    vkDestroyPipeline(gpu.device(), plain, nullptr);
    vkDestroyPipeline(gpu.device(), traces, nullptr);
}

// --- ray tracing pipelines ---

class PipelineIdentifiers : public PipelineSceneTest
{
protected:
    PipelineIdentifiers() : PipelineSceneTest(cachingDriver()) {}

    // Of identifiers instead of code. Null where the driver is not asked, or does not know.
    VkPipeline named(const PipelineSetup &setup)
    {
        const RayPipeline compiled(gpu(), setup);
        std::vector<Identifier> identifiers;
        std::vector<VkPipelineShaderStageModuleIdentifierCreateInfoEXT> names;
        for (const PipelineStage &stage : setup.stages)
            identifiers.push_back(ofModule(gpu(), stage.words));
        for (const Identifier &identifier : identifiers)
            names.push_back(nameOf(identifier));
        PipelineInfo info(gpu(), setup);
        std::vector<VkPipelineShaderStageCreateInfo> stages(info.get().pStages,
                                                            info.get().pStages + info.get().stageCount);
        for (std::size_t i = 0; i < stages.size(); ++i) {
            stages[i].module = VK_NULL_HANDLE;
            stages[i].pNext = &names[i];
        }
        VkRayTracingPipelineCreateInfoKHR own = info.get();
        own.flags |= VK_PIPELINE_CREATE_FAIL_ON_PIPELINE_COMPILE_REQUIRED_BIT;
        own.pStages = stages.data();
        VkPipeline pipeline = VK_NULL_HANDLE;
        const VkResult result = gpu().vk().CreateRayTracingPipelinesKHR(gpu().device(), VK_NULL_HANDLE, VK_NULL_HANDLE,
                                                                        1, &own, nullptr, &pipeline);
        EXPECT_EQ(result, pipeline == VK_NULL_HANDLE ? VK_PIPELINE_COMPILE_REQUIRED : VK_SUCCESS);
        return pipeline;
    }
};

TEST_F(PipelineIdentifiers, WithoutTheBit)
{
    const PipelineScene plain(gpu(), {.micromaps = false});
    PipelineTracer tracer(gpu(), {.flags = 0, .make = [this](Gpu &g, const PipelineSetup &from) {
                                      return MadePipeline{RayPipeline(g, named(from)), {}};
                                  }});
    for (const std::uint32_t flags : opacityRayFlags(false))
        plain.expect(tracer, flags);
}

// Its shaders depend on the groups that they are in, and cannot be made without their code.
TEST_F(PipelineIdentifiers, WithTheBit)
{
    const PipelineTracer tracer(gpu(), {.make = [this](Gpu &g, const PipelineSetup &from) {
                                    EXPECT_TRUE(named(from) == VK_NULL_HANDLE);
                                    return MadePipeline{RayPipeline(g, from), {}};
                                }});
}

} // namespace
