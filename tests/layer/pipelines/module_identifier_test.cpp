// SPDX-License-Identifier: Apache-2.0
// VK_EXT_shader_module_identifier: pipelines whose code the driver has. It keeps code for the life of the process,
// whichever device compiled it (layers/cache_quirk.cpp).
#include "command_buffer/compute_pipeline.h"
#include "command_buffer/state_scene.h"
#include "pipelines/pipeline_binaries.h"
#include "pipelines/pipeline_scene.h"

#include "harness/program/labels.h"
#include "shaders/empty.h"
#include "shaders/tracer_comp.h"

namespace
{

const vt::Labels kModuleIdentifierLabels{{"ModuleIdentifiers.DependOnTheCode", "translated"},
                                         {"ModuleIdentifiers.NameAQuery", "translated"},
                                         {"ModuleIdentifiers.NameShadersThatTraceNoRays", "translated"}};

using namespace vt;

using Words = std::span<const uint32_t>;
using Identifier = std::vector<uint8_t>;

Options cachingDriver(bool vellum = true)
{
    return {.vellum = vellum, .oldValidation = false, .quirks = "caching", .micromaps = vellum, .newer = true};
}

VkShaderModuleIdentifierEXT emptyIdentifier()
{
    return vkInit<VkShaderModuleIdentifierEXT>();
}

Identifier bytesOf(const VkShaderModuleIdentifierEXT &identifier)
{
    return {identifier.identifier, identifier.identifier + identifier.identifierSize};
}

Identifier ofModule(const Device &gpu, Words words)
{
    const auto get = reinterpret_cast<PFN_vkGetShaderModuleIdentifierEXT>(
        vkGetDeviceProcAddr(gpu.device(), "vkGetShaderModuleIdentifierEXT"));
    const VkShaderModule module = gpu.shader(words);
    VkShaderModuleIdentifierEXT identifier = emptyIdentifier();
    get(gpu.device(), module, &identifier);
    vkDestroyShaderModule(gpu.device(), module, nullptr);
    return bytesOf(identifier);
}

Identifier ofInfo(const Device &gpu, Words words)
{
    const auto get = reinterpret_cast<PFN_vkGetShaderModuleCreateInfoIdentifierEXT>(
        vkGetDeviceProcAddr(gpu.device(), "vkGetShaderModuleCreateInfoIdentifierEXT"));
    const std::vector<uint32_t> code = gpu.code(words);
    auto info = vkInit<VkShaderModuleCreateInfo>({.codeSize = code.size() * 4, .pCode = code.data()});
    VkShaderModuleIdentifierEXT identifier = emptyIdentifier();
    get(gpu.device(), &info, &identifier);
    return bytesOf(identifier);
}

VkPipelineShaderStageModuleIdentifierCreateInfoEXT nameOf(const Identifier &identifier)
{
    return vkInit<VkPipelineShaderStageModuleIdentifierCreateInfoEXT>(
        {.identifierSize = static_cast<uint32_t>(identifier.size()), .pIdentifier = identifier.data()});
}

constexpr VkPipelineCreateFlags kOnlyKnown = VK_PIPELINE_CREATE_FAIL_ON_PIPELINE_COMPILE_REQUIRED_BIT;

VkComputePipelineCreateInfo computeInfo(VkPipelineLayout layout, const void *stageChain,
                                        VkPipelineCreateFlags flags = kOnlyKnown)
{
    return vkInit<VkComputePipelineCreateInfo>(
        {.flags = flags,
         .stage = vkInit<VkPipelineShaderStageCreateInfo>(
             {.pNext = stageChain, .stage = VK_SHADER_STAGE_COMPUTE_BIT, .pName = "main"}),
         .layout = layout});
}

// Null where the driver does not know the code. `behindUnknown`: the identifier lies behind a structure of the future.
VkPipeline computePipeline(const Gpu &gpu, VkPipelineLayout layout, const Identifier &identifier,
                           bool behindUnknown = false)
{
    const auto name = nameOf(identifier);
    const VkBaseInStructure unknown{static_cast<VkStructureType>(0x7ffffff0),
                                    reinterpret_cast<const VkBaseInStructure *>(&name)};
    const VkComputePipelineCreateInfo info =
        computeInfo(layout, behindUnknown ? static_cast<const void *>(&unknown) : &name);
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

TEST_F(ModuleIdentifiers, DependOnTheCode)
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
TEST_F(ModuleIdentifiers, AnotherDevice)
{
    Gpu other(cachingDriver());
    const Tracer tracer(gpu());
    const Tracer otherTracer(other);
    compile(other, otherTracer, empty);
    EXPECT_FALSE(known(gpu(), tracer, ofModule(other, tracer_comp)));
    EXPECT_TRUE(known(other, otherTracer, ofModule(other, tracer_comp)));
    EXPECT_TRUE(known(gpu(), tracer, ofModule(other, empty)));
}

// Code that was compiled without the layer would find wrong custom indices, and see no micromaps.
TEST_F(ModuleIdentifiers, DeviceWithoutTheLayer)
{
    Gpu bare(cachingDriver(false));
    const Tracer tracer(gpu());
    const Tracer bareTracer(bare);
    ASSERT_TRUE(known(bare, bareTracer, ofModule(bare, tracer_comp)));
    EXPECT_FALSE(known(gpu(), tracer, ofModule(bare, tracer_comp)));
}

// If the layer cannot replace the identifier, the driver must not find a module of its own by it.
TEST_F(ModuleIdentifiers, BehindAnUnknownStructure)
{
    Gpu bare(cachingDriver(false));
    const Tracer tracer(gpu());
    const Tracer bareTracer(bare);
    for (const Identifier &identifier : {ofModule(bare, tracer_comp), ofModule(gpu(), tracer_comp)}) {
        const VkPipeline pipeline = computePipeline(gpu(), tracer.layout(), identifier, true);
        EXPECT_TRUE(pipeline == VK_NULL_HANDLE);
        vkDestroyPipeline(gpu().device(), pipeline, nullptr);
    }
}

// Both use the algorithm of the physical device.
TEST_F(ModuleIdentifiers, DeviceWithoutMicromaps)
{
    Options options = cachingDriver();
    options.micromaps = false;
    Identifier query;
    {
        Gpu plain(options);
        const Tracer tracer(gpu());
        const Tracer plainTracer(plain);
        compile(plain, plainTracer, empty);
        EXPECT_EQ(ofModule(plain, empty), ofModule(gpu(), empty));
        EXPECT_EQ(ofInfo(plain, empty), ofModule(gpu(), empty));
        EXPECT_TRUE(known(plain, plainTracer, ofModule(gpu(), empty)));
        EXPECT_TRUE(known(gpu(), tracer, ofModule(plain, empty)));
        query = ofModule(plain, tracer_comp);
        EXPECT_EQ(query, ofInfo(plain, tracer_comp));
        EXPECT_TRUE(known(plain, plainTracer, query));
        EXPECT_FALSE(known(gpu(), tracer, query));
        EXPECT_FALSE(known(plain, plainTracer, ofModule(gpu(), tracer_comp)));
        Gpu bare(cachingDriver(false));
        EXPECT_FALSE(known(plain, plainTracer, ofModule(bare, empty)));
        EXPECT_FALSE(known(plain, plainTracer, ofModule(bare, tracer_comp)));
    }
    Gpu later(options);
    const Tracer laterTracer(later);
    EXPECT_TRUE(known(later, laterTracer, query));
}

// Code that the layer cannot rewrite has no module on the device, and its identifier must not match what others
// compiled.
TEST_F(ModuleIdentifiers, CodeThatCannotBeRewritten)
{
    std::vector<uint32_t> broken = gpu().code(tracer_comp);
    broken.pop_back(); // in the middle of an instruction
    auto info = vkInit<VkShaderModuleCreateInfo>({.codeSize = broken.size() * 4, .pCode = broken.data()});
    const auto get = [&info](const Gpu &gpu) {
        VkShaderModuleIdentifierEXT identifier = emptyIdentifier();
        reinterpret_cast<PFN_vkGetShaderModuleCreateInfoIdentifierEXT>(vkGetDeviceProcAddr(
            gpu.device(), "vkGetShaderModuleCreateInfoIdentifierEXT"))(gpu.device(), &info, &identifier);
        return bytesOf(identifier);
    };
    const Identifier identifier = get(gpu());
    const std::vector<Message> messages = gpu().takeUnexpectedMessages();
    ASSERT_EQ(messages.size(), 1u);
    EXPECT_EQ(messages[0].id, "VELLUM-shader-rewrite");
    // The identifier is that of a device without micromaps, on which the driver gets the code unchanged.
    Options options = cachingDriver();
    options.micromaps = false;
    const Gpu plain(options);
    EXPECT_EQ(identifier, get(plain));
}

TEST_F(ModuleIdentifiers, ReportTheirAlgorithm)
{
    const auto algorithm = [](const Gpu &gpu) {
        auto own = vkInit<VkPhysicalDeviceShaderModuleIdentifierPropertiesEXT>();
        auto properties = vkInit<VkPhysicalDeviceProperties2>({.pNext = &own});
        vkGetPhysicalDeviceProperties2(gpu.physical(), &properties);
        return std::to_array(own.shaderModuleIdentifierAlgorithmUUID);
    };
    const Gpu bare(cachingDriver(false));
    EXPECT_NE(algorithm(gpu()), algorithm(bare));
}

// An application that has kept an identifier does not query it again. Devices have their tables at the same address
// in each run, as here one after the other, where the driver lets the layer choose it.
class KeptIdentifiers : public testing::Test
{
};

TEST_F(KeptIdentifiers, OfAnEarlierDevice)
{
    Identifier query, other;
    std::vector<uint32_t> words;
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

// If the driver knew the identifier, the key of a pipeline equals that of the pipeline with its code, and the driver's
// own cache is found by every lookup.
TEST_F(KeptIdentifiers, InKeysAndCaches)
{
    Identifier query;
    const auto capture = vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = kCaptureData});
    const auto captureKnown = vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = kCaptureData | kOnlyKnown});
    const auto byCode = [&capture](const Gpu &gpu, const Tracer &tracer, auto use) {
        const VkShaderModule module = gpu.shader(tracer_comp);
        VkComputePipelineCreateInfo info = computeInfo(tracer.layout(), nullptr, 0);
        info.pNext = &capture;
        info.stage.module = module;
        use(info);
        vkDestroyShaderModule(gpu.device(), module, nullptr);
    };
    {
        Gpu gpu(cachingDriver());
        const Tracer tracer(gpu);
        query = ofModule(gpu, tracer_comp);
        byCode(gpu, tracer, [&gpu](const VkComputePipelineCreateInfo &info) {
            VkPipeline pipeline = VK_NULL_HANDLE;
            VT_CHECK(vkCreateComputePipelines(gpu.device(), VK_NULL_HANDLE, 1, &info, nullptr, &pipeline));
            vkDestroyPipeline(gpu.device(), pipeline, nullptr);
        });
    }
    const auto name = nameOf(query);
    for (const bool cache : {false, true}) {
        Gpu gpu(cachingDriver());
        const Tracer tracer(gpu);
        Binaries binaries(gpu);
        VkComputePipelineCreateInfo info = computeInfo(tracer.layout(), &name, 0);
        info.pNext = &captureKnown;
        bool found = false;
        if (cache) {
            found = binaries.fromCache(&info) != nullptr;
            EXPECT_TRUE(found || binaries.last() == VK_PIPELINE_BINARY_MISSING_KHR);
        } else {
            const VkPipeline pipeline = computePipeline(gpu, tracer.layout(), query);
            found = pipeline != VK_NULL_HANDLE;
            vkDestroyPipeline(gpu.device(), pipeline, nullptr);
        }
        const std::vector<uint8_t> key = binaries.key(&info);
        EXPECT_EQ(found, ofModule(gpu, tracer_comp) == query);
        if (!found)
            GTEST_SKIP() << "the tables are elsewhere for each device";
        byCode(gpu, tracer, [&](const VkComputePipelineCreateInfo &whole) { EXPECT_EQ(binaries.key(&whole), key); });
    }
}

