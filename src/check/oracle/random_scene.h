// SPDX-License-Identifier: Apache-2.0
// Random scenes: triangle soups with random micromaps, boxes, instances and rays, as plain data.
#pragma once

#include <cstdint>
#include <random>

#include "check/gpu/tracer.h"

namespace vellum::check::oracle
{

using Random = std::mt19937;

struct MicromapTriangle {
    uint32_t level;
    uint16_t format;
    std::vector<uint8_t> states; // in the order of the curve
};

struct MeshMicromap {
    std::vector<MicromapTriangle> triangles;
    std::vector<int32_t> indices; // what the index buffer holds
    VkIndexType indexType;
    uint32_t base;
    bool null; // special indices only, no micromap object
};

struct Mesh { // a geometry
    std::vector<check::Vec3> vertices;
    std::vector<VkAabbPositionsKHR> boxes; // not empty: instead of triangles
    bool opaque;
    std::optional<MeshMicromap> micromap;
};

struct Object { // a bottom-level structure: triangles or boxes
    std::vector<Mesh> meshes;
};

struct Instance {
    uint32_t object;
    VkTransformMatrixKHR transform;
    uint32_t customIndex;
    uint32_t mask;
    uint32_t flags;
    bool inactive; // acceleration structure reference 0
};

struct Scene {
    std::vector<Object> objects;
    std::vector<Instance> instances;
    std::vector<check::Ray> rays;
};

struct Limits {
    bool micromaps = true;
    uint32_t maxLevel = 5;
    uint32_t rays = 640;
};

Scene randomScene(Random &random, const Limits &limits);

} // namespace vellum::check::oracle
