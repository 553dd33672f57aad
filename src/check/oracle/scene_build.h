// SPDX-License-Identifier: Apache-2.0
// A scene on a device.
#pragma once

#include "check/oracle/cpu_trace.h"

namespace vellum::check::oracle
{

inline constexpr uint32_t kCapacity = 64; // candidates of a ray

// The scene on the device.
struct Built {
    std::vector<std::unique_ptr<Micromap>> micromaps;
    std::vector<std::unique_ptr<Blas>> objects;
    std::unique_ptr<Tlas> scene;
};

// The record offset of instance i: its own or else i % kRecordOffsets, and kBoxRecords more where it is one of boxes.
inline constexpr uint32_t kRecordOffsets = 6;
inline constexpr uint32_t kMostGeometries = 20; // of an object
inline constexpr uint32_t kBoxRecords = kRecordOffsets + kMostGeometries - 1;
uint32_t recordOffset(const Scene &scene, uint32_t instance);
Built build(Device &gpu, const Scene &scene);
// The parts of that.
MicromapInput inputOf(const SceneMicromap &micromap);
// spareTriangles: copies of the first ones, that are not built.
std::vector<Geometry> geometriesOf(const Object &object, std::span<const std::unique_ptr<Micromap>> micromaps,
                                   uint32_t spareTriangles = 0);
VkBuildAccelerationStructureFlagsKHR structureFlags(const Device &gpu);
std::vector<VkAccelerationStructureInstanceKHR> instancesOf(const Scene &scene,
                                                            std::span<const Structure *const> objects);

// Returns whether the shader confirms a candidate.
bool confirms(const Ray &ray, const Hit &hit);

template <class Hit, class T>
bool names(const Hit &hit, const T &other)
{
    return hit.instance == other.instance && hit.geometry == other.geometry && hit.primitive == other.primitive &&
           hit.customIndex == other.customIndex;
}

} // namespace vellum::check::oracle
