// SPDX-License-Identifier: Apache-2.0
// Every shader of the layer, built in or rewritten, through compilers for GPUs: Mesa's RADV, ANV and turnip, for
// several generations of AMD, Intel and Qualcomm GPUs. No such GPU is needed. A device on which nothing runs is enough
// to see that modules are rewritten and compiled; the tests on lavapipe check what shaders do.
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include <unistd.h>

#include "compiled.h"
#include "shaders/compiler_relay_any_hit.h"
#include "shaders/compiler_relay_callable.h"
#include "shaders/compiler_relay_closest_hit.h"
#include "shaders/compiler_relay_miss.h"
#include "shaders/compiler_relay_queries_any_hit.h"
#include "shaders/compiler_relay_queries_closest_hit.h"
#include "shaders/compiler_relay_queries_miss.h"
#include "shaders/compiler_relay_queries_raygen.h"
#include "shaders/compiler_relay_raygen.h"
#include "shaders/compiler_tracer_any_hit.h"
#include "shaders/compiler_tracer_closest_hit.h"
#include "shaders/compiler_tracer_intersection.h"
#include "shaders/compiler_tracer_miss.h"
#include "shaders/compiler_tracer_raygen.h"
#include "shaders/compiler_vertex.h"

#if defined(__SANITIZE_ADDRESS__)
// Drivers leave memory behind, and are unloaded before the sanitizer names whose it is. Only a function that is visible
// replaces the sanitizer's.
extern "C" __attribute__((visibility("default"))) const char *__asan_default_options();
extern "C" const char *__asan_default_options()
{
    return "detect_leaks=0";
}
#endif

namespace vellum::test
{
namespace
{

namespace fs = std::filesystem;

struct Device {
    const char *name; // the name for useGpu
    bool emulated;    // it has nothing to trace rays with
    vt::Api api = vt::Api::Ext;
};

std::ostream &operator<<(std::ostream &out, const Device &device)
{
    return out << device.name;
}

using Words = std::span<const uint32_t>;

class Compiler : public testing::TestWithParam<Device>
{
protected:
    void SetUp() override
    {
        // Read by RADV when an instance is made.
        if (GetParam().emulated)
            setenv("RADV_PERFTEST", "emulate_rt", 1);
        else
            unsetenv("RADV_PERFTEST");
        vt::Options options{.validation = false, .spy = false};
        if (const std::string whyNot = useGpu(GetParam().name, options); !whyNot.empty())
            GTEST_SKIP() << whyNot;
        options.api = GetParam().api;
        options.newer = true; // VkPipelineCreateFlags2CreateInfo
        // Tells failures of the driver from those of the layer.
        if (std::getenv("VELLUM_TEST_WITHOUT_LAYER") != nullptr)
            options.vellum = options.micromaps = false;
        gpu_ = std::make_unique<vt::Gpu>(options);
        ASSERT_TRUE(gpu_->has(VK_KHR_RAY_QUERY_EXTENSION_NAME));
        // Turnip has ray queries only.
        ASSERT_EQ(hasPipelines(), driverOf(GetParam().name) != Driver::Turnip);
    }
    void TearDown() override
    {
        if (!gpu_)
            return;
        for (const vt::Message &m : gpu_->takeUnexpectedMessages())
            ADD_FAILURE() << m.id << ": " << m.text;
    }

    vt::Gpu &gpu() { return *gpu_; }
    [[nodiscard]] bool hasPipelines() const { return gpu_->has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME); }

    // At least one shader has code, and the compiler reports statistics about it.
    static void expectCode(const Compiled &pipeline)
    {
        uint64_t instructions = 0;
        for (const Executable &e : pipeline.executables()) {
            for (const char *name : {"Instructions", "Instruction Count"}) { // RADV's; ANV's and turnip's
                const auto found = e.statistics.find(name);
                instructions += found == e.statistics.end() ? 0 : found->second;
            }
        }
        EXPECT_GT(instructions, 0u);
    }

