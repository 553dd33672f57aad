// SPDX-License-Identifier: Apache-2.0
// Random scenes, traced by ray queries through the layer and by the oracle, compared ray by ray: the candidates handed
// to the shader and the hit that stays.
#include "check/oracle/packed_scene.h"
#include "check/oracle/query_judge.h"
#include "compare_scenes.h"

namespace
{

using namespace oracle;

std::vector<Traced> judged(const Scene &scene, std::span<const Hits> hits, const std::vector<vt::Result> &results)
{
    std::vector<Traced> traced;
    for (size_t i = 0; i < results.size(); ++i)
        traced.push_back({queryFault(scene.rays[i], hits[i].hits, results[i]), results[i].candidateCount,
                          results[i].committed != vt::kNone});
    return traced;
}

void compare(vt::Gpu &gpu, const Limits &limits, uint32_t scenes, uint64_t minimum)
{
    vt::Tracer tracer(gpu);
    compareScenes(gpu, limits, scenes, minimum, [&](const Scene &scene, std::span<const Hits> hits) {
        const Built built = build(gpu, scene);
        return judged(scene, hits, tracer.trace(*built.scene, scene.rays, kCapacity));
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

// The scenes in packed memory: traced while one of their objects is built beside it, changed in place, and traced
// again.
class PackedOracle : public vt::GpuTest
{
protected:
    explicit PackedOracle(vt::Memory memory = vt::Memory::Packed)
        : GpuTest({.validation = false, .maintenance = true, .memory = memory})
    {
    }

    void comparePacked(uint32_t scenes, uint64_t minimum)
    {
        vt::Tracer tracer(gpu());
        Random random(setting("VELLUM_ORACLE_SEED", 20260519));
        uint64_t traces = 0;
        compareScenes(gpu(), {.rays = 160}, scenes, minimum, [&](const Scene &scene, std::span<const Hits> hits) {
            PackedScene packed(gpu(), scene, random);
            std::vector<Traced> all;
            for (int round = 0; round < 4; ++round, ++traces) {
                packed.traceBesideBuild(tracer, scene.rays, kCapacity);
                std::vector<Traced> traced = judged(scene, hits, tracer.results());
                for (size_t i = 0; i < traced.size(); ++i) {
                    if (all.size() < traced.size() || all[i].fault.empty())
                        traced[i].fault += traced[i].fault.empty() ? "" : " after: " + packed.history();
                    else
                        traced[i].fault = all[i].fault;
                }
                all = std::move(traced);
                if (round < 3)
                    packed.change();
            }
            return all;
        });
        const vt::Arena::Counts counts = gpu().arena()->counts();
        std::printf("%llu traces; arena: %llu buffers, %llu pieces, %llu operations, %llu bytes compared that they may "
                    "not write to\n",
                    static_cast<unsigned long long>(traces), static_cast<unsigned long long>(counts.buffers),
                    static_cast<unsigned long long>(counts.pieces), static_cast<unsigned long long>(counts.operations),
                    static_cast<unsigned long long>(counts.otherBytes));
    }
};

class PackedToTheEndOracle : public PackedOracle
{
protected:
    PackedToTheEndOracle() : PackedOracle(vt::Memory::PackedToTheEnd) {}
};

// Whether oracle and driver agree where Vellum has no part.
TEST_F(OracleWithoutLayer, PlainScenes)
{
    compare(gpu(), {.micromaps = false}, 40, 20000);
}

TEST_F(Oracle, RandomScenes)
{
    compare(gpu(), {}, 400, 200000);
}

// Fewer and finer: micromaps up to level 9.
TEST_F(Oracle, FineMicromaps)
{
    compare(gpu(), {.maxLevel = 9, .rays = 400}, 20, 1000);
}

TEST_F(Oracle, PlainScenes)
{
    compare(gpu(), {.micromaps = false}, 40, 20000);
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
