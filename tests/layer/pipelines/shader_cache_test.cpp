// SPDX-License-Identifier: Apache-2.0
// A driver's caches find in one run what was compiled in another: rewritten shaders are the same, although they contain
// the addresses of the layer's tables. Each run is a process of its own, with randomized addresses. Mesa reports at the
// end of a process what its cache found.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/personality.h>
#include <sys/wait.h>
#include <unistd.h>

#include "gpu/pipeline_tracer.h"
#include "gpu/tracer.h"
#include "harness/harness.h"

#include "harness/program/labels.h"
#include "shaders/pipeline_constant_000.h"
#include "shaders/pipeline_constant_040.h"
#include "shaders/pipeline_constant_400.h"
#include "shaders/tracer_constant_000.h"
#include "shaders/tracer_constant_001.h"
#include "shaders/tracer_constant_040.h"
#include "shaders/tracer_constant_080.h"
#include "shaders/tracer_constant_400.h"
#include "shaders/tracer_specialized.h"

using namespace vt;

namespace
{

const vt::Labels kShaderCacheLabels{{"ShaderCache.*", "slow one_api"}};

namespace fs = std::filesystem;

constexpr const char *kQuirks = "VELLUM_TEST_QUIRKS";
constexpr const char *kReplay = "capable,replay";
constexpr const char *kRewriteOnly = "VELLUM_TEST_REWRITE_ONLY";     // nothing is compiled
constexpr const char *kPipelineCache = "VELLUM_TEST_PIPELINE_CACHE"; // the file for its data
constexpr const char *kTaken = "VELLUM_TEST_TAKEN_ADDRESS";

Options ofRuns()
{
    Options options;
    options.validation = false;
    options.spy = std::getenv(kPipelineCache) != nullptr;
    options.addressReplay = false;
    return options;
}

std::string contentOf(const fs::path &path)
{
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

// Makes pipelines of all kinds with a cache as an application does: its data comes from a file and goes there. Prints
// how many hits there were.
void makeCachedPipelines(Gpu &gpu, const fs::path &path)
{
    const std::string data = contentOf(path);
    auto cacheInfo = vkInit<VkPipelineCacheCreateInfo>({.initialDataSize = data.size(), .pInitialData = data.data()});
    VkPipelineCache cache = VK_NULL_HANDLE;
    VT_CHECK(vkCreatePipelineCache(gpu.device(), &cacheInfo, nullptr, &cache));
    unsigned hits = 0, misses = 0;
    std::vector<VkPipeline> made;
    const auto create = [&](auto info, auto function) {
        VkPipelineCreationFeedback feedback{};
        std::vector<VkPipelineCreationFeedback> stages(16);
        auto feedbackInfo =
            vkInit<VkPipelineCreationFeedbackCreateInfo>({.pNext = info.pNext, .pPipelineCreationFeedback = &feedback});
        info.pNext = &feedbackInfo;
        VT_CHECK(function(info, &made.emplace_back()));
        ((feedback.flags & VK_PIPELINE_CREATION_FEEDBACK_APPLICATION_PIPELINE_CACHE_HIT_BIT) != 0 ? hits : misses)++;
    };
    const Tracer tracer(gpu);
    const uint32_t flagValues[] = {0, kRayOpaque, kRayCullOpaque, kRayForceTwoState};
    const VkSpecializationMapEntry entry{0, 0, sizeof(uint32_t)};
    for (const std::span<const uint32_t> words :
         {std::span<const uint32_t>(tracer_constant_000), std::span<const uint32_t>(tracer_constant_400),
          std::span<const uint32_t>(tracer_specialized)}) {
        const VkShaderModule module = gpu.shader(words);
        for (const uint32_t &flags : flagValues) {
            const VkSpecializationInfo specialization{1, &entry, sizeof flags, &flags};
            auto info = vkInit<VkComputePipelineCreateInfo>(
                {.stage = vkInit<VkPipelineShaderStageCreateInfo>({.stage = VK_SHADER_STAGE_COMPUTE_BIT,
                                                                   .module = module,
                                                                   .pName = "main",
                                                                   .pSpecializationInfo = &specialization}),
                 .layout = tracer.layout()});
            create(info, [&](const auto &i, VkPipeline *pipeline) {
                return vkCreateComputePipelines(gpu.device(), cache, 1, &i, nullptr, pipeline);
            });
        }
        vkDestroyShaderModule(gpu.device(), module, nullptr);
    }
    for (const std::span<const uint32_t> raygen :
         {std::span<const uint32_t>(pipeline_constant_000), std::span<const uint32_t>(pipeline_constant_040),
          std::span<const uint32_t>(pipeline_constant_400)}) {
        for (const VkPipelineCreateFlags flags : {VkPipelineCreateFlags{0}, kMicromapBit}) {
            PipelineTracerSetup setup{.raygen = raygen};
            setup.flags = flags;
            setup.make = [&](Device &, const PipelineSetup &from) {
                for (const bool inlined : {false, true}) {
                    PipelineSetup one = from;
                    for (PipelineStage &stage : one.stages)
                        stage.inlineModule = inlined;
                    const PipelineInfo info(gpu, one);
                    create(info.get(), [&](const auto &i, VkPipeline *pipeline) {
                        return gpu.vk().CreateRayTracingPipelinesKHR(gpu.device(), VK_NULL_HANDLE, cache, 1, &i,
                                                                     nullptr, pipeline);
                    });
                }
                return MadePipeline{RayPipeline(gpu, from), {}};
            };
            const PipelineTracer pipeline(gpu, setup);
        }
    }
    std::printf("pipeline cache:  hits = %u, misses = %u\n", hits, misses);
    size_t size = 0;
    VT_CHECK(vkGetPipelineCacheData(gpu.device(), cache, &size, nullptr));
    std::string content(size, 0);
    VT_CHECK(vkGetPipelineCacheData(gpu.device(), cache, &size, content.data()));
    std::ofstream(path, std::ios::binary) << content;
    for (const VkPipeline pipeline : made)
        vkDestroyPipeline(gpu.device(), pipeline, nullptr);
    vkDestroyPipelineCache(gpu.device(), cache, nullptr);
}

// Run by the tests below, in processes of its own. Two devices at a time have two addresses.
TEST(ShaderCacheRun, DISABLED_Run)
{
    if (const char *address = std::getenv(kTaken)) {
        void *wanted = reinterpret_cast<void *>(std::strtoull(address, nullptr, 16));
        ASSERT_EQ(mmap(wanted, 65536, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED_NOREPLACE, -1, 0), wanted);
    }
    Gpu gpu(ofRuns());
    if (const char *path = std::getenv(kPipelineCache))
        return makeCachedPipelines(gpu, path);
    Gpu second(ofRuns());
    const Micromap micromap(gpu, [] {
        MicromapInput input;
        input.add(1, kFourState, std::vector<uint8_t>{0, 1, 2, 3});
        return input;
    }());
    const_cast<Micromap &>(micromap).build();
    Geometry geometry{.vertices = triangleRow(1)};
    geometry.micromap = Attachment{.micromap = &micromap};
    const Blas blas(gpu, {geometry});
    const Tlas scene(gpu, {instance(blas, {}, 7)});
    const std::vector<Ray> rays{{.origin = {0.1f, 0.1f, 1}}};
    const std::span<const uint32_t> modules[] = {tracer_constant_000, tracer_constant_001, tracer_constant_040,
                                                 tracer_constant_080, tracer_constant_400};
    const bool compile = std::getenv(kRewriteOnly) == nullptr;
    for (const auto words : modules) {
        Tracer tracer(gpu, words);
        if (compile)
            tracer.trace(scene, rays);
    }
    const Tracer other(second, tracer_constant_000);
    if (!compile)
        return;
    for (const uint32_t flags : {0u, kRayOpaque, kRayCullOpaque})
        Tracer(gpu, tracer_specialized, {.specializedFlags = flags}).trace(scene, rays);
    for (const std::span<const uint32_t> raygen :
         {std::span<const uint32_t>(pipeline_constant_000), std::span<const uint32_t>(pipeline_constant_040),
          std::span<const uint32_t>(pipeline_constant_400)})
        PipelineTracer(gpu, {.raygen = raygen}).trace(scene, rays);
}

struct Outcome {
    std::map<std::string, std::string> words; // of rewritten modules, by the names that the layer dumps them under
    unsigned hits = 0, misses = 0;            // of Mesa's cache
};

class ShaderCache : public testing::Test
{
protected:
    ShaderCache()
    {
        fs::create_directories(folder_);
        Options options = ofRuns();
        auto driver = vkInit<VkPhysicalDeviceDriverProperties>();
        auto properties = vkInit<VkPhysicalDeviceProperties2>({.pNext = &driver});
        vkGetPhysicalDeviceProperties2(Gpu(options).physical(), &properties);
        lavapipe_ = driver.driverID == VK_DRIVER_ID_MESA_LLVMPIPE;
    }
    void SetUp() override
    {
        if (!lavapipe_)
            GTEST_SKIP() << "only Mesa says what its cache found, and only on a CPU can replay be played";
    }
    ~ShaderCache() override
    {
        if (!HasFailure())
            fs::remove_all(folder_);
    }

    using Environment = std::map<std::string, std::string>;
    Outcome run(const Environment &more)
    {
        const fs::path own = folder_ / std::to_string(++runs_);
        fs::create_directories(own);
        Environment environment = more;
        environment.insert({{"VELLUM_DUMP_SHADERS", own},
                            {"MESA_SHADER_CACHE_DIR", folder_ / "mesa"},
                            {"MESA_SHADER_CACHE_SHOW_STATS", "1"},
                            {"XDG_CACHE_HOME", folder_ / "cache"},
                            // Simulates replayed addresses; the addresses are random here.
                            {"VELLUM_TEST_ADDRESSES_REPEAT", "1"}});
        const std::string log = own / "log";
        const pid_t child = fork();
        if (child == 0) {
            const int now = personality(0xffffffff);
            personality(static_cast<unsigned long>(now) & ~static_cast<unsigned long>(ADDR_NO_RANDOMIZE));
            for (const auto &[name, value] : environment)
                setenv(name.c_str(), value.c_str(), 1);
            if (std::freopen(log.c_str(), "w", stdout) == nullptr || dup2(fileno(stdout), 2) < 0)
                _exit(1);
            execl("/proc/self/exe", "layer_tests", "--gtest_filter=ShaderCacheRun.DISABLED_Run",
                  "--gtest_also_run_disabled_tests", nullptr);
            _exit(1);
        }
        int status = 1;
        waitpid(child, &status, 0);
        const std::string text = contentOf(log);
        EXPECT_EQ(status, 0) << text;
        EXPECT_NE(text.find("[  PASSED  ] 1 test."), std::string::npos) << text;
        Outcome result;
        for (size_t at = text.find("hits = "); at != std::string::npos; at = text.find("hits = ", at + 1)) {
            unsigned hits = 0, misses = 0;
            if (std::sscanf(text.c_str() + at, "hits = %u, misses = %u", &hits, &misses) == 2) {
                result.hits += hits;
                result.misses += misses;
            }
        }
        for (const auto &entry : fs::directory_iterator(own)) {
            if (entry.path().string().ends_with(".after.spv"))
                result.words[entry.path().filename()] = contentOf(entry.path());
        }
        EXPECT_GT(result.words.size(), 5u);
        return result;
    }

    static void expectHits(const Outcome &run)
    {
        RecordProperty("hits", static_cast<int>(run.hits));
        RecordProperty("misses", static_cast<int>(run.misses));
        EXPECT_GT(run.hits, 10u);
        EXPECT_GE(run.hits, 99 * run.misses) << run.hits << " hits, " << run.misses << " misses";
    }

    [[nodiscard]] fs::path inFolder(const std::string &name) const { return folder_ / name; }
    [[nodiscard]] fs::path cacheFolder() const { return folder_ / "cache" / "vellum"; }
    [[nodiscard]] std::vector<fs::path> addressFiles() const
    {
        std::vector<fs::path> files;
        for (const auto &entry : fs::directory_iterator(cacheFolder()))
            files.push_back(entry.path());
        std::sort(files.begin(), files.end());
        return files;
    }

private:
    fs::path folder_ = fs::temp_directory_path() / ("vellum-shader-cache-" + std::to_string(getpid()));
    bool lavapipe_ = false;
    unsigned runs_ = 0;
};

TEST_F(ShaderCache, NextRunCompilesNothing)
{
    const Outcome first = run({});
    EXPECT_GT(first.misses, 10u);
    const Outcome second = run({});
    EXPECT_EQ(second.words, first.words);
    expectHits(second);
    // Addresses that are the same anyway need no file.
    EXPECT_FALSE(fs::exists(cacheFolder()));
}

// As on a GPU: the driver chooses the addresses, and replays them.
TEST_F(ShaderCache, NextRunCompilesNothingWhereAddressesAreReplayed)
{
    const Outcome first = run({{kQuirks, kReplay}});
    EXPECT_GT(first.misses, 10u);
    const auto files = addressFiles();
    ASSERT_EQ(files.size(), 2u); // of two devices
    const Outcome second = run({{kQuirks, kReplay}});
    EXPECT_EQ(second.words, first.words);
    expectHits(second);
    EXPECT_EQ(addressFiles(), files);
}

// A pipeline cache of the application's, on a driver that has such (spy_cache.cpp).
TEST_F(ShaderCache, PipelineCacheOfTheRunBefore)
{
    for (const bool replay : {false, true}) {
        SCOPED_TRACE(replay);
        Environment environment{{"VELLUM_TEST_SPY_CACHE", "1"},
                                {kPipelineCache, inFolder(replay ? "pipelines_replayed" : "pipelines")},
                                {"MESA_SHADER_CACHE_SHOW_STATS", "0"}};
        if (replay)
            environment[kQuirks] = kReplay;
        const Outcome first = run(environment);
        // Inline modules and others are the same to a cache.
        EXPECT_EQ(first.misses, 18u);
        const Outcome second = run(environment);
        EXPECT_EQ(second.words, first.words);
        expectHits(second);
        EXPECT_EQ(second.misses, 0u);
    }
}

// Without the file, such a driver gives the tables other addresses, so the shaders differ.
TEST_F(ShaderCache, NoFolderNoAddresses)
{
    const Environment none{{kQuirks, kReplay}, {"VELLUM_CACHE_FOLDER", ""}};
    const Outcome first = run(none);
    const Outcome second = run(none);
    EXPECT_NE(second.words, first.words);
    EXPECT_GT(second.misses, 10u);
}

// An address that another has is given up, and the next one kept.
TEST_F(ShaderCache, AddressThatIsTaken)
{
    const Outcome first = run({{kQuirks, kReplay}, {kRewriteOnly, "1"}});
    std::ifstream file(addressFiles().front());
    std::string buffer, memory;
    file >> buffer >> memory;
    const Outcome second = run({{kQuirks, kReplay}, {kRewriteOnly, "1"}, {kTaken, memory}});
    EXPECT_NE(second.words, first.words);
    const Outcome third = run({{kQuirks, kReplay}, {kRewriteOnly, "1"}});
    EXPECT_EQ(third.words, second.words);
}

TEST_F(ShaderCache, FilesThatAreDamaged)
{
    const Environment replay{{kQuirks, kReplay}, {kRewriteOnly, "1"}};
    const Outcome first = run(replay);
    const auto files = addressFiles();
    ASSERT_EQ(files.size(), 2u);
    std::string content = contentOf(files[0]);
    content[4] = content[4] == '1' ? '2' : '1';
    std::ofstream(files[0], std::ios::binary) << content;
    std::ofstream(files[1], std::ios::binary) << "no addresses";
    const Outcome second = run(replay);
    EXPECT_NE(second.words, first.words);
    const Outcome third = run(replay);
    EXPECT_EQ(third.words, second.words);
}

} // namespace
