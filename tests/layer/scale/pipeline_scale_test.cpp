// SPDX-License-Identifier: Apache-2.0
// Pipelines made on many threads, linked from hundreds of libraries, and made again and again.
#include <thread>

#include "pipelines/pipeline_scene.h"
#include "scale/scale.h"

#include "harness/program/labels.h"
#include "shaders/tracer_constant_000.h"
#include "shaders/tracer_constant_001.h"
#include "shaders/tracer_constant_040.h"
#include "shaders/tracer_constant_400.h"

namespace
{

const vt::Labels kPipelineScaleLabels{{"PipelineScale.*", "slow one_api"}};

using namespace vt;

class PipelineScale : public Scale
{
protected:
    void SetUp() override
    {
        if (!gpu().has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
            GTEST_SKIP() << "no ray tracing pipelines";
        scene_.emplace(gpu());
    }

    std::optional<PipelineScene> scene_;
};

// Modules, compute pipelines and ray tracing pipelines, on a device that has made none before.
TEST_F(PipelineScale, EightThreads)
{
    constexpr size_t kThreads = 8;
    const Patchwork patchwork(gpu());
    const Blas blas(gpu(), patchwork.geometries());
    const Tlas scene(gpu(), {instance(blas, {}, 77)});
    const std::span<const uint32_t> modules[] = {tracer_constant_000, tracer_constant_001, tracer_constant_040,
                                                 tracer_constant_400};
    std::array<std::vector<std::unique_ptr<Tracer>>, kThreads> tracers;
    std::array<std::vector<std::unique_ptr<PipelineTracer>>, kThreads> pipelines;
    std::vector<std::thread> threads;
    for (size_t t = 0; t < kThreads; ++t) {
        threads.emplace_back([&, t] {
            for (size_t i = 0; i < scaled(4); ++i) {
                tracers[t].push_back(std::make_unique<Tracer>(gpu(), modules[(t + i) % std::size(modules)]));
                if (i == t % 4)
                    pipelines[t].push_back(std::make_unique<PipelineTracer>(gpu()));
            }
        });
    }
    for (std::thread &thread : threads)
        thread.join();
    const auto rays = Patchwork::rays();
    std::array<std::vector<std::string>, std::size(modules)> expected;
    for (size_t t = 0; t < kThreads; ++t) {
        for (size_t i = 0; i < tracers[t].size(); ++i) {
            std::vector<std::string> now;
            for (const Result &r : tracers[t][i]->trace(scene, rays))
                now.push_back(std::to_string(r.committed) + "/" + std::to_string(r.candidateCount));
            auto &first = expected[(t + i) % std::size(modules)];
            if (first.empty())
                first = now;
            EXPECT_EQ(now, first) << "thread " << t << ", tracer " << i;
        }
        for (const auto &pipeline : pipelines[t])
            scene_->expect(*pipeline, 0);
    }
    EXPECT_NE(expected[0], expected[1]);
}

// Each library has one hit group; the pipeline has them all.
TEST_F(PipelineScale, HundredsOfLibraries)
{
    if (!gpu().has(VK_KHR_PIPELINE_LIBRARY_EXTENSION_NAME))
        GTEST_SKIP() << "no pipeline libraries";
    const size_t count = std::min<size_t>(scaled(100), 400); // lavapipe compiles them all into one
    std::vector<RayPipeline> libraries;
    PipelineTracerSetup setup;
    setup.make = [&](Device &gpu, const PipelineSetup &from) {
        PipelineSetup linking = from;
        linking.groups.resize(2); // ray generation and miss
        linking.stages.resize(2);
        timed("library", count, [&](size_t i) {
            PipelineSetup library = from;
            library.groups = {from.groups[2 + i % 2]};
            library.flags |= VK_PIPELINE_CREATE_LIBRARY_BIT_KHR;
            libraries.emplace_back(gpu, library);
            linking.libraries.push_back(libraries.back().handle());
        });
        std::vector<uint32_t> groups{0, 1};
        // Records use the last libraries of both kinds.
        groups.push_back(static_cast<uint32_t>(2 + count - 2));
        groups.push_back(static_cast<uint32_t>(2 + count - 1));
        // Noted for a fourth of them, and for all.
        std::vector<RayPipeline> linked;
        for (const size_t part : {count / 4, count}) {
            PipelineSetup some = linking;
            some.libraries.resize(part);
            timed("link" + std::to_string(part), 2, [&](size_t) { linked.emplace_back(gpu, some); });
        }
        // Only groups of the application have handles, each has one, and none is null.
        const std::vector<uint8_t> handles = linked.back().groupHandles(0, static_cast<uint32_t>(2 + count));
        const size_t size = handles.size() / (2 + count);
        const std::vector<uint8_t> null(size);
        for (size_t g = 0; g < 2 + count; ++g)
            EXPECT_FALSE(std::equal(null.begin(), null.end(), handles.begin() + static_cast<ptrdiff_t>(g * size)));
        return MadePipeline{std::move(linked.back()), groups};
    };
    PipelineTracer tracer(gpu(), setup);
    scene_->expect(tracer, 0);
}

// As in an engine that reloads shaders while it runs.
TEST_F(PipelineScale, HotReload)
{
    PipelineTracer kept(gpu());
    const std::span<const uint32_t> modules[] = {tracer_constant_000, tracer_constant_001, tracer_constant_040,
                                                 tracer_constant_400};
    uint64_t warm = 0, warmAllocations = 0;
    std::optional<Tracer> query;
    std::optional<PipelineTracer> pipeline;
    const size_t count = scaled(100);
    timed("reload", count, [&](size_t i) {
        if (i == count / 2) {
            warm = Footprint::now().resident;
            warmAllocations = allocations();
        }
        query.emplace(gpu(), modules[i % std::size(modules)]);
        pipeline.emplace(gpu());
    });
    if (kResidentIsMeaningful) {
        EXPECT_LT(Footprint::now().resident, warm + (8 << 20));
    }
    EXPECT_EQ(allocations(), warmAllocations);
    scene_->expect(*pipeline, 0);
    scene_->expect(kept, 0);
}

} // namespace
