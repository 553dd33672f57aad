// SPDX-License-Identifier: Apache-2.0
// What the oracle tests of ray queries and of ray tracing pipelines share.
#pragma once

#include <functional>

#include "cpu_trace.h"

namespace oracle
{

inline constexpr uint32_t kCapacity = 64; // candidates of a ray

// A number from the environment:
//   VELLUM_ORACLE_SEED    seed of the first scene (each scene has its own: this plus its number)
//   VELLUM_ORACLE_SCENES  number of scenes
uint32_t setting(const char *name, uint32_t otherwise);

// The scene on the device.
struct Built {
    std::vector<std::unique_ptr<vt::Micromap>> micromaps;
    std::vector<std::unique_ptr<vt::Blas>> objects;
    std::unique_ptr<vt::Tlas> scene;
};

// Instance i has the record offset i % kRecordOffsets, and kBoxRecords more where it is one of boxes.
inline constexpr uint32_t kRecordOffsets = 6;
inline constexpr uint32_t kBoxRecords = 8; // an object has up to three geometries
uint32_t recordOffset(const Scene &scene, uint32_t instance);
Built build(vt::Gpu &gpu, const Scene &scene);
// The parts of that. makeMicromap is called for each geometry with a micromap.
std::vector<vt::Geometry> geometriesOf(const Object &object,
                                       const std::function<const vt::Micromap *(vt::MicromapInput)> &makeMicromap);
VkBuildAccelerationStructureFlagsKHR structureFlags(const vt::Gpu &gpu);
std::vector<VkAccelerationStructureInstanceKHR> instancesOf(const Scene &scene,
                                                            std::span<const vt::Structure *const> objects);

// What the shader does with a candidate.
bool confirms(const vt::Ray &ray, const Hit &hit);

template <class T>
bool names(const Hit &hit, const T &other)
{
    return hit.instance == other.instance && hit.geometry == other.geometry && hit.primitive == other.primitive &&
           hit.customIndex == other.customIndex;
}

// Traces all rays of a scene and says of each what is wrong with its result (empty: nothing).
struct Traced {
    std::string fault;
    uint32_t candidates;
    bool hit;
};
using TraceScene = std::function<std::vector<Traced>(const Scene &, std::span<const Hits>)>;
// Traces that many random scenes and expects no fault, and at least `minimum` rays that could be judged.
void compareScenes(vt::Gpu &gpu, const Limits &limits, uint32_t scenes, uint64_t minimum, const TraceScene &trace);

} // namespace oracle
