// SPDX-License-Identifier: Apache-2.0
// A scene prepared for the renderer: what the shader reads, laid out as it reads it, and where the copies stand.
#pragma once

#include <cstdint>
#include <vector>

#include "render/math.h"

namespace vellum::render
{

// shaders/scene.glsl reads this
struct GeometryRecord {
    uint32_t firstTriangle; // in uvs and normals
    int32_t texture;        // -1: none
    float cutoff;
    uint32_t kind;      // a Kind
    float color[4];     // linear
    int32_t firstAlpha; // in alphas; -1: none, all are 1
    uint32_t unused[3];
};
static_assert(sizeof(GeometryRecord) == 48);

enum class Kind : uint32_t { Solid = 0, Leaves = 1, Ground = 2 };

struct RenderScene {
    Scene scene;     // single meshes are merged
    Geometry ground; // a grid around the copies
    std::vector<Placement> copies;
    Box bounds;                // of all copies, without the ground
    std::vector<Vec3> outline; // some of their points above the ground, for the camera

    std::vector<uint32_t> texturedMaterials; // the material that each texture of the shader is for

    std::vector<GeometryRecord> records; // of the scene's geometries, then the ground's
    std::vector<float> uvs;              // three (u, v) per triangle
    std::vector<float> alphas;           // of vertices, three per triangle of geometries that have some
    std::vector<uint32_t> normals; // three per triangle: octahedral normal (12 + 12 bits), sky visibility (8 bits)

    // The number of triangles of all instances in one copy.
    [[nodiscard]] uint64_t maskedTriangles() const;
    [[nodiscard]] uint64_t solidTriangles() const;
};

// Takes a scene over, with `copies` (1 or more) of it standing on a square grid. Throws Error where there are too many
// instances for that, or nothing is left to be seen.
RenderScene prepareScene(Scene scene, uint32_t copies);

} // namespace vellum::render
