// SPDX-License-Identifier: Apache-2.0
// Ray tracing pipelines that break the rules: a message that names the rule, no crash, and a device that goes on
// working.
#include "harness/program/labels.h"
#include "harness/severity.h"
#include "pipelines/pipeline_scene.h"

namespace
{

const vt::Labels kPipelineBadInputLabels{{"PipelineBadInput.*", "strict"}, {"PipelineWithoutFeature.*", "strict"}};

using namespace vt;

class PipelineBadInput : public PipelineTest
{
protected:
    // Without the validation layer: it does not know these rules, and reports other ones for the consequences.
    explicit PipelineBadInput(const Options &options = {.validation = false}) : PipelineTest(options) {}

    // Tries to make it; the pipeline goes at once.
    VkResult tryToMake(const PipelineSetup &setup)
    {
        const PipelineInfo info(gpu(), setup);
        VkPipeline pipeline = VK_NULL_HANDLE;
        const VkResult result = gpu().vk().CreateRayTracingPipelinesKHR(gpu().device(), VK_NULL_HANDLE, VK_NULL_HANDLE,
                                                                        1, &info.get(), nullptr, &pipeline);
        EXPECT_EQ(result == VK_SUCCESS, pipeline != VK_NULL_HANDLE);
        made_ = result == VK_SUCCESS;
        vkDestroyPipeline(gpu().device(), pipeline, nullptr);
        return result;
    }
    // Changes the tracer's setup before the pipeline is made, which may fail.
    void tryChanged(const std::function<void(PipelineSetup &)> &change)
    {
        PipelineTracer tracer(gpu(), {.flags = allowed(), .make = [&](Device &g, const PipelineSetup &from) {
                                          PipelineSetup setup = from;
                                          change(setup);
                                          tryToMake(setup);
                                          return MadePipeline{RayPipeline(g, from), {}};
                                      }});
        takeAll();
        // The device still works.
        const PipelineScene scene(gpu(), {.micromaps = allowed() != 0});
        for (const uint32_t flags : {0u, kRayOpaque})
            scene.expect(tracer, flags);
    }
    [[nodiscard]] VkPipelineCreateFlags allowed() { return gpu().options().micromapFeature ? kMicromapBit : 0; }
    void takeAll()
    {
        for (Message &m : gpu().takeUnexpectedMessages())
            messages_.push_back(std::move(m));
    }
    void expectFinding(const char *rule)
    {
        takeAll();
        bool isReported = false;
        for (const Message &m : messages_) {
            EXPECT_TRUE(m.fromVellum()) << "from elsewhere: " << m.id << ": " << m.text;
            if (m.fromVellum() && m.severity == expectedSeverity(m))
                isReported = isReported || m.id.find(rule) != std::string::npos;
        }
        EXPECT_TRUE(isReported) << "no message of " << rule;
        messages_.clear();
    }