    // An entry point in the smallest pipeline that has all that it needs. Any-hit and intersection shaders are compiled
    // with the shader that traces the rays, so that is there, too.
    void compile(const ModuleFile &module)
    {
        for (const EntryPoint &entry : factsOf(module.words).entryPoints) {
            SCOPED_TRACE(module.name + ", " + entry.name);
            std::fprintf(stderr, "%s, %s\n", module.name.c_str(), entry.name.c_str()); // for the compiler that crashes
            try {
                if (entry.stage == VK_SHADER_STAGE_COMPUTE_BIT)
                    expectCode(Compiled::compute(gpu(), module.words, entry.name));
                else if (entry.stage == VK_SHADER_STAGE_FRAGMENT_BIT)
                    expectCode(Compiled::graphics(gpu(), compiler_vertex, module.words));
                else if (hasPipelines())
                    expectCode(compileStage(module, entry));
            } catch (const std::exception &e) {
                ADD_FAILURE() << e.what();
            }
        }
    }

    void compileAll(const fs::path &folder)
    {
        for (const ModuleFile &module : modulesIn(folder))
            compile(module);
    }

private:
    Compiled compileStage(const ModuleFile &module, const EntryPoint &entry)
    {
        vt::PipelineSetup setup;
        setup.flags = gpu().options().micromaps ? vt::kMicromapBit : 0;
        setup.stages = {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, compiler_tracer_raygen}};
        setup.groups = {{.general = 0}};
        const vt::PipelineStage stage{entry.stage, module.words, entry.name.c_str()};
        switch (entry.stage) {
        case VK_SHADER_STAGE_RAYGEN_BIT_KHR:
            setup.stages[0] = stage;
            setup.stages.push_back({VK_SHADER_STAGE_ANY_HIT_BIT_KHR, compiler_tracer_any_hit});
            setup.groups.push_back({.anyHit = 1});
            break;
        case VK_SHADER_STAGE_ANY_HIT_BIT_KHR:
            setup.stages.push_back(stage);
            setup.groups.push_back({.anyHit = 1});
            break;
        case VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR:
            setup.stages.push_back(stage);
            setup.groups.push_back({.closestHit = 1});
            break;
        case VK_SHADER_STAGE_INTERSECTION_BIT_KHR:
            setup.stages.push_back(stage);
            setup.stages.push_back({VK_SHADER_STAGE_ANY_HIT_BIT_KHR, compiler_tracer_any_hit});
            setup.groups.push_back({.anyHit = 2, .intersection = 1});
            break;
        default: setup.stages.push_back(stage); setup.groups.push_back({.general = 1});
        }
        return Compiled::rays(gpu(), setup);
    }

    std::unique_ptr<vt::Gpu> gpu_;
};

// Modules that are the same for both extensions.
class CompilerModules : public Compiler
{
};

// Large shaders, which take ANV long.
class CompilerBaker : public Compiler
{
};

vt::PipelineSetup tracer()
{
    vt::PipelineSetup setup;
    setup.stages = {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, compiler_tracer_raygen},
                    {VK_SHADER_STAGE_MISS_BIT_KHR, compiler_tracer_miss},
                    {VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, compiler_tracer_closest_hit},
                    {VK_SHADER_STAGE_ANY_HIT_BIT_KHR, compiler_tracer_any_hit},
                    {VK_SHADER_STAGE_INTERSECTION_BIT_KHR, compiler_tracer_intersection}};
    // Groups of triangles with and without an application's any-hit shader, and of boxes.
    setup.groups = {{.general = 0},
                    {.general = 1},
                    {.closestHit = 2, .anyHit = 3},
                    {.closestHit = 2},
                    {.closestHit = 2, .anyHit = 3, .intersection = 4}};
    setup.flags = vt::kMicromapBit;
    return setup;
}