// A driver that has no binary for the first way to read the identifier writes that it has written none.
TEST_F(KeptIdentifiers, FromTheCacheWithoutACountQuery)
{
    const auto capture = vkInit<VkPipelineCreateFlags2CreateInfoKHR>({.flags = kCaptureData | kOnlyKnown});
    Identifier query;
    {
        Gpu gpu(cachingDriver());
        const Tracer tracer(gpu);
        query = ofModule(gpu, tracer_comp);
        const ComputePipeline pipeline(gpu, tracer.layout(), tracer_comp, kCaptureData);
    }
    Gpu gpu(cachingDriver());
    const Tracer tracer(gpu);
    const auto name = nameOf(query);
    VkComputePipelineCreateInfo info = computeInfo(tracer.layout(), &name, 0);
    info.pNext = &capture;
    Binaries binaries(gpu);
    const VkPipelineBinaryKHR binary = binaries.fromCacheAtOnce(&info);
    if (ofModule(gpu, tracer_comp) != query)
        GTEST_SKIP() << "the tables are elsewhere for each device";
    EXPECT_EQ(binaries.last(), VK_SUCCESS);
    EXPECT_TRUE(binary != nullptr);
}

// --- ray tracing pipelines ---

class PipelineIdentifiers : public PipelineSceneTest
{
protected:
    PipelineIdentifiers() : PipelineSceneTest(cachingDriver()) {}

