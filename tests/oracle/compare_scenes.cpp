// SPDX-License-Identifier: Apache-2.0
#include "compare_scenes.h"

#include "check/groups/random_case.h"

#include <cstdio>
#include <cstdlib>

namespace vellum::check::oracle
{

uint32_t setting(const char *name, uint32_t otherwise)
{
    const char *value = std::getenv(name);
    return value != nullptr ? static_cast<uint32_t>(std::strtoul(value, nullptr, 0)) : otherwise;
}

void compareScenes(vt::Gpu &gpu, const Limits &limits, uint32_t scenes, uint64_t minimum, const TraceScene &trace)
{
    const uint32_t seed = setting("VELLUM_ORACLE_SEED", 20260519);
    scenes = setting("VELLUM_ORACLE_SCENES", scenes);
    std::printf("seed %u, %u scenes\n", seed, scenes);
    uint64_t compared = 0, unsure = 0, handed = 0, hit = 0;
    int faults = 0;
    for (uint32_t s = 0; s < scenes; ++s) {
        Random random(seed + s);
        const Scene scene = vellum::check::makeScene(random, limits, vellum::check::limitsOf(gpu));
        std::vector<Hits> hits;
        for (const vt::Ray &ray : scene.rays)
            hits.push_back(allHits(scene, ray));
        const std::vector<Traced> traced = trace(scene, hits);
        for (size_t i = 0; i < traced.size(); ++i) {
            if (hits[i].unsure) {
                ++unsure;
                continue;
            }
            ++compared;
            handed += traced[i].candidates;
            hit += traced[i].hit ? 1u : 0u;
            if (!traced[i].fault.empty() && ++faults <= 10)
                ADD_FAILURE() << "scene seed " << seed + s << " ray " << i << std::hex << " flags 0x"
                              << scene.rays[i].flags << std::dec << ": " << traced[i].fault;
        }
    }
    std::printf("%llu rays compared, %llu too close to call, %llu candidates, %llu hits\n",
                static_cast<unsigned long long>(compared), static_cast<unsigned long long>(unsure),
                static_cast<unsigned long long>(handed), static_cast<unsigned long long>(hit));
    EXPECT_EQ(faults, 0);
    EXPECT_LT(static_cast<double>(unsure), 0.06 * static_cast<double>(compared + unsure));
    if (std::getenv("VELLUM_ORACLE_SCENES") == nullptr) {
        EXPECT_GE(compared, minimum);
    }
}

} // namespace vellum::check::oracle