vt::PipelineSetup relay(bool queries)
{
    vt::PipelineSetup setup;
    setup.stages = {{VK_SHADER_STAGE_RAYGEN_BIT_KHR, compiler_relay_raygen},
                    {VK_SHADER_STAGE_MISS_BIT_KHR, compiler_relay_miss},
                    {VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, compiler_relay_closest_hit},
                    {VK_SHADER_STAGE_ANY_HIT_BIT_KHR, compiler_relay_any_hit},
                    {VK_SHADER_STAGE_CALLABLE_BIT_KHR, compiler_relay_callable}};
    if (queries) {
        setup.stages[0].words = compiler_relay_queries_raygen;
        setup.stages[1].words = compiler_relay_queries_miss;
        setup.stages[2].words = compiler_relay_queries_closest_hit;
        setup.stages[3].words = compiler_relay_queries_any_hit;
    }
    setup.groups = {{.general = 0}, {.general = 1}, {.closestHit = 2, .anyHit = 3}, {.general = 4}};
    setup.flags = vt::kMicromapBit;
    return setup;
}

Layout layoutOf(vt::Device &gpu, const vt::PipelineSetup &setup)
{
    std::vector<ModuleFacts> facts;
    for (const vt::PipelineStage &stage : setup.stages)
        facts.push_back(factsOf(stage.words));
    return {gpu, facts};
}

TEST_P(CompilerModules, ShadersOfTheLayer)
{
    compileAll(fs::path(VELLUM_TEST_BUILD) / "src/layer/shaders");
}

TEST_P(CompilerModules, TheLookup)
{
    compileAll(fs::path(VELLUM_TEST_BUILD) / "src/spirv/shaders");
}

TEST_P(CompilerBaker, ShadersOfTheBaker)
{
    compileAll(fs::path(VELLUM_TEST_BUILD) / "src/gpubake/shaders");
}

TEST_P(Compiler, ShadersOfTheRenderer)
{
    for (const ModuleFile &module : modulesIn(fs::path(VELLUM_TEST_BUILD) / "src/render/shaders")) {
        // Declares what only a device with VK_KHR_opacity_micromap knows.
        if (module.name.ends_with("_micromaps") && GetParam().api != vt::Api::Khr)
            continue;
        compile(module);
    }
}

TEST_P(CompilerModules, ShadersOfTheRewritersTests)
{
    for (const ModuleFile &module : modulesIn(fs::path(VELLUM_TEST_BUILD) / "tests/spirv")) {
        if (module.name.starts_with("short_attributes")) // the layer rejects it, as its test shows
            continue;
        // RADV crashes on its arrays of arrays, without the layer as well.
        if (module.name.starts_with("kept_flags") && driverOf(GetParam().name) == Driver::Radv)
            continue;
        compile(module);
    }
}

// Modules that the tests of the rewriter assemble; they write them to a folder if a variable names one.
TEST_P(CompilerModules, ModulesOfTheRewritersTests)
{
    const fs::path folder = fs::temp_directory_path() / ("vellum-modules-" + std::to_string(getpid()));
    fs::create_directory(folder);
    const std::string command = "VELLUM_TEST_MODULES='" + folder.string() + "' " + VELLUM_SPIRV_TEST +
                                " --gtest_brief=1 --gtest_filter=-*Glsl* >'" + (folder / "log").string() + "'";
    EXPECT_EQ(std::system(command.c_str()), 0);
    const auto modules = modulesIn(folder);
    fs::remove_all(folder);
    EXPECT_GT(modules.size(), 30u);
    for (const ModuleFile &module : modules) {
        // RADV crashes on a ray query in a structure, without the layer as well, where the query is not optimized out.
        if (module.name.starts_with("Queries.StructsAndArrays"))
            continue;
        compile(module);
    }
}

TEST_P(Compiler, FlagOfThePipeline)
{
    expectCode(Compiled::rays(gpu(), tracer()));
}

TEST_P(Compiler, FlagInTheChain)
{
    vt::PipelineSetup setup = tracer();
    setup.flags2 = true;
    ASSERT_TRUE(gpu().has("VK_KHR_maintenance5"));
    expectCode(Compiled::rays(gpu(), setup));
}

