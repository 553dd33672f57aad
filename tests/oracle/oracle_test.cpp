// SPDX-License-Identifier: Apache-2.0
// Random scenes, traced by ray queries through the layer and by the oracle, compared ray by ray: the candidates handed
// to the shader and the hit that stays.
#include "check/groups/random_case.h"
#include "check/oracle/query_fault.h"
#include "compare_scenes.h"
#include "gpu/arena.h"

namespace
{

using namespace vellum::check::oracle;
using namespace vellum::check;

std::vector<Traced> checked(const Scene &scene, std::span<const Hits> hits, const std::vector<vt::Result> &results)
{
    std::vector<Traced> traced;
    for (size_t i = 0; i < results.size(); ++i)
        traced.push_back({queryFault(scene, scene.rays[i], hits[i].hits, results[i]), results[i].candidateCount,
                          results[i].committed != vt::kNone});
    return traced;
}

void compareQueries(vt::Gpu &gpu, const Limits &limits, uint32_t scenes, uint64_t minimum)
{
    vt::Tracer tracer(gpu);
    compareScenes(gpu, limits, scenes, minimum, [&](const Scene &scene, std::span<const Hits> hits) {
        const Built built = build(gpu, scene);
        return checked(scene, hits, tracer.trace(*built.scene, scene.rays, kCapacity));
    });
}

class Oracle : public vt::GpuTest
{
};

class OracleWithoutLayer : public vt::GpuTest
{
protected:
    OracleWithoutLayer() : GpuTest({.vellum = false, .validation = false, .micromaps = false}) {}
};

// The scenes in packed memory, changed by random steps.
class PackedOracle : public vt::GpuTest
{
protected:
    explicit PackedOracle(vt::Memory memory = vt::Memory::Packed)
        : GpuTest({.validation = false, .maintenance = true, .memory = memory})
    {
    }

    // Random steps of all kinds, on scenes that are built by several threads.
    void comparePacked(uint32_t scenes, uint64_t minimum)
    {
        std::array<Step::Kind, static_cast<size_t>(Step::Kind::Count)> kinds{};
        for (size_t i = 0; i < kinds.size(); ++i)
            kinds[i] = static_cast<Step::Kind>(i);
        const DeviceLimits limits = limitsOf(gpu());
        const uint32_t seed = setting("VELLUM_ORACLE_SEED", 20260519);
        scenes = setting("VELLUM_ORACLE_SCENES", scenes);
        uint64_t rays = 0, steps = 0;
        for (uint32_t s = 0; s < scenes; ++s) {
            Random random(seed + s);
            Case c{.scene = makeScene(random, {.rays = 160, .byteIndices = limits.byteIndices}, limits)};
            c.build = {.together = below(random, 3) == 0, .threads = 3, .instancePointers = below(random, 2) == 0};
            c.trace.besideBuild = below(random, 2) == 0;
            addSteps(random, c, kinds, 16, limits);
            const Verdict verdict = run(gpu(), c);
            EXPECT_FALSE(verdict.skipped) << verdict.cause;
            EXPECT_FALSE(verdict.failed()) << "scene seed " << seed + s << ": " << verdict.detail;
            rays += verdict.rays;
            steps += c.steps.size();
        }
        const Arena::Counts counts = gpu().arena()->counts();
        std::printf(
            "%llu rays, %llu steps; arena: %llu buffers, %llu pieces, %llu operations, %llu bytes compared that "
            "they may not write to\n",
            static_cast<unsigned long long>(rays), static_cast<unsigned long long>(steps),
            static_cast<unsigned long long>(counts.buffers), static_cast<unsigned long long>(counts.pieces),
            static_cast<unsigned long long>(counts.operations), static_cast<unsigned long long>(counts.otherBytes));
        if (std::getenv("VELLUM_ORACLE_SCENES") == nullptr) {
            EXPECT_GE(rays, minimum);
        }
    }
};

class PackedToTheEndOracle : public PackedOracle
{
protected:
    PackedToTheEndOracle() : PackedOracle(vt::Memory::PackedToTheEnd) {}
};

// Checks that oracle and driver agree without Vellum.
TEST_F(OracleWithoutLayer, PlainScenes)
{
    compareQueries(gpu(), {.micromaps = false}, 40, 20000);
}

// As above, with geometry in all its forms.
TEST_F(OracleWithoutLayer, UnusualGeometry)
{
    compareQueries(
        gpu(), {.micromaps = false, .unusual = 80, .inactive = !gpu().onLavapipe26(), .formats = gpu().vertexFormats()},
        60, 20000);
}

TEST_F(Oracle, UnusualGeometry)
{
    compareQueries(gpu(), {.unusual = 80, .inactive = !gpu().onLavapipe26(), .formats = gpu().vertexFormats()}, 60,
                   20000);
}

TEST_F(Oracle, RandomScenes)
{
    compareQueries(gpu(), {}, 400, 200000);
}

// Fewer and finer: micromaps up to level 9.
TEST_F(Oracle, FineMicromaps)
{
    compareQueries(gpu(), {.maxLevel = 9, .rays = 400}, 20, 1000);
}

TEST_F(Oracle, PlainScenes)
{
    compareQueries(gpu(), {.micromaps = false}, 40, 20000);
}

TEST_F(PackedOracle, RandomScenes)
{
    comparePacked(100, 14000);
}

TEST_F(PackedToTheEndOracle, RandomScenes)
{
    comparePacked(100, 14000);
}

} // namespace
