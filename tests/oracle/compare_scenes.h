// SPDX-License-Identifier: Apache-2.0
// Shared by the oracle tests of ray queries and of ray tracing pipelines.
#pragma once

#include <functional>

#include "check/oracle/random_scene.h"
#include "check/oracle/scene_build.h"
#include "harness/harness.h"

namespace vellum::check::oracle
{

// A number from the environment:
//   VELLUM_ORACLE_SEED    seed of the first scene (each scene has its own: this plus its number)
//   VELLUM_ORACLE_SCENES  number of scenes
uint32_t setting(const char *name, uint32_t otherwise);

// Traces the rays of a scene. `fault` describes what is wrong with the result of a ray; it is empty if the result is
// right.
struct Traced {
    std::string fault;
    uint32_t candidates;
    bool hit;
};
using TraceScene = std::function<std::vector<Traced>(const Scene &, std::span<const Hits>)>;
// Traces `scenes` random scenes. Expects no fault, and at least `minimum` rays whose result is defined.
void compareScenes(vt::Gpu &gpu, const Limits &limits, uint32_t scenes, uint64_t minimum, const TraceScene &trace);

} // namespace vellum::check::oracle