    // Uses a create info of identifiers instead of code.
    template <class Use>
    static auto withNames(Device &gpu, const PipelineSetup &setup, Use use)
    {
        std::vector<Identifier> identifiers;
        std::vector<VkPipelineShaderStageModuleIdentifierCreateInfoEXT> names;
        for (const PipelineStage &stage : setup.stages)
            identifiers.push_back(ofModule(gpu, stage.words));
        for (const Identifier &identifier : identifiers)
            names.push_back(nameOf(identifier));
        PipelineInfo info(gpu, setup);
        std::vector<VkPipelineShaderStageCreateInfo> stages(info.get().pStages,
                                                            info.get().pStages + info.get().stageCount);
        for (size_t i = 0; i < stages.size(); ++i) {
            stages[i].module = VK_NULL_HANDLE;
            stages[i].pNext = &names[i];
        }
        VkRayTracingPipelineCreateInfoKHR own = info.get();
        own.flags |= VK_PIPELINE_CREATE_FAIL_ON_PIPELINE_COMPILE_REQUIRED_BIT;
        own.pStages = stages.data();
        return use(own);
    }
    // Null if the driver does not know the identifiers.
    static VkPipeline named(Device &gpu, const PipelineSetup &setup)
    {
        const RayPipeline compiled(gpu, setup);
        return withNames(gpu, setup, [&gpu](const VkRayTracingPipelineCreateInfoKHR &info) {
            VkPipeline pipeline = VK_NULL_HANDLE;
            const VkResult result = gpu.vk().CreateRayTracingPipelinesKHR(gpu.device(), VK_NULL_HANDLE, VK_NULL_HANDLE,
                                                                          1, &info, nullptr, &pipeline);
            EXPECT_EQ(result, pipeline == VK_NULL_HANDLE ? VK_PIPELINE_COMPILE_REQUIRED : VK_SUCCESS);
            return pipeline;
        });
    }
};