TEST_P(Compiler, ModulesInTheChain)
{
    vt::PipelineSetup setup = tracer();
    for (vt::PipelineStage &stage : setup.stages)
        stage.inlineModule = true;
    expectCode(Compiled::rays(gpu(), setup));
}

TEST_P(Compiler, Libraries)
{
    for (const bool flags2 : {false, true}) {
        vt::PipelineSetup all = tracer();
        const Layout layout = layoutOf(gpu(), all);
        all.layout = layout.handle();
        all.flags2 = flags2;
        // General shaders in one library, hit groups in the other.
        vt::PipelineSetup general = all, hits = all, linked;
        general.stages.resize(2);
        general.groups.resize(2);
        hits.stages.erase(hits.stages.begin(), hits.stages.begin() + 2);
        hits.groups = {
            {.closestHit = 0, .anyHit = 1}, {.closestHit = 0}, {.closestHit = 0, .anyHit = 1, .intersection = 2}};
        general.flags |= VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
        hits.flags |= VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
        const Compiled first = Compiled::rays(gpu(), general), second = Compiled::rays(gpu(), hits);
        linked.layout = layout.handle();
        linked.flags = all.flags;
        linked.flags2 = flags2;
        linked.libraries = {first.handle(), second.handle()};
        expectCode(Compiled::rays(gpu(), linked));
    }
}

TEST_P(Compiler, RecursionAndCallables)
{
    for (const bool queries : {false, true}) {
        vt::PipelineSetup setup = relay(queries);
        setup.recursion = std::min(gpu().pipelineProperties().maxRayRecursionDepth, 4u);
        expectCode(Compiled::rays(gpu(), setup));
        setup.dynamicStackSize = true;
        expectCode(Compiled::rays(gpu(), setup));
    }
}

TEST_P(Compiler, NoMicromaps)
{
    vt::PipelineSetup setup = tracer();
    setup.flags = 0;
    expectCode(Compiled::rays(gpu(), setup));
}

std::string apiOf(const testing::TestParamInfo<Device> &info)
{
    return info.param.api == vt::Api::Khr ? "Khr" : "Ext";
}

#define PIPELINES(prefix, name, emulated)                                                                              \
    INSTANTIATE_TEST_SUITE_P(                                                                                          \
        prefix, Compiler, testing::Values(Device{name, emulated, vt::Api::Ext}, Device{name, emulated, vt::Api::Khr}), \
        apiOf)
#define MODULES(prefix, name, emulated)                                                                                \
    PIPELINES(prefix, name, emulated);                                                                                 \
    INSTANTIATE_TEST_SUITE_P(prefix, CompilerModules, testing::Values(Device{name, emulated, vt::Api::Ext}), apiOf)
#define EVERYTHING(prefix, name, emulated)                                                                             \
    MODULES(prefix, name, emulated);                                                                                   \
    INSTANTIATE_TEST_SUITE_P(prefix, CompilerBaker, testing::Values(Device{name, emulated, vt::Api::Ext}), apiOf)
EVERYTHING(Vega10, "vega10", true);
EVERYTHING(Navi21, "navi21", false);
EVERYTHING(Navi31, "navi31", false);
EVERYTHING(Gfx1201, "gfx1201", false);
EVERYTHING(Dg2, "dg2", false);
MODULES(Bmg, "bmg", false);
PIPELINES(Mtl, "mtl", false); // of the generation of dg2
PIPELINES(Lnl, "lnl", false); // of that of bmg
INSTANTIATE_TEST_SUITE_P(A740, CompilerModules, testing::Values(Device{"a740", false}), apiOf);
INSTANTIATE_TEST_SUITE_P(A740, CompilerBaker, testing::Values(Device{"a740", false}), apiOf);

} // namespace
} // namespace vellum::test

int main(int argc, char **argv)
{
    testing::InitGoogleTest(&argc, argv);
    return RUN_ALL_TESTS();
}
