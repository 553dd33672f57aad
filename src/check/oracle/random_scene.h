// SPDX-License-Identifier: Apache-2.0
// Random scenes: triangle soups with random micromaps, boxes, instances and rays.
#pragma once

#include <cstdint>
#include <random>

#include "check/oracle/scene.h"

namespace vellum::check::oracle
{

using Random = std::mt19937;

inline uint32_t below(Random &random, uint32_t n)
{
    return static_cast<uint32_t>(random() % n);
}
inline bool chance(Random &random, uint32_t percent)
{
    return below(random, 100) < percent;
}

// What random scenes may contain.
struct Limits {
    bool micromaps = true;
    uint32_t maxLevel = 5;
    uint32_t rays = 640;
    bool byteIndices = false; // VK_INDEX_TYPE_UINT8 for micromaps
    bool lossy = false;       // some micromaps are built with kLossy
    bool oddStrides = false;  // triangleArrayStride need not be a multiple of 4 (VK_EXT_opacity_micromap)
    uint32_t objects = 5;     // at most
    uint32_t meshes = 3;      // of an object, at most
    uint32_t instances = 10;  // at most
    uint32_t triangles = 32;  // of a mesh, at most
    uint32_t boxes = 20;      // of 100 objects, how many are of boxes
    // The percentage of meshes with an unusual memory layout, and the vertex formats that they may have.
    uint32_t unusual = 0;
    bool inactive = true; // some triangles and AABBs of unusual meshes are inactive
    std::vector<VkFormat> formats = {VK_FORMAT_R32G32B32_SFLOAT};
};

Scene randomScene(Random &random, const Limits &limits);
// A triangleArrayStride of at least 8.
uint32_t randomTriangleStride(Random &random, bool odd);
// The parts of that.
MicromapTriangle randomTriangle(Random &random, uint32_t maxLevel);
// Each of its states is random, without uniform stretches.
MicromapTriangle mixedTriangle(Random &random, uint32_t level, uint16_t format);
// The use of a micromap of the scene, which must not be empty, or a null one, by a mesh of that many triangles.
MeshMicromap randomUse(Random &random, const Scene &scene, uint32_t triangles, const Limits &limits);
Ray randomRay(Random &random, const Limits &limits);
Instance randomInstance(Random &random, uint32_t objects, const Limits &limits);

} // namespace vellum::check::oracle