    std::vector<Message> messages_;
    bool made_ = false; // the changed pipeline
};

class PipelineWithoutFeature : public PipelineBadInput
{
protected:
    PipelineWithoutFeature() : PipelineBadInput({.validation = false, .newer = true, .micromapFeature = false}) {}
};

TEST_F(PipelineWithoutFeature, TheBit)
{
    tryChanged([](PipelineSetup &setup) { setup.flags |= kMicromapBit; });
    EXPECT_EQ(made_, !strictTests());
    expectFinding("VUID-VkRayTracingPipelineCreateInfoKHR-flags-11597");
}

// If the extension is enabled without its feature, pipelines use micromaps nevertheless.
TEST_F(PipelineWithoutFeature, UsesMicromaps)
{
    if (strictTests())
        GTEST_SKIP() << "there is no such pipeline";
    PipelineTracer tracer(gpu(), {.flags = kMicromapBit});
    const PipelineScene scene(gpu(), {.micromaps = true});
    takeAll();
    for (const uint32_t flags : {0u, kRayOpaque})
        scene.expect(tracer, flags);
    expectFinding("VUID-VkRayTracingPipelineCreateInfoKHR-flags-11597");
}

TEST_F(PipelineWithoutFeature, TheBitInTheChain)
{
    if (!gpu().has("VK_KHR_maintenance5"))
        GTEST_SKIP() << "no VkPipelineCreateFlags2CreateInfo";
    tryChanged([](PipelineSetup &setup) {
        setup.flags |= kMicromapBit;
        setup.flags2 = true;
    });
    expectFinding("VUID-VkRayTracingPipelineCreateInfoKHR-flags-11597");
}

TEST_F(PipelineBadInput, LibraryWithoutTheBit)
{
    std::vector<RayPipeline> libraries;
    tryChanged([&](PipelineSetup &setup) {
        PipelineSetup library = setup;
        library.flags = VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
        library.groups.erase(library.groups.begin());
        libraries.emplace_back(gpu(), library);
        setup.groups.resize(1);
        setup.libraries = {libraries.back().handle()};
    });
    // The pipeline is then without micromaps.
    EXPECT_EQ(made_, !strictTests());
    expectFinding("VUID-VkRayTracingPipelineCreateInfoKHR-pLibraries-11598");
}

TEST_F(PipelineBadInput, OneLibraryOfTwoWithoutTheBit)
{
    std::vector<RayPipeline> libraries;
    tryChanged([&](PipelineSetup &setup) {
        PipelineSetup library = setup;
        library.flags |= VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
        for (const size_t group : {1u, 2u}) {
            library.groups = {setup.groups[group]};
            libraries.emplace_back(gpu(), library);
            library.flags = VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
        }
        setup.groups.resize(1);
        setup.libraries = {libraries[0].handle(), libraries[1].handle()};
    });
    EXPECT_FALSE(made_);
    expectFinding("VUID-VkRayTracingPipelineCreateInfoKHR-pLibraries-11598");
}

// The specification allows it. What is rejected says so, in either order.
TEST_F(PipelineBadInput, LibrariesWithAndWithoutTheBitInAPipelineWithoutIt)
{
    for (const bool withFirst : {false, true}) {
        std::vector<RayPipeline> libraries;
        tryChanged([&](PipelineSetup &setup) {
            PipelineSetup library = setup;
            for (const bool with : {withFirst, !withFirst}) {
                library.flags = VK_PIPELINE_CREATE_LIBRARY_BIT_KHR | (with ? kMicromapBit : 0);
                library.groups = {setup.groups[with ? 1 : 2]};
                libraries.emplace_back(gpu(), library);
            }
            setup.groups.resize(1);
            setup.flags = 0;
            setup.libraries = {libraries[0].handle(), libraries[1].handle()};
        });
        expectFinding("VELLUM-not-available");
    }
}

// The stage index exceeds the stages of the pipeline and its libraries.
TEST_F(PipelineBadInput, MissingStage)
{
    for (const auto shader :
         {&PipelineGroup::general, &PipelineGroup::closestHit, &PipelineGroup::anyHit, &PipelineGroup::intersection}) {
        for (const uint32_t index : {9u, 1000u, kUnused - 1}) {
            std::vector<RayPipeline> libraries;
            tryChanged([&](PipelineSetup &setup) {
                PipelineSetup library = setup;
                library.flags |= VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
                library.stages.resize(3);
                library.groups = {{}};
                libraries.emplace_back(gpu(), library);
                setup.libraries = {libraries[0].handle()};
                PipelineGroup group;
                group.*shader = index;
                setup.groups.push_back(group);
            });
            EXPECT_FALSE(made_);
            expectFinding("VELLUM-pipeline-group");
        }
    }
}

// Pipelines that can be made are made also where others in the call cannot.
TEST_F(PipelineBadInput, OneOfThree)
{
    for (const VkPipelineCreateFlags early : {0u, 0u + VK_PIPELINE_CREATE_EARLY_RETURN_ON_FAILURE_BIT}) {
        tryChanged([&](PipelineSetup &setup) {
            std::array<std::unique_ptr<PipelineInfo>, 3> infos;
            std::array<VkRayTracingPipelineCreateInfoKHR, 3> list{};
            for (uint32_t i = 0; i < 3; ++i) {
                PipelineSetup one = setup;
                one.stages[0].entry = i == 1 ? "nowhere" : "main";
                one.flags |= early;
                infos[i] = std::make_unique<PipelineInfo>(gpu(), one);
                list[i] = infos[i]->get();
            }
            std::array<VkPipeline, 3> pipelines{};
            EXPECT_LT(gpu().vk().CreateRayTracingPipelinesKHR(gpu().device(), VK_NULL_HANDLE, VK_NULL_HANDLE, 3,
                                                              list.data(), nullptr, pipelines.data()),
                      VK_SUCCESS);
            EXPECT_TRUE(pipelines[0]);
            EXPECT_FALSE(pipelines[1]);
            EXPECT_EQ(pipelines[2] != VK_NULL_HANDLE, early == 0);
            for (const VkPipeline pipeline : pipelines)
                vkDestroyPipeline(gpu().device(), pipeline, nullptr);
        });
        EXPECT_FALSE(messages_.empty());
        messages_.clear();
    }
}

// No module has this entry point: a message is expected, and the layer must continue.
TEST_F(PipelineBadInput, MissingEntryPoint)
{
    for (const size_t stage : {0u, 2u, 3u, 4u}) {
        tryChanged([stage](PipelineSetup &setup) { setup.stages[stage].entry = "nowhere"; });
        EXPECT_FALSE(messages_.empty());
        messages_.clear();
    }
}

} // namespace
