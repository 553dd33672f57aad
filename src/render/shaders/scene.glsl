// SPDX-License-Identifier: Apache-2.0
// The resources of the picture's shaders.
#ifndef VELLUM_SCENE_GLSL
#define VELLUM_SCENE_GLSL
#extension GL_EXT_nonuniform_qualifier : require

layout(constant_id = 0) const uint kTextures = 1;
layout(constant_id = 1) const uint kHeavyReads = 0; // additional texture reads per candidate
layout(constant_id = 2) const bool kCount = false;  // write how many candidates each ray was handed
layout(constant_id = 3) const bool kPaint = false;  // the states of micromaps; by ray queries only
layout(constant_id = 4) const bool kVertexAlphas = false; // some geometry has them

const uint kSolid = 0u;
const uint kLeaves = 1u;
const uint kGround = 2u;

struct GeometryRecord {
    uint firstTriangle;
    int texture;
    float cutoff;
    uint kind;
    vec4 color;
    int firstAlpha; // -1: none
};

layout(binding = 0) uniform accelerationStructureEXT world;
layout(std430, binding = 1) writeonly buffer Pixels { uint pixels[]; };
layout(std430, binding = 2) readonly buffer Geometries { GeometryRecord geometries[]; };
layout(std430, binding = 3) readonly buffer Uvs { vec2 uvs[]; };
layout(std430, binding = 4) readonly buffer Normals { uint normals[]; };
layout(std430, binding = 5) writeonly buffer Counts { uvec2 counts[]; }; // candidates, rays
layout(std430, binding = 7) readonly buffer Alphas { float alphas[]; }; // with kVertexAlphas
layout(binding = 8) uniform sampler2D textures[kTextures];

layout(push_constant) uniform Frame {
    vec4 origin;  // w: scale of the scene
    vec4 right;   // w: pixels across
    vec4 up;      // w: pixels down
    vec4 forward; // w: samples per pixel
    vec4 sun;     // towards it
} frame;

uvec2 pictureSize()
{
    return uvec2(frame.right.w, frame.up.w);
}

vec2 textureCoordinates(GeometryRecord g, uint primitive, vec2 b)
{
    const uint first = 3u * (g.firstTriangle + primitive);
    return uvs[first] * (1.0 - b.x - b.y) + uvs[first + 1u] * b.x + uvs[first + 2u] * b.y;
}

#endif