TEST_F(PipelineIdentifiers, WithoutTheBit)
{
    const PipelineScene plain(gpu(), {.micromaps = false});
    PipelineTracer tracer(gpu(), {.flags = 0, .make = [](Device &g, const PipelineSetup &from) {
                                      return MadePipeline{RayPipeline(g, named(g, from)), {}};
                                  }});
    for (const uint32_t flags : opacityRayFlags(false))
        plain.expect(tracer, flags);
}

// Its shaders depend on their groups, and cannot be created without their code.
TEST_F(PipelineIdentifiers, WithTheBit)
{
    const PipelineTracer tracer(gpu(), {.make = [](Device &g, const PipelineSetup &from) {
                                    EXPECT_TRUE(named(g, from) == VK_NULL_HANDLE);
                                    return MadePipeline{RayPipeline(g, from), {}};
                                }});
}

// The key that stands in for that of its code is the same each time, and no other pipeline's.
TEST_F(PipelineIdentifiers, KeysWithTheBit)
{
    const PipelineTracer tracer(gpu(), {.make = [](Device &g, const PipelineSetup &from) {
                                    Binaries binaries(g);
                                    const auto keyOf = [&](const PipelineSetup &setup) {
                                        return withNames(g, setup,
                                                         [&](const auto &info) { return binaries.key(&info); });
                                    };
                                    PipelineSetup deeper = from, fewer = from, other = from;
                                    ++deeper.recursion;
                                    fewer.groups.pop_back();
                                    other.stages[1].words = other.stages[2].words;
                                    EXPECT_EQ(keyOf(from), keyOf(from));
                                    EXPECT_NE(keyOf(from), keyOf(deeper));
                                    EXPECT_NE(keyOf(from), keyOf(fewer));
                                    EXPECT_NE(keyOf(from), keyOf(other));
                                    return MadePipeline{RayPipeline(g, from), {}};
                                }});
}

TEST_F(PipelineIdentifiers, OfADeviceWithoutMicromaps)
{
    Options options = cachingDriver();
    options.micromaps = false;
    Gpu plain(options);
    const PipelineScene scene(plain, {.micromaps = false});
    PipelineTracer tracer(plain, {.flags = 0, .make = [](Device &g, const PipelineSetup &from) {
                                      const VkPipeline pipeline = named(g, from);
                                      EXPECT_TRUE(pipeline != VK_NULL_HANDLE);
                                      return MadePipeline{RayPipeline(g, pipeline), {}};
                                  }});
    for (const uint32_t flags : opacityRayFlags(false))
        scene.expect(tracer, flags);
}

} // namespace
